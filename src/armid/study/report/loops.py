"""The report of a study that closes the loop: against the truth, which it alone opens."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pandas import DataFrame

from armid.model import ArmidError
from armid.study.figures import Figure
from armid.study.loops.advice import separations
from armid.study.loops.judge import MISSING, judged
from armid.study.loops.key import read_key
from armid.study.loops.targets import Target, of_class, targets_of
from armid.study.report import loop_words as words
from armid.study.report.advice import advice_parts
from armid.study.report.loop_figures import loop_figures
from armid.study.report.report import Report, Section
from armid.study.results import StudyResults
from armid.study.tables import Column, Table
from armid.study.tables.loop_answers import answers_by_class, answers_by_effect, false_alarms, group_sizes
from armid.study.tables.loop_campaigns import all_campaigns, said_lines
from armid.study.tables.loop_errors import held_out, parameter_bias, times, trust
from armid.study.tables.loop_targets import loop_targets


def loops_report(results: StudyResults, key: Path | None = None) -> Report:
    """Return tables and figures of a study of loops, as far as it was run, held against the truth.

    key: file of the truth, None: the one that the study names.

    Raises ArmidError when no run has ended, and when there is no key.
    """
    study, name = results.study, results.study["name"]
    if results.runs.empty:
        raise ArmidError(f"study '{name}' has no finished run: nothing can be reported")
    if key is None and not study["key"]:
        raise ArmidError(f"study '{name}' names no key: the file that holds the truth is expected, --key FILE tells it")
    entries = read_key(key or results.path.parent / study["key"], study["made_by"])
    names = [case["name"] for case in study["cases"]]
    if study["report"] == "advice":
        targets, main, parts = advice_parts(separations(results.loops, entries, names))
    else:
        rows = judged(results.loops, entries, names)
        targets = targets_of(rows)
        main = loop_targets(targets)
        parts = sections(rows, main)
    told = str(study["question"]), state(results), facts(results, [entries[n]["class"] for n in names])
    return Report(name, *told, main, parts, (answer(targets),))


def loops_summary(results: StudyResults) -> Report:
    """Return what was said, without any truth: verdicts and the effects that were named."""
    return Report(results.study["name"], "", state(results), (), verdicts(results.loops), ())


def answer(targets: Sequence[Target]) -> str:
    """Return how many aims were met, and which were missed."""
    told = [t for t in targets if t.met is not None]
    missed = [f"{t.topic}, {t.question}" for t in told if not t.met]
    counted = f"{len(told) - len(missed)} of {len(told)} targets are met"
    return f"{counted}; missed: {'; '.join(missed)}." if missed else f"{counted}."


def sections(rows: DataFrame, main: Table) -> tuple[Section, ...]:
    """Return everything under its headings."""
    there = rows[rows["judgement"] != MISSING]
    if there.empty:
        return (Section("Targets", "", (main,)),)
    drawn = loop_figures(there)
    two, unlisted, one = (of_class(there, label) for label in ("two", "unlisted", "one_stroke"))
    alarms = false_alarms(there)
    made = (
        Section("Targets", words.TARGETS, (main,)),
        Section("Answers", "", (answers_by_class(rows), answers_by_effect(there)), chosen(drawn, "answers", "confusion",
                                                                                      "named_first")),
        Section("False alarms", "", (alarms,), chosen(drawn, "false_alarms")),
        Section("Two effects", "", lines(two, "two", "Two effects at once", words.TWO)),
        Section("Effects that no library has", "", lines(unlisted, "unlisted", "Unlisted effects", words.UNLISTED)),
        Section("One stroke only", "", lines(one, "one_stroke", "One stroke", words.ONE_STROKE)),
        Section("Errors and parameters", "", (held_out(there), parameter_bias(there), trust(there)),
                chosen(drawn, "held_out", "bias")),
        Section("Groups and times", "", (group_sizes(there), times(there), all_campaigns(rows)),
                chosen(drawn, "groups_and_times")),
    )  # fmt: skip
    return tuple(s for s in made if s.tables or s.figures)


def lines(rows: DataFrame, name: str, title: str, said: str) -> tuple[Table, ...]:
    """Return a table of campaigns, none where there are none."""
    return (said_lines(rows, name, title, said),) if len(rows) else ()


def chosen(drawn: dict[str, Figure], *names: str) -> tuple[Figure, ...]:
    """Return figures by name, those that there are."""
    return tuple(drawn[name] for name in names if name in drawn)


def verdicts(loops: DataFrame) -> Table:
    """Return how often each verdict was given, and what was named with it."""
    named = [" + ".join(report["effects"]) or "nothing" for report in loops["report"]]
    counts = loops.assign(named=named).groupby(["verdict", "named"]).size().rename("n").reset_index()
    columns = Column("verdict", "verdict"), Column("named", "named"), Column("n", "campaigns", ".0f")
    return Table("verdicts", "What was said", words.VERDICTS, counts, columns)


def state(results: StudyResults) -> str:
    """Return how much of the study was run."""
    planned, done, failed = (int(results.study[k]) for k in ("n_planned", "n_done", "n_failed"))
    lost = f", {failed} of them failed" if failed else ""
    if done + failed < planned:
        return f"NOT COMPLETE: {done + failed} of {planned} campaigns{lost}; every number below is of these."
    return f"Complete: {done + failed} of {planned} campaigns{lost}."


def facts(results: StudyResults, classes: Sequence[str]) -> tuple[str, ...]:
    """Return how it was made, one sentence each. classes: of the campaigns."""
    study: dict[str, Any] = results.study
    made = f" by `{study['made_by']}`" if study["made_by"] else ""
    numbers = ", ".join(f"{n} {label.replace('_', ' ')}" for label, n in Counter(classes).items())
    candidates = "the effects of the pair alone" if study["rivals"] else f"{len(study['candidates'])} effects"
    versions = ", ".join(f"{name} {v}" for name, v in sorted(study["versions"].items()))
    return (
        f"Synthetic: records of a simulated arm, made{made}; no machine was measured.",
        f"Campaigns: {numbers}. Candidates: {candidates}.",
        words.BLIND,
        f"Versions: {versions}.",
    )
