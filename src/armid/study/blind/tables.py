"""What closed loops answered: by class of campaigns, by true effect, false alarms, sizes of groups."""

from collections.abc import Mapping, Sequence

import numpy as np
from pandas import DataFrame

from armid.study.analyses.success import wilson
from armid.study.analyses.table import Column, Table
from armid.study.blind.scores import (
    ANSWERS,
    MISSING,
    PARAMETERS,
    Target,
    bias,
    is_right,
    is_wrong_alone,
    matching_rows,
    middle,
    of_class,
    rates,
)

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


FORMS = {"matching": True, "other": False}


def held_out(rows: DataFrame) -> Table:
    """Return the error held out before and after, over the noise, by class."""
    lines = []
    for label, part in parts(rows).items():
        known = part.dropna(subset=["after_over_floor"])
        if known.empty:
            continue
        before, after = known["before_over_floor"], known["after_over_floor"]
        lines.append({
            "class": label, "n": len(known), "before": before.median(), "before_most": before.max(),
            "after": after.median(), "after_90": after.quantile(0.9), "after_most": after.max(),
            "within": float((after <= 1.10).mean()), "cut": known["cut"].median(),
            "excess_cut": known["excess_cut"].median(),
        })  # fmt: skip
    columns = (
        Column("class", "campaigns"), Column("n", "n", COUNT), Column("before", "before, median", ".3g"),
        Column("before_most", "largest", ".3g"), Column("after", "after, median", ".4g"),
        Column("after_90", "90 %", ".4g"), Column("after_most", "largest", ".4g"),
        Column("within", "up to 1.10 [%]", *PERCENT), Column("cut", "cut, median [%]", *PERCENT),
        Column("excess_cut", "cut above noise [%]", *PERCENT),
    )  # fmt: skip
    words = (
        "RMSE on the records held out over the noise that is really in them (rms of what was written less what the "
        "simulated arm did), before and after the loop. Cut: 1 - after/before; above noise: of sqrt(RMSE^2 - noise^2)."
    )
    return Table("held_out", "Error on records held out", words, frame_of(lines, columns), columns)


def parameter_bias(rows: DataFrame) -> Table:
    """Return how far the parameters are from the truth before and after, by form and parameter."""
    lines = []
    for form, matching in FORMS.items():
        part = matching_rows(rows, matching)
        for name in ("all", *PARAMETERS) if len(part) else ():
            names = PARAMETERS if name == "all" else (name,)
            before, after = (bias(part, when, names) for when in ("before", "after"))
            lines.append({
                "form": form, "parameter": name, "n": len(after),
                "before": before.median(), "before_most": before.max(),
                "after": after.median(), "after_90": after.quantile(0.9), "after_most": after.max(),
            })  # fmt: skip
    columns = (
        Column("form", "form"), Column("parameter", "parameter"), Column("n", "n", COUNT),
        Column("before", "before, median [%]", ".3g", 100.0), Column("before_most", "largest [%]", ".3g", 100.0),
        Column("after", "after, median [%]", ".3g", 100.0), Column("after_90", "90 % [%]", ".3g", 100.0),
        Column("after_most", "largest [%]", ".3g", 100.0),
    )  # fmt: skip
    words = "Size of the relative error; campaigns of one or two listed effects, by whether the form is the library's."
    return Table("bias", "Bias of the parameters", words, frame_of(lines, columns), columns)


def trust(rows: DataFrame) -> Table:
    """Return how often a parameter is trusted, and how far off it is then."""
    lines = []
    for label, part in parts(rows).items():
        for name in PARAMETERS if len(part) else ():
            trusted = part[f"trusted_{name}"].astype(bool)
            off = part[f"bias_after_{name}"].astype(float).abs()
            lines.append({
                "class": label, "parameter": name, "n": len(part), "trusted": float(trusted.mean()),
                "off": off[trusted].median() if trusted.any() else np.nan,
                "off_most": off[trusted].max() if trusted.any() else np.nan,
                "off_other": off[~trusted].median() if (~trusted).any() else np.nan,
            })  # fmt: skip
    columns = (
        Column("class", "campaigns"), Column("parameter", "parameter"), Column("n", "n", COUNT),
        Column("trusted", "trusted [%]", *PERCENT), Column("off", "trusted: error, median [%]", ".2g", 100.0),
        Column("off_most", "largest [%]", ".2g", 100.0), Column("off_other", "not trusted: median [%]", ".2g", 100.0),
    )  # fmt: skip
    words = "How often the value after the loop is called trusted, and its relative error where it is and where not."
    return Table("trust", "Which parameters are trusted", words, frame_of(lines, columns), columns)


def times(rows: DataFrame) -> Table:
    """Return how long it takes to close a campaign, by class."""
    lines = []
    for label, part in ({"all": rows} | {c: of_class(rows, c) for c in dict.fromkeys(rows["class"])}).items():
        lines.append({"class": label, "n": len(part)} | {
            f"{key}_{word}": value for key in ("seconds", "cpu_seconds") for word, value in {
                "median": part[key].median(), "90": part[key].quantile(0.9), "most": part[key].max()}.items()
        })  # fmt: skip
    columns = (
        Column("class", "campaigns"), Column("n", "n", COUNT),
        *(Column(f"{key}_{w}", f"{t} {w} [s]", ".3g") for key, t in (("seconds", "wall"), ("cpu_seconds", "CPU"))
          for w in ("median", "90", "most")),
    )  # fmt: skip
    words = (
        "Time to close one campaign on one thread, what was compiled meanwhile included; 90: nine of ten take no "
        "longer. Times hang on the machine and on what else it did."
    )
    return Table("times", "Times", words, frame_of(lines, columns), columns)


WORDS = (
    "Shares with their 95 % Wilson interval; `n` counts campaigns (of a bias: values). A group holds the truth when it "
    "has at most 4 effects, one of them true. An aim that no campaign tells of is neither met nor missed."
)


def loop_targets(targets: Sequence[Target], words: str = WORDS) -> Table:
    """Return one line an aim."""
    frame = DataFrame(
        [
            {
                "topic": t.topic, "question": t.question, "measured": measured(t), "target": aim(t), "n": t.n,
                "result": {True: "met", False: "missed", None: ""}[t.met], "found": t.found, "limit": t.limit,
            }
            for t in targets
        ]
    )  # fmt: skip
    columns = (
        Column("topic", "about"), Column("question", "question"), Column("measured", "measured"),
        Column("target", "target"), Column("n", "n", ".0f"), Column("result", "result"),
    )  # fmt: skip
    return Table("targets", "Targets", words, frame, columns)


def measured(target: Target) -> str:
    """Return what was found, in words."""
    if not np.isfinite(target.found):
        return ""
    text = amount(target.found, target.kind)
    if target.is_counted:
        low, high = wilson(round(target.found * target.n), target.n)
        return f"{text} ({100 * low:.1f} to {100 * high:.1f} %)"
    return text


def aim(target: Target) -> str:
    """Return the limit, in words."""
    word = "below" if target.at_most else "above"
    if not target.is_strict:
        word = "at most" if target.at_most else "at least"
    return f"{word} {amount(target.limit, target.kind)}"


def amount(value: float, kind: str) -> str:
    """Return a number with its unit."""
    if kind == "share":
        return f"{100 * value:.3g} %"
    return f"{value:.3g}" if kind in ("ratio", "count") else f"{value:.3g} {kind}"


def said_lines(rows: DataFrame, name: str, title: str, words: str) -> Table:
    """Return one line a campaign; its files hold every number that was judged."""
    columns = (
        Column("campaign", "campaign"), Column("truth", "truth"), Column("strength", "strength"),
        Column("noise", "noise"), Column("verdict", "verdict"), Column("named", "said"),
        Column("judgement", "judgement"), Column("before_over_floor", "error/noise before", ".3g"),
        Column("after_over_floor", "after", ".3g"),
    )  # fmt: skip
    return Table(name, title, words, rows.sort_values(["truth", "campaign"], ignore_index=True), columns)


def all_campaigns(rows: DataFrame) -> Table:
    """Return every campaign and number, as a file alone."""
    words = "Every campaign with all that was judged of it."
    return Table("campaigns", "All campaigns", words, rows, (Column("campaign", "campaign"),), most=0)


def advice_rates(rows: DataFrame) -> Table:
    """Return one line a pair."""
    columns = (
        Column("pair", "pair"), Column("tried", "tried", ".0f"), Column("in_doubt", "in doubt", ".0f"),
        Column("n", "taken", ".0f"), Column("advised", "advised [%]", *PERCENT),
        Column("advised_low", "low [%]", *PERCENT), Column("advised_high", "high [%]", *PERCENT),
        Column("advised_wrong", "wrong one", ".0f"), Column("power", "promised [%]", *PERCENT),
        Column("random", "random [%]", *PERCENT), Column("random_low", "low [%]", *PERCENT),
        Column("random_high", "high [%]", *PERCENT), Column("random_wrong", "wrong one", ".0f"),
        Column("p", "p", ".2g"),
    )  # fmt: skip
    words = (
        "Campaigns of few strokes that left the pair in doubt, the first so many of those tried; one record more each, "
        "advised by the loop, or random among those that the arm can make; share in which the true effect stands alone "
        "after the loop was closed again, with its 95 % Wilson interval. Wrong one: the other effect stands alone. "
        "Promised: mean power that the advice told. p: chance of so great a lead where neither is better (exact sign "
        "test over campaigns on which only one of both told the pair apart)."
    )
    frame = rates(rows)
    return Table("advice", "Told apart by one record more", words, frame.reindex(columns=[c.key for c in columns]),
                 columns)  # fmt: skip


def advice_campaigns(rows: DataFrame) -> Table:
    """Return every campaign."""
    columns = tuple(Column(key, key) for key in ("campaign", "pair", "truth", "noise", "next", "said", "answer"))
    return Table("campaigns", "Campaigns", "Every campaign with its last record and what was said then.", rows, columns)
