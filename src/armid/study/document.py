"""The document of a study from its stored results: the answer, how it was made, and its analyses in order."""

import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pandas import DataFrame, RangeIndex
from pandas.api.types import is_bool_dtype, is_extension_array_dtype, is_integer_dtype, is_numeric_dtype

from armid.errors import ArmidError
from armid.report.document import Column, Document, Figure, Line, Listing, Part, Section, Table, listing, slug, unlike
from armid.report.files import markdown, write_files
from armid.report.html import html
from armid.report.result import NewFiles
from armid.report.style import pyplot
from armid.study.analyses.analysis import Evidence, wide_runs
from armid.study.analyses.convergence import ANYTIME, BEST_FITNESS, CONVERGENCE, RUNNING_TIME, SUCCESS
from armid.study.analyses.cramer_rao import CRAMER_RAO
from armid.study.analyses.errors import ERRORS, FITNESS_QUALITY
from armid.study.analyses.overview import OVERVIEW, RUNS_ANALYSIS, answer_of, loop_runs, loop_tables, main_table
from armid.study.analyses.paper_tables import TABLE1, TABLE2
from armid.study.analyses.ranks import BY_CLASS, RANKS, class_ranks
from armid.study.results import StudyResults
from armid.study.spec import CLOSES_LOOP, IDENTIFIES, KIND_NAMES
from armid.units import DEG, angles_in, counted

# A new analysis is a file in this folder, and a name here.
ANALYSES = (
    OVERVIEW, TABLE1, TABLE2, CRAMER_RAO, FITNESS_QUALITY, SUCCESS, RUNNING_TIME, BEST_FITNESS, CONVERGENCE, ERRORS,
    RANKS, BY_CLASS, ANYTIME, RUNS_ANALYSIS,
)  # fmt: skip
# What stands in the report of a suite: no statistic of single parameters, which differ from problem to problem.
OF_SUITES = (BY_CLASS, ANYTIME, BEST_FITNESS, SUCCESS, RUNNING_TIME, RUNS_ANALYSIS)
# name -> function of the runs, see `armid.study.analyses.analysis.wide_runs`.
OwnAnalyses = Mapping[str, Callable[[DataFrame], Any]]


def own_sections(own: OwnAnalyses, runs: DataFrame) -> tuple[Section, ...]:
    """Return a section for each analysis of a user that returns something; each gets a copy of the runs."""
    # before a plug-in imports it: no window is opened, and the figures look alike
    pyplot()
    sections = []
    for name, function in own.items():
        contents = parts_of(name, function(runs.copy()))
        files = unlike([slug("own", name, title if title != name else "") for title in contents])
        parts = [part(file, title, one) for file, (title, one) in zip(files, contents.items(), strict=True)]
        if parts:
            sections.append(Section(name.replace("_", " ").capitalize(), tuple(parts)))
    return tuple(sections)


def parts_of(name: str, output: Any) -> dict[str, Any]:
    """Return title -> DataFrame or matplotlib figure of what an analysis returned.

    output: a DataFrame, a figure (or what carries one, such as axes), or a dict, tuple or list of these; None: nothing.
    """
    from matplotlib.figure import Figure

    if output is None:
        return {}
    if isinstance(output, Mapping):
        titled = {str(title): part for title, part in output.items()}
    elif isinstance(output, tuple | list):
        titled = {f"{name} {i}": part for i, part in enumerate(output, 1)}
    else:
        titled = {name: output}
    parts = {title: part if isinstance(part, DataFrame) else getattr(part, "figure", part)
             for title, part in titled.items()}  # fmt: skip
    for title, part in parts.items():
        if not isinstance(part, DataFrame | Figure):
            raise ArmidError(f"analysis '{name}' returns a {type(part).__name__} as '{title}': a pandas DataFrame, a "
                             "matplotlib figure, or a dict or tuple of these is expected")  # fmt: skip
        if isinstance(part, DataFrame):
            names = [str(n) for n in (*(n for n in part.index.names if n is not None), *part.columns)]
            if twice := [n for n in names if names.count(n) > 1]:
                raise ArmidError(f"analysis '{name}' returns a table '{title}' with '{twice[0]}' twice as a column or "
                                 "index: each name once is expected")  # fmt: skip
    return parts


def part(file: str, title: str, content: Any) -> Part:
    if not isinstance(content, DataFrame):
        return Figure(file, title, "", lambda: content)
    frame = content if isinstance(content.index, RangeIndex) else content.reset_index()
    frame = frame.set_axis([" ".join(map(str, c)).strip() if isinstance(c, tuple) else str(c) for c in frame], axis=1)
    columns = tuple(Column(str(c), str(c), digits(frame[c].dtype)) for c in frame)
    # what is missing in a column of a pandas type of its own is not a number
    for c in frame:
        if is_extension_array_dtype(frame[c].dtype):
            frame = frame.assign(**{str(c): frame[c].astype(object).where(frame[c].notna(), None)})
    return Table(file, title, "", frame, columns)


def digits(kind: Any) -> str:
    if is_bool_dtype(kind) or not is_numeric_dtype(kind):
        return ""
    return ".0f" if is_integer_dtype(kind) else ".6g"


ALSO_AS_FILES = "each table is there as CSV and LaTeX too, each figure as SVG."
ALONE = "A seed decides the search alone; the noise is the records' own."
PAIRED = "The same seed gives the same noise to all identifiers, so that they are compared in pairs."
SYNTHETIC = (
    "Synthetic: records are simulated from a known truth by the model that is identified, and white noise of the "
    "stated level (standard deviation) is added; no measured data enters."
)
SCORING = (
    "Each loop saw its campaign alone; `python studies/blind/score.py RESULTS --key KEY --out DIR` scores its answers "
    "against the truth."
)


def report_of(
    results: StudyResults, key: Path | None = None, own: OwnAnalyses | None = None, again: str = ""
) -> Document:
    """Return the document of a study as far as it was run; nothing is drawn yet.

    key: file of a truth that was kept from a study of loops, which is not opened here. own: analyses of a user. again:
    command that makes the report again, "" for the plain one.
    Raises ArmidError when no run has ended, and for an unknown kind of study. Also for a key to a study that knows its
    truths, and for an analysis of a user that returns no table and no figure.
    """
    study, own, angle = results.study, own or {}, str(results.study.get("angle", DEG))
    closes_loops = known_kind(study) == CLOSES_LOOP
    if key is not None and not closes_loops:
        raise ArmidError(f"study '{study['name']}' knows its truths, a key is not expected")
    if results.runs.empty:
        raise ArmidError(f"study '{study['name']}' has no finished run: nothing can be reported")
    for name in own:
        if name in {a.name for a in ANALYSES}:
            raise ArmidError(f"analyses: '{name}' is there already, give yours another name")
    answer: tuple[str, ...]
    if closes_loops:
        runs = loop_runs(results.loops)
        sentence, verdicts, campaigns = loop_tables(runs)
        sections = [Section("Verdicts", (verdicts,)), Section("Campaigns", (campaigns,))]
        facts, answer = loop_facts(study, scored=key is not None or bool(study["key"])), (sentence,)
    else:
        with angles_in(angle):
            evidence = Evidence(results)
            analyses = OF_SUITES if evidence.is_suite else ANALYSES
            sections = [Section(a.title, tuple(map(evidence.apart, a.parts(evidence)))) for a in analyses
                        if a.applies(evidence)]  # fmt: skip
            facts, runs, answer = facts_of(evidence), wide_runs(evidence), answer_of(evidence, sections[0].parts[0])
    shown = (*(s for s in sections if s.parts), *own_sections(own, runs), made_section(results, again))
    state = state_of(study)
    is_complete = state.startswith("Complete")
    return Document(
        study["name"], "Study", str(study.get("question", "")), (*answer, state) if is_complete else answer, shown,
        warning="" if is_complete else state, facts=facts, main=shown[0].parts, angle=angle,
    )  # fmt: skip


def summary_of(results: StudyResults) -> Document:
    """Return state and main table alone; no trace is read."""
    if known_kind(results.study) == IDENTIFIES:
        with angles_in(str(results.study.get("angle", DEG))):
            evidence = Evidence(results)
            main = class_ranks(evidence) if evidence.is_suite else main_table(evidence)
            main, answer = evidence.apart(main), answer_of(evidence, main)
    else:
        sentence, main, _ = loop_tables(loop_runs(results.loops))
        answer = (sentence,)
    return Document(results.study["name"], "Study", str(results.study.get("question", "")),
                    (*answer, state_of(results.study)), (), main=(main,))  # fmt: skip


def write_report(document: Document, files: NewFiles) -> None:
    """Write every table as CSV and LaTeX, every figure as PNG and SVG, report.md, and all of it as report.html."""
    write_files(document, files.path)
    commands = document.sections[-1].parts[0]
    again = commands.lines[1].text if isinstance(commands, Listing) else ""
    made = f"Made from the stored results by `{again}`; {ALSO_AS_FILES}"
    files.path("report.md").write_text(markdown(document, made), encoding="utf-8")
    svgs = {f.name: (files.place / f"{f.name}.svg").read_text(encoding="utf-8") for f in document.figures}
    files.path("report.html").write_text(html(document, svgs), encoding="utf-8")


def known_kind(study: dict[str, Any]) -> str:
    kind = str(study.get("kind", IDENTIFIES))
    if kind not in KIND_NAMES:
        raise ArmidError(f"study '{study['name']}' is of kind '{kind}', one of {', '.join(KIND_NAMES)} is expected")
    return kind


def state_of(study: dict[str, Any]) -> str:
    planned, done, failed = (int(study[key]) for key in ("n_planned", "n_done", "n_failed"))
    what = "campaigns" if study.get("kind") == CLOSES_LOOP else "runs"
    lost = f", {failed} of them failed" if failed else ""
    if done + failed < planned:
        return f"NOT COMPLETE: {done + failed} of {planned} {what} have ended{lost}; every number below is of these."
    return f"Complete: {done + failed} of {planned} {what}{lost}."


def facts_of(evidence: Evidence) -> tuple[str, ...]:
    """Return how the study was made, one sentence each."""
    study, runs = evidence.study, evidence.runs
    effects = f" with {', '.join(study['effects'])}" if study.get("effects") else ""
    return (
        origin(study),
        f"Plant: {study['plant']}{effects}. Fitness: {', '.join(dict.fromkeys(runs['fitness']))}.",
        f"{counted(len(evidence.cases), 'case')}, {counted(len(evidence.variants), 'identifier')}, "
        f"{counted(runs['seed'].nunique(), 'seed')}, "
        f"{'budgets' if evidence.is_suite else 'noise and windows'}: {'; '.join(evidence.settings)}.",
        f"Budget: {' and '.join(f'{b:g}' for b in sorted(set(runs['budget'])))} simulations a run; "
        f"{runs['used'].sum():,.0f} in all.",
        PAIRED if runs["noise_deg_s"].notna().any() else ALONE,
        versions(study),
    )


def loop_facts(study: dict[str, Any], scored: bool) -> tuple[str, ...]:
    """Return how a study of loops was made; scored: whether a truth was kept from it."""
    candidates = "differ from campaign to campaign" if study["rivals"] else f"{len(study['candidates'])} effects"
    made = f", made by `{study['made_by']}`" if study["made_by"] else ""
    facts = [f"Campaigns: those in {study['campaigns']}{made}. Candidates: {candidates}."]
    if study["report"]:
        facts.insert(0, "Synthetic: records of a simulated arm; no machine was measured.")
    return (*facts, *((SCORING,) if scored else ()), versions(study))


def origin(study: dict[str, Any]) -> str:
    read = [c for c in study["cases"] if c.get("campaign")]
    parts = [SYNTHETIC] if len(read) < len(study["cases"]) else []
    if read:
        known = " (their truth is known: synthetic)" if any(c.get("truth") for c in read) else ""
        parts.append(f"Records of {', '.join(sorted({str(c['campaign']) for c in read}))}{known}.")
    return " ".join(parts)


def versions(study: dict[str, Any]) -> str:
    named = sorted(dict(study.get("versions") or {}).items())
    return f"Versions: {', '.join(f'{name} {version}' for name, version in named)}."


def made_section(results: StudyResults, again: str) -> Section:
    study = results.study
    plugins = [word for name in study.get("plugins", ()) for word in ("--plugin", str(name))]
    run = shlex.join(["armid", "study", str(study.get("file", f"{study['name']}.toml")), *plugins])
    commands = (Line(str(study.get("command") or run)), Line(again or f"armid report out/{study['name']}"))
    parts: list[Part] = [Listing("Commands; the study's file is below", commands),
                         listing(f"{study['name']}.toml", str(study["text"]), folded=True)]  # fmt: skip
    hashes = [h for h in dict.fromkeys(results.runs["model"]) if isinstance(h, str)]
    models = list(dict.fromkeys(results.text_of(h) for h in hashes))
    for i, model in enumerate(models, 1):
        title = "Equations of the model" if len(models) == 1 else f"Equations of model {i} of {len(models)}"
        parts.append(listing(title, model, folded=True))
    return Section("How it was made", tuple(parts))
