"""The report of a study that closes the loop: against the truth, which it alone opens."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pandas import DataFrame

from armid.errors import ArmidError
from armid.study.analyses.drawing import Figure
from armid.study.analyses.table import Column, Table
from armid.study.blind.figures import (
    advice_figure,
    alarms_figure,
    answers_figure,
    bias_figure,
    held_out_figure,
    names_figure,
    rates_figure,
    sizes_and_times_figure,
)
from armid.study.blind.scores import (
    MISSING,
    NOTHING,
    Target,
    advice_targets,
    judged,
    of_class,
    rates,
    read_key,
    separations,
    targets_of,
)
from armid.study.blind.tables import (
    advice_campaigns,
    advice_rates,
    all_campaigns,
    answer_counts,
    answers_by_class,
    answers_by_effect,
    false_alarms,
    group_sizes,
    held_out,
    loop_targets,
    parameter_bias,
    parts,
    said_lines,
    times,
    trust,
)
from armid.study.report import Report, ReportSection
from armid.study.results import StudyResults

BLIND = (
    "Each loop saw its campaign alone; the key that holds the truth was opened for this report, by nothing before it."
)
TARGETS = "What the closed loop was to reach on undeclared effects, and what it reached."
TWO = (
    "Both right: each truth has its own name, or a group of at most 4 of its own that holds it, and nothing else is "
    "named."
)
UNLISTED = "The arm has an effect that no library holds: a name may explain a part, but not be said to explain all."
ONE_STROKE = "One lowering stroke, with one effect at its middle size or none: what can be known there is little."
VERDICTS = "Campaigns by verdict and by what was added to the declared model."
CONFUSION = (
    "Single effects, a row each: campaigns by what was answered; the colour is the share of the row. Left: campaigns "
    "in which the effect moves the held-out error of the best declared model by more than 20 % of its noise; right: "
    "the others, on which the best answer may be silence. Named first of a group: the truth is named, with others that "
    "cannot be told from it. Held by a group: another is named, and the truth among those that cannot be told from it."
)
NAMED = (
    "Single effects and controls, a row each, by what was named first: an effect, a term without a name at a port, or "
    "nothing. The frame marks the true name; beside it stand groups' first names too."
)
ANSWERS = "Campaigns of each class by their judgement; the number of campaigns stands behind the name."
ALARMS = "Share of the campaigns without any effect on which something was found, with its 95 % Wilson interval."
HELD_OUT = (
    "RMSE on the records held out over the noise that is really in them, before and after the loop, one pair of marks "
    "a campaign; the dashed line is what is aimed at."
)
BIAS = (
    "Size of the relative errors of the parameters before and after the loop, campaigns of one or two listed effects: "
    "the box spans the quartiles, the thick line is the median, the whiskers reach from the 5th to the 95th "
    "percentile. Errors below 0.001 % are drawn there."
)
GROUPS = (
    "Left: campaigns of listed effects by the size of the group that was named. Right: share of the campaigns that "
    "were closed within so many seconds; the dashed line is at 30 s."
)


MOST_ALARMS, MOST_RATIO, MOST_BIAS = 0.02, 1.10, 0.01


def loop_figures(rows: DataFrame) -> dict[str, Figure]:
    """Return name -> figure; one for which there is no campaign is left out."""
    return {"answers": rate_figures(rows)} | of_singles(rows) | of_controls(rows) | of_errors(rows) | of_groups(rows)


def rate_figures(rows: DataFrame) -> Figure:
    """Return the judgements by class."""
    return Figure("answers", "Answers by class", ANSWERS, lambda: rates_figure(answers_by_class(rows).frame))


def of_singles(rows: DataFrame) -> dict[str, Figure]:
    """Return the two confusion matrices."""
    single = of_class(rows, "single")
    if single.empty:
        return {}
    held = single["matters"].astype(bool)
    groups = {"moves the held-out error by more than 20 %": single[held], "moves it less": single[~held]}
    effects = sorted(set(single["truth"]))
    counts = {t: answer_counts(part).reindex(index=effects, fill_value=0) for t, part in groups.items() if len(part)}
    return {
        "confusion": Figure("confusion", "True effect and answer", CONFUSION, lambda: answers_figure(counts)),
        "named_first": Figure("named_first", "True effect and first name", NAMED,
                              lambda: names_figure(first_names(rows))),
    }  # fmt: skip


def first_names(rows: DataFrame) -> DataFrame:
    """Return true effect x what was named first, for single effects and controls: numbers of campaigns."""
    some = rows[rows["class"].isin(["single", "control"])]
    counts = some.groupby(["truth", "first"]).size().unstack(fill_value=0)
    truths, first = sorted(set(some["truth"]) - {NOTHING}), set(some["first"])
    named = [t for t in truths if t in first]
    others = sorted(first - set(truths) - {NOTHING}, key=lambda name: (":" in name, name))
    rest = [NOTHING] if NOTHING in first else []
    return counts.reindex(index=[*truths, *({NOTHING} & set(some["truth"]))], columns=[*named, *others, *rest],
                          fill_value=0)  # fmt: skip


def of_controls(rows: DataFrame) -> dict[str, Figure]:
    """Return the false alarms."""
    alarms = false_alarms(rows).frame
    alarms = alarms[alarms["n"] > 0]
    if alarms.empty:
        return {}
    return {"false_alarms": Figure("false_alarms", "False alarms", ALARMS,
                                   lambda: alarms_figure(alarms, MOST_ALARMS))}  # fmt: skip


def of_errors(rows: DataFrame) -> dict[str, Figure]:
    """Return errors held out and bias."""
    found = {}
    if rows["after_over_floor"].notna().any():
        found["held_out"] = Figure("held_out", "Held-out error over its noise", HELD_OUT,
                                   lambda: held_out_figure(parts(rows), MOST_RATIO))  # fmt: skip
    if rows["class"].isin(["single", "two"]).any():
        found["bias"] = Figure("bias", "Bias of the parameters", BIAS, lambda: bias_figure(rows, MOST_BIAS))
    return found


def of_groups(rows: DataFrame) -> dict[str, Figure]:
    """Return sizes of groups and times."""
    return {"groups_and_times": Figure("groups_and_times", "Sizes of groups, and times", GROUPS,
                                       lambda: sizes_and_times_figure(group_sizes(rows).frame, rows))}  # fmt: skip


LIMIT = 0.80
TARGET_WORDS = "Shares with their 95 % Wilson interval; n: campaigns, each with an advised and with a random record."
FIGURE = (
    "Share of the campaigns in which the true effect of the pair stands alone after one record more, with its 95 % "
    "Wilson interval; the number of campaigns stands behind the pair."
)


def advice_parts(rows: DataFrame) -> tuple[list[Target], Table, tuple[ReportSection, ...]]:
    """Return targets, the main table and all sections. rows: one a campaign, as `separations` gives them."""
    targets = advice_targets(rows)
    main = loop_targets(targets, TARGET_WORDS)
    found = rates(rows)
    drawn = (Figure("advice", "Advised and random records", FIGURE, lambda: advice_figure(found, LIMIT)),)
    tables = (advice_rates(rows), advice_campaigns(rows))
    return (
        targets,
        main,
        (ReportSection("Targets", "", (main,)), ReportSection("Pairs", "", tables, drawn if len(found) else ())),
    )


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


def sections(rows: DataFrame, main: Table) -> tuple[ReportSection, ...]:
    """Return everything under its headings."""
    there = rows[rows["judgement"] != MISSING]
    if there.empty:
        return (ReportSection("Targets", "", (main,)),)
    drawn = loop_figures(there)
    two, unlisted, one = (of_class(there, label) for label in ("two", "unlisted", "one_stroke"))
    alarms = false_alarms(there)
    made = (
        ReportSection("Targets", TARGETS, (main,)),
        ReportSection("Answers", "", (answers_by_class(rows), answers_by_effect(there)),
                      chosen(drawn, "answers", "confusion", "named_first")),
        ReportSection("False alarms", "", (alarms,), chosen(drawn, "false_alarms")),
        ReportSection("Two effects", "", lines(two, "two", "Two effects at once", TWO)),
        ReportSection("Effects that no library has", "", lines(unlisted, "unlisted", "Unlisted effects", UNLISTED)),
        ReportSection("One stroke only", "", lines(one, "one_stroke", "One stroke", ONE_STROKE)),
        ReportSection("Errors and parameters", "", (held_out(there), parameter_bias(there), trust(there)),
                chosen(drawn, "held_out", "bias")),
        ReportSection("Groups and times", "", (group_sizes(there), times(there), all_campaigns(rows)),
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
    return Table("verdicts", "What was said", VERDICTS, counts, columns)


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
        BLIND,
        f"Versions: {versions}.",
    )
