"""The document of a study from its stored results: the answer, how it was made, and the sections of its analyses."""

import shlex
from pathlib import Path
from typing import Any

from armid.errors import ArmidError
from armid.report.document import Document, Line, Listing, Part, Section, listing
from armid.report.files import write_files
from armid.report.html import html
from armid.report.markdown import markdown
from armid.report.result import NewFiles
from armid.study.analyses.analysis import Evidence, wide_runs
from armid.study.analyses.answer import answer_of
from armid.study.analyses.catalogue import ANALYSES, OF_SUITES, OwnAnalyses, own_sections
from armid.study.analyses.loops import campaigns, counted, loop_runs, verdicts
from armid.study.analyses.overview import main_table
from armid.study.analyses.ranks import class_ranks
from armid.study.results import StudyResults
from armid.study.spec import CLOSES_LOOP, IDENTIFIES, KIND_NAMES
from armid.units import DEG, angles_in

BESIDE = "each table is there as CSV and LaTeX too, each figure as SVG."
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
        sections = [Section("Verdicts", (verdicts(runs),)), Section("Campaigns", (campaigns(runs),))]
        facts, answer = loop_facts(study, scored=key is not None or bool(study["key"])), (counted(runs),)
    else:
        with angles_in(angle):
            evidence = Evidence(results)
            analyses = OF_SUITES if evidence.is_suite else ANALYSES
            sections = [Section(a.title, tuple(map(evidence.apart, a.parts(evidence)))) for a in analyses]
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
        runs = loop_runs(results.loops)
        main, answer = verdicts(runs), (counted(runs),)
    return Document(results.study["name"], "Study", str(results.study.get("question", "")),
                    (*answer, state_of(results.study)), (), main=(main,))  # fmt: skip


def write_report(document: Document, files: NewFiles) -> None:
    """Write every table as CSV and LaTeX, every figure as PNG and SVG, report.md, and all of it as report.html."""
    write_files(document, files.path)
    commands = document.sections[-1].parts[0]
    again = commands.lines[1].text if isinstance(commands, Listing) else ""
    files.path("report.md").write_text(markdown(document, f"Made from the stored results by `{again}`; {BESIDE}"),
                                       encoding="utf-8")  # fmt: skip
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
        f"{len(evidence.cases)} cases, {len(evidence.variants)} identifiers, {runs['seed'].nunique()} seeds, "
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
