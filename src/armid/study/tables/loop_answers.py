"""What closed loops answered: by class of campaigns, by true effect, false alarms, sizes of groups."""

from collections.abc import Mapping, Sequence

from pandas import DataFrame

from armid.study.loops.judge import ANSWERS, MISSING
from armid.study.loops.targets import is_right, is_wrong_alone, middle, of_class
from armid.study.metrics import wilson
from armid.study.tables.table import Column, Table

COUNT = ".0f"
PERCENT = (".1f", 100.0)


def answers_by_class(rows: DataFrame) -> Table:
    """Return how often each judgement was given in each class, single effects by weight and form."""
    groups = {label: part for label, part in parts(rows).items() if len(part)}
    words = list(dict.fromkeys(rows["judgement"]))
    lines = [
        {"class": label, "n": len(part)} | {w: int((part["judgement"] == w).sum()) for w in words}
        | {"right_rate": float(is_right(part).mean()), "wrong_rate": float(is_wrong_alone(part).mean())}
        for label, part in groups.items()
    ]  # fmt: skip
    columns = (
        Column("class", "campaigns"), Column("n", "n", COUNT), Column("right_rate", "right or group [%]", *PERCENT),
        Column("wrong_rate", "wrong alone [%]", *PERCENT), *(Column(w, w.replace("_", " "), COUNT) for w in words),
    )  # fmt: skip
    said = (
        "Judgements: right (every truth named), group (a group of at most 4 holds what is not named), right or half "
        "with extra (a further name), wrong (no name and no group holds a truth), cannot tell, empirical (a term "
        "without a name), none (nothing was found); of effects that no library has: claimed (names alone are said to "
        "explain all), empirical, partial, none."
    )
    return Table("answers", "Answers by class", said, DataFrame(lines), columns)


def parts(rows: DataFrame) -> dict[str, DataFrame]:
    """Return the classes that a reader asks for, by name."""
    single = of_class(rows, "single")
    held, form = single["matters"].astype(bool), single["matching"].astype(bool)
    return {
        "control": of_class(rows, "control"),
        "single, moves the error > 20 %, matching form": single[held & form],
        "single, moves the error > 20 %, other form": single[held & ~form],
        "single, moves it less": single[~held],
        "two": of_class(rows, "two"),
        "unlisted": of_class(rows, "unlisted"),
        "one stroke": of_class(rows, "one_stroke"),
    }


def false_alarms(rows: DataFrame) -> Table:
    """Return how often something was found where there was nothing, by the colour of the noise."""
    controls = of_class(rows, "control")
    groups = {"all": controls} | {kind: controls[controls["noise"] == kind] for kind in ("white", "coloured")}
    lines = []
    for label, part in groups.items():
        alarms = part[~part["judgement"].isin(["right", MISSING])]
        low, high = wilson(len(alarms), len(part)) if len(part) else (float("nan"),) * 2
        said = "; ".join(f"{c}: {n or v}" for c, n, v in zip(alarms["campaign"], alarms["named"], alarms["verdict"],
                                                             strict=True))  # fmt: skip
        rate = len(alarms) / len(part) if len(part) else float("nan")
        lines.append({"noise": label, "n": len(part), "alarms": len(alarms), "rate": rate, "low": low, "high": high,
                      "said": said})  # fmt: skip
    columns = (
        Column("noise", "noise"), Column("n", "controls", COUNT), Column("alarms", "false alarms", COUNT),
        Column("rate", "rate [%]", *PERCENT), Column("low", "low [%]", *PERCENT), Column("high", "high [%]", *PERCENT),
        Column("said", "what was said"),
    )  # fmt: skip
    words = "Campaigns without any effect on which something was named or a discrepancy was seen; 95 % Wilson interval."
    return Table("false_alarms", "False alarms", words, DataFrame(lines), columns)


def answers_by_effect(rows: DataFrame) -> Table:
    """Return one line a true effect and form: answers, error and bias."""
    single = of_class(rows, "single")
    lines = []
    for (truth, form), part in single.groupby(["truth", "form"], sort=True):
        held = part[part["matters"].astype(bool)]
        lines.append({
            "truth": truth, "form": form, "matching": "yes" if part["matching"].iloc[0] else "no", "n": len(part),
            "n_held": len(held), "right": int(is_right(held).sum()), "wrong": int(is_wrong_alone(held).sum()),
            "before": middle(part["before_over_floor"].dropna()), "after": middle(part["after_over_floor"].dropna()),
            "said": "; ".join(sorted({str(n) or "nothing" for n in part["named"]})),
        })  # fmt: skip
    columns = (
        Column("truth", "true effect"), Column("form", "form"), Column("matching", "matching"), Column("n", "n", COUNT),
        Column("n_held", "move > 20 %", COUNT), Column("right", "right of these", COUNT),
        Column("wrong", "wrong alone", COUNT), Column("before", "error/noise before", ".3g"),
        Column("after", "after", ".3g"), Column("said", "what was said"),
    )  # fmt: skip
    words = (
        "Single effects; `right of these` and `wrong alone` count those that move the held-out error by more than "
        "20 %. Held-out error over the noise in the same records, median."
    )
    return Table("effects", "Answers by true effect", words, frame_of(lines, columns), columns)


def group_sizes(rows: DataFrame) -> Table:
    """Return how large the groups are that hold the truth, and the largest of the others."""
    listed = rows[rows["class"].isin(["single", "two", "one_stroke"])]
    right = listed.loc[listed["group_of_truth"] > 0, "group_of_truth"].value_counts()
    wrong = listed.loc[(listed["group_of_truth"] == 0) & (listed["largest_group"] > 0), "largest_group"].value_counts()
    sizes = sorted({int(s) for s in (*right.index, *wrong.index)})
    lines = [{"size": s, "right": int(right.get(s, 0)), "wrong": int(wrong.get(s, 0))} for s in sizes]
    columns = (
        Column("size", "effects in the group", COUNT), Column("right", "holds the truth", COUNT),
        Column("wrong", "does not", COUNT),
    )  # fmt: skip
    words = "Campaigns of listed effects by the size of the group; 1 is a name that stands alone."
    return Table("groups", "Sizes of groups", words, frame_of(lines, columns), columns)


def answer_counts(rows: DataFrame) -> DataFrame:
    """Return true effect x answer: numbers of campaigns, every answer a column."""
    effects = sorted(set(rows["truth"]))
    counts = rows.groupby(["truth", "answer"]).size().unstack(fill_value=0)
    return counts.reindex(index=effects, columns=list(ANSWERS), fill_value=0)


def frame_of(lines: Sequence[Mapping[str, object]], columns: tuple[Column, ...]) -> DataFrame:
    """Return a frame with all columns, also without rows."""
    return DataFrame(lines, columns=[c.key for c in columns])
