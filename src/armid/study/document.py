"""The document of a study from its stored results: the answer, how it was made, and the sections of its analyses."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from armid.errors import ArmidError
from armid.report.document import Document, Line, Listing, Part, Section, listing
from armid.report.files import write_files
from armid.report.html import html
from armid.report.markdown import markdown
from armid.report.result import NewFiles
from armid.study.analyses.analysis import PAPER, Evidence, is_swarm, wide_runs
from armid.study.analyses.catalogue import ANALYSES, OF_SUITES, OwnAnalyses, own_sections
from armid.study.analyses.loops import campaigns, counted, loop_runs, verdicts
from armid.study.analyses.overview import main_table
from armid.study.analyses.ranks import class_ranks, suite_answer
from armid.study.results import StudyResults
from armid.study.spec import CLOSES_LOOP, IDENTIFIES, KIND_NAMES

BESIDE = "each table is there as CSV and LaTeX too, each figure as SVG."
MOST_SETTINGS = 2
# Of the paper's simulations: what its table is to be beaten with.
QUARTER = 0.25
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
    Raises ArmidError when no run has ended, for a key to a study that knows its truths, for a kind of study that nobody
    knows, and for an analysis of a user that returns no table and no figure.
    """
    study, own = results.study, own or {}
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
        found = [Section("Verdicts", (verdicts(runs),)), Section("Campaigns", (campaigns(runs),))]
        facts, answer = loop_facts(study, scored=key is not None or bool(study["key"])), (counted(runs),)
    else:
        evidence = Evidence(results)
        found = [Section(a.title, tuple(a.parts(evidence))) for a in (OF_SUITES if evidence.is_suite else ANALYSES)]
        facts, runs, answer = facts_of(evidence), wide_runs(evidence), answer_of(evidence, found[0].parts[0])
    sections = (*(s for s in found if s.parts), *own_sections(own, runs), made_section(results, again))
    state = state_of(study)
    whole = state.startswith("Complete")
    return Document(
        study["name"], "Study", str(study.get("question", "")), (*answer, state) if whole else answer, sections,
        warning="" if whole else state, facts=facts, main=sections[0].parts,
    )  # fmt: skip


def summary_of(results: StudyResults) -> Document:
    """Return state and main table alone; no trace is read."""
    if known_kind(results.study) == IDENTIFIES:
        evidence = Evidence(results)
        main = class_ranks(evidence) if evidence.is_suite else main_table(evidence)
        answer = answer_of(evidence, main)
    else:
        runs = loop_runs(results.loops)
        main, answer = verdicts(runs), (counted(runs),)
    return Document(results.study["name"], "Study", str(results.study.get("question", "")),
                    (*answer, state_of(results.study)), (), main=(main,))  # fmt: skip


def answer_of(evidence: Evidence, overview: Any) -> tuple[str, ...]:
    """Return the answer to the question of a study that identifies; overview: its main table."""
    if evidence.is_suite:
        return suite_answer(evidence)
    if not evidence.knows_truth:
        return (lowest_fitness(evidence),)
    return (*beside_paper(evidence, overview.frame), *nearest(overview, evidence.settings))


def beside_paper(evidence: Evidence, frame: Any) -> tuple[str, ...]:
    """Return whether the paper's table is reproduced, and beaten at a quarter of the cost; nothing without its row."""
    setting = evidence.settings[0]
    ours = frame[(frame["variant"] != PAPER) & (frame["setting"] == setting)].set_index("variant")
    swarms = ours.loc[[v for v in ours.index if is_swarm(v)]]
    printed = frame.loc[frame["variant"] == PAPER, "largest_median"]
    if printed.empty or swarms.empty:
        return ()
    paper, swarm = float(printed.iloc[0]), swarms.iloc[0]
    cheap = ours[ours["used"] <= QUARTER * swarm["used"]]
    best = cheap.loc[cheap["largest_median"].idxmin()] if len(cheap) else None
    reproduced = swarm["largest_median"] <= paper
    beaten = best is not None and best["largest_median"] < min(paper, swarm["largest_median"])
    words = {(True, True): "Yes, reproduced and beaten", (True, False): "Reproduced, not beaten",
             (False, True): "Not reproduced by its own method, but beaten", (False, False): "No"}  # fmt: skip
    cost = "" if best is None else (f"; with at most a quarter of these, {best.name} is off by "
                                    f"{percent(best['largest_median'])} with {best['used']:,.0f}")  # fmt: skip
    return (f"{words[bool(reproduced), bool(beaten)]}: the paper's printed values are off by {percent(paper)} (largest "
            f"error of a run, median), its own swarm here ({swarm.name}) by {percent(swarm['largest_median'])} with "
            f"{swarm['used']:,.0f} simulations{cost}.",)  # fmt: skip


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


def nearest(overview: Any, settings: Sequence[str]) -> tuple[str, ...]:
    """Return who came nearest to the truth, and how the others (or the paper's result) stand to that."""
    is_paper = overview.frame["variant"] == PAPER
    ours, paper = overview.frame[~is_paper], overview.frame[is_paper]
    said = []
    known = ours.dropna(subset="largest_median")  # not where no truth is known, or each run failed
    settings = [s for s in settings if (known["setting"] == s).any()]
    for setting in settings[:MOST_SETTINGS]:
        own = known[known["setting"] == setting]
        best = own.loc[own["largest_median"].idxmin()]
        said.append(f"{setting}: {best['variant']}, median largest error of a run {percent(best['largest_median'])}, "
                    f"95 % of its {best['n']} runs within {percent(best['largest_p95'])}")  # fmt: skip
    more = len(settings) - MOST_SETTINGS
    first = f"Nearest to the truth: {'; '.join(said)}{f'; {more} more settings below' if more > 0 else ''}."
    medians = ours[ours["setting"] == settings[0]].set_index("variant")["largest_median"]
    if len(paper):
        error = float(paper["largest_median"].iloc[0])
        return first, (f"{PAPER[0].upper()}{PAPER[1:]}, from its printed values on its own data, has {percent(error)}; "
                       f"{(medians < error).sum()} of {len(medians)} identifiers are below that.")  # fmt: skip
    if len(medians) == 1:
        return (first,)
    return first, f"Of {len(medians)} identifiers the furthest is {medians.idxmax()} with {percent(medians.max())}."


def lowest_fitness(evidence: Evidence) -> str:
    done = evidence.runs[evidence.runs["status"] == "done"]
    if done.empty:
        return "No run has a result."
    medians = done.groupby(["fitness", "variant"], sort=False)["value"].median()
    said = [f"{medians.loc[f].idxmin()}, {medians.loc[f].min():.6g} of {f}" for f in dict.fromkeys(done["fitness"])]
    return f"No truth is known. Lowest median fitness: {'; '.join(said)}."


def percent(value: float) -> str:
    return "not finite" if not np.isfinite(value) else f"{100.0 * value:.3g} %"


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
