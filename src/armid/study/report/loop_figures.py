"""The figures of a study of loops."""

from pandas import DataFrame

from armid.study.figures import Figure
from armid.study.figures.loop_confusion import answers_figure, names_figure
from armid.study.figures.loop_errors import bias_figure, held_out_figure
from armid.study.figures.loop_rates import alarms_figure, rates_figure, sizes_and_times_figure
from armid.study.loops.judge import NOTHING
from armid.study.loops.targets import of_class
from armid.study.report import loop_words as words
from armid.study.tables.loop_answers import answer_counts, answers_by_class, false_alarms, group_sizes, parts

MOST_ALARMS, MOST_RATIO, MOST_BIAS = 0.02, 1.10, 0.01


def loop_figures(rows: DataFrame) -> dict[str, Figure]:
    """Return name -> figure; one for which there is no campaign is left out."""
    return {"answers": rates(rows)} | of_singles(rows) | of_controls(rows) | of_errors(rows) | of_groups(rows)


def rates(rows: DataFrame) -> Figure:
    """Return the judgements by class."""
    return Figure("answers", "Answers by class", words.ANSWERS, lambda: rates_figure(answers_by_class(rows).frame))


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
        "confusion": Figure("confusion", "True effect and answer", words.CONFUSION, lambda: answers_figure(counts)),
        "named_first": Figure("named_first", "True effect and first name", words.NAMED,
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
    return {"false_alarms": Figure("false_alarms", "False alarms", words.ALARMS,
                                   lambda: alarms_figure(alarms, MOST_ALARMS))}  # fmt: skip


def of_errors(rows: DataFrame) -> dict[str, Figure]:
    """Return errors held out and bias."""
    found = {}
    if rows["after_over_floor"].notna().any():
        found["held_out"] = Figure("held_out", "Held-out error over its noise", words.HELD_OUT,
                                   lambda: held_out_figure(parts(rows), MOST_RATIO))  # fmt: skip
    if rows["class"].isin(["single", "two"]).any():
        found["bias"] = Figure("bias", "Bias of the parameters", words.BIAS, lambda: bias_figure(rows, MOST_BIAS))
    return found


def of_groups(rows: DataFrame) -> dict[str, Figure]:
    """Return sizes of groups and times."""
    return {"groups_and_times": Figure("groups_and_times", "Sizes of groups, and times", words.GROUPS,
                                       lambda: sizes_and_times_figure(group_sizes(rows).frame, rows))}  # fmt: skip
