"""Tables of a blind suite: by class of campaigns, by true effect, false alarms, errors, bias, trust, times."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from pandas import DataFrame, Series, crosstab
from scipy.stats import binomtest

from stand.arm import PARAMETERS
from stand.score.targets import RIGHT, Target

Row = dict[str, Any]
NOTHING, MISSING = "nothing", "missing"
# Answers on one true effect, from the best to the worst.
ANSWERS = ("right alone", "named first of a group", "held by a group", "right and one more", "cannot tell apart",
           "nothing", "wrong group", "wrong alone")  # fmt: skip
ANSWER_OF = {"group": ANSWERS[2], "right_with_extra": ANSWERS[3], "cannot_tell": ANSWERS[4], "none": ANSWERS[5]}
MOST_SHOWN = 60
WIDE = {"class": "campaigns", "n": ("n", ".0f")}


class Table(NamedTuple):
    """A table: `frame` goes to NAME.csv in SI, `show` says the heading and format of each column on the page.

    A format of "%" shows a share in per cent, "" a text.
    """

    name: str
    title: str
    words: str
    frame: DataFrame
    show: dict[str, str | tuple[str, str]]

    def markdown(self) -> str:
        """Return the table for the page, at most 60 lines of it."""
        shown = [(key, *((how, "") if isinstance(how, str) else how)) for key, how in self.show.items()]
        rule = [heading for _, heading, _ in shown], ["---:" if form else "---" for _, _, form in shown]
        rows = [[cell(row[key], form) for key, _, form in shown] for row in self.frame[:MOST_SHOWN].to_dict("records")]
        more = len(self.frame) - MOST_SHOWN
        hidden = f" {more} more lines are in {self.name}.csv." if more > 0 else ""
        lines = "\n".join(f"| {' | '.join(map(str, line))} |" for line in (*rule, *rows))
        return f"### {self.title}\n\n{lines}\n\n{self.words}{hidden}"


def cell(value: Any, form: str) -> str:
    """Return a cell; a number that does not exist is left empty."""
    if value is None or value != value:  # noqa: PLR0124 - a NaN differs from itself
        return ""
    if not form:
        return str(value).replace("|", "\\|").replace(">", "&gt;")
    return f"{100.0 * value:.1f}" if form == "%" else format(value, form)


def rows_of(judgements: Sequence[Row]) -> DataFrame:
    """Return the stand's judgements with the answer in words that readers tell apart at a glance."""
    rows = DataFrame(judgements)
    rows["truth"] = rows["truth"].replace("", NOTHING)
    numbers = ["floor", "before", "after", "before_over_floor", "after_over_floor", "cut", "excess_cut"]
    rows[numbers] = rows[numbers].astype(float)
    rows["answer"] = [answer(row) for row in rows.to_dict("records")]
    return rows


def answer(row: Row) -> str:
    """Return one of ANSWERS for a campaign of one true effect, the judgement for others."""
    word = str(row["judgement"])
    if word == "right":
        return ANSWERS[0] if row["group_of_truth"] <= 1 else ANSWERS[1]
    if word == "wrong":
        return ANSWERS[7] if row["wrong_alone"] else ANSWERS[6]
    return ANSWER_OF.get(word, word)


def wilson(found: int, n: int) -> tuple[float, float]:
    """Return the 95 % Wilson interval of a share."""
    interval = binomtest(found, n).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def of_class(rows: DataFrame, label: str) -> DataFrame:
    return rows[rows["class"] == label]


def parts(rows: DataFrame) -> dict[str, DataFrame]:
    """Return the classes that a reader asks for, by name, those with campaigns."""
    single = of_class(rows, "single")
    held, form = single["matters"].astype(bool), single["matching"].astype(bool)
    found = {
        "control": of_class(rows, "control"),
        "single, moves the error > 20 %, matching form": single[held & form],
        "single, moves the error > 20 %, other form": single[held & ~form],
        "single, moves it less": single[~held],
        "two": of_class(rows, "two"),
        "unlisted": of_class(rows, "unlisted"),
        "one stroke": of_class(rows, "one_stroke"),
    }
    return {label: part for label, part in found.items() if len(part)}


def is_wrong_alone(rows: DataFrame) -> "Series[bool]":
    """Tell where the truth is in no name and no group, and a name stands without a group."""
    return (rows["judgement"] == "wrong") & rows["wrong_alone"].astype(bool)


def targets_table(targets: Sequence[Target], words: str) -> Table:
    """Return one line an aim, those that inform only left to the file."""
    frame = DataFrame([
        {"question": t.question, "measured": measured(t), "target": asked(t), "n": t.among,
         "result": {True: "met", False: "missed", None: ""}[t.met], "found": t.found} for t in targets
    ])  # fmt: skip
    show = {"question": "question", "measured": "measured", "target": "target", "n": ("n", ".0f"), "result": "result"}
    return Table("targets", "Targets", words, frame, show)


def measured(target: Target) -> str:
    """Return what was found, of a share with its interval."""
    if target.found is None:
        return ""
    if not target.is_share:
        return f"{target.found:.4g}"
    low, high = wilson(round(target.found * target.among), target.among)
    return f"{100 * target.found:.3g} % ({100 * low:.1f} to {100 * high:.1f} %)"


def asked(target: Target) -> str:
    """Return what was asked, of a share in per cent as it was measured."""
    sign, _, number = target.limit.partition(" ")
    return f"{sign} {100 * float(number):g} %" if number and target.is_share else target.limit


def answers_by_class(rows: DataFrame) -> Table:
    words = list(dict.fromkeys(rows["judgement"]))
    lines = [
        {"class": label, "n": len(part)} | {w: int((part["judgement"] == w).sum()) for w in words}
        | {"right_rate": part["judgement"].isin(RIGHT).mean(), "wrong_rate": is_wrong_alone(part).mean()}
        for label, part in parts(rows).items()
    ]  # fmt: skip
    said = (
        "Judgements: right (every truth named), group (a group of at most 4 holds what is not named), right or half "
        "with extra (a further name), wrong (no name and no group holds a truth), cannot tell, none (nothing is "
        "claimed); of effects that no library has: claimed (names are said to explain all), partial, none."
    )
    show = WIDE | {"right_rate": ("right or group [%]", "%"), "wrong_rate": ("wrong alone [%]", "%")}
    show |= {w: (w.replace("_", " "), ".0f") for w in words}
    return Table("answers", "Answers by class", said, DataFrame(lines), show)


def answers_by_effect(rows: DataFrame) -> Table:
    lines = []
    for (truth, form), part in of_class(rows, "single").groupby(["truth", "form"], sort=True):
        held = part[part["matters"].astype(bool)]
        lines.append({
            "truth": truth, "form": form, "matching": "yes" if part["matching"].iloc[0] else "no", "n": len(part),
            "n_held": len(held), "right": int(held["judgement"].isin(RIGHT).sum()),
            "wrong": int(is_wrong_alone(held).sum()), "before": part["before_over_floor"].median(),
            "after": part["after_over_floor"].median(),
            "said": "; ".join(sorted({str(n) or NOTHING for n in part["named"]})),
        })  # fmt: skip
    words = (
        "Single effects; `right of these` and `wrong alone` count those that move the held-out error by more than "
        "20 %. Held-out error over the noise in the same records, median."
    )
    show = {"truth": "true effect", "form": "form", "matching": "matching", "n": ("n", ".0f"),
            "n_held": ("move > 20 %", ".0f"), "right": ("right of these", ".0f"), "wrong": ("wrong alone", ".0f"),
            "before": ("error/noise before", ".3g"), "after": ("after", ".3g"), "said": "what was said"}  # fmt: skip
    return Table("effects", "Answers by true effect", words, DataFrame(lines), show)


def answers_given(rows: DataFrame) -> Table:
    """Return a row for each true effect of single ones, and the number of campaigns with each answer."""
    single = of_class(rows, "single")
    moves = single["matters"].astype(bool).map({True: "more than 20 %", False: "20 % or less"}).rename("moves")
    counts = crosstab([moves, single["truth"]], single["answer"]).reindex(columns=ANSWERS, fill_value=0)
    counts = counts.sort_index(level="moves", ascending=False, sort_remaining=False).astype(object)
    frame = counts.where(counts > 0, None).reset_index()
    words = (
        "Single effects: numbers of campaigns with each answer, from the best answer to the worst; empty: none. moves "
        "the error: how far the effect moves the held-out error of the best declared model, in units of its noise. "
        "Named first of a group: the group holds effects that cannot be told apart. Held by a group: another is first."
    )
    show = {"moves": "moves the error", "truth": "true effect"} | {a: (a, ".0f") for a in ANSWERS}
    return Table("confusion", "True effect and answer", words, frame, show)


def false_alarms(rows: DataFrame) -> Table:
    """Return how often something was found where there was nothing, by the colour of the noise."""
    controls, lines = of_class(rows, "control"), []
    for label in ("all", "white", "coloured"):
        part = controls if label == "all" else controls[controls["noise"] == label]
        alarms = part[part["judgement"] != "right"]
        low, high = wilson(len(alarms), len(part)) if len(part) else (np.nan, np.nan)
        said = "; ".join(f"{a['campaign']}: {a['named'] or a['verdict']}" for a in alarms.to_dict("records"))
        rate = len(alarms) / len(part) if len(part) else np.nan
        lines.append({"noise": label, "n": len(part), "alarms": len(alarms), "rate": rate, "low": low, "high": high,
                      "said": said})  # fmt: skip
    words = "Campaigns without any effect on which something was named or a discrepancy was seen; 95 % Wilson interval."
    show = {"noise": "noise", "n": ("controls", ".0f"), "alarms": ("false alarms", ".0f"), "rate": ("rate [%]", "%"),
            "low": ("low [%]", "%"), "high": ("high [%]", "%"), "said": "what was said"}  # fmt: skip
    return Table("false_alarms", "False alarms", words, DataFrame(lines), show)


def campaign_lines(rows: DataFrame, label: str, title: str, words: str) -> Table:
    frame = of_class(rows, label).sort_values(["truth", "campaign"], ignore_index=True)
    show = {"campaign": "campaign", "truth": "truth", "strength": "strength", "noise": "noise", "verdict": "verdict",
            "named": "said", "judgement": "judgement", "before_over_floor": ("error/noise before", ".3g"),
            "after_over_floor": ("after", ".3g")}  # fmt: skip
    return Table(label, title, words, frame, show)


def group_sizes(rows: DataFrame) -> Table:
    """Return how large the groups are that hold the truth, and the largest of the others."""
    listed = rows[rows["class"].isin(["single", "two", "one_stroke"])]
    right = listed.loc[listed["group_of_truth"] > 0, "group_of_truth"].astype(int)
    wrong = listed.loc[(listed["group_of_truth"] == 0) & (listed["largest_group"] > 0), "largest_group"].astype(int)
    sizes = sorted({*right, *wrong})
    frame = DataFrame({"size": sizes, "right": [int((right == s).sum()) for s in sizes],
                       "wrong": [int((wrong == s).sum()) for s in sizes]})  # fmt: skip
    words = "Campaigns of listed effects by the size of the group; 1 is a name that stands alone."
    show = {"size": ("effects in the group", ".0f"), "right": ("holds the truth", ".0f"), "wrong": ("does not", ".0f")}
    return Table("groups", "Sizes of groups", words, frame, show)


def held_out(rows: DataFrame) -> Table:
    lines = []
    for label, part in parts(rows.dropna(subset=["after_over_floor"])).items():
        before, after = part["before_over_floor"], part["after_over_floor"]
        lines.append({
            "class": label, "n": len(part), "before": before.median(), "before_most": before.max(),
            "after": after.median(), "after_90": after.quantile(0.9), "after_most": after.max(),
            "within": (after <= 1.10).mean(), "cut": part["cut"].median(), "excess_cut": part["excess_cut"].median(),
        })  # fmt: skip
    words = (
        "RMSE on the records held out over the noise that is really in them (rms of what was written less what the "
        "simulated arm did), before and after the loop. Cut: 1 - after/before; above noise: of sqrt(RMSE^2 - noise^2)."
    )
    show = WIDE | {"before": ("before, median", ".3g"), "before_most": ("largest", ".3g"),
                   "after": ("after, median", ".4g"), "after_90": ("90 %", ".4g"), "after_most": ("largest", ".4g"),
                   "within": ("up to 1.10 [%]", "%"), "cut": ("cut, median [%]", "%"),
                   "excess_cut": ("cut above noise [%]", "%")}  # fmt: skip
    return Table("held_out", "Error on records held out", words, DataFrame(lines), show)


def parameter_bias(rows: DataFrame) -> Table:
    """Return the size of the relative errors, of all and of each, by whether the form is the library's."""
    lines, listed = [], rows[rows["class"].isin(["single", "two"])]
    for form, matching in (("matching", True), ("other", False)):
        part = listed[listed["matching"] == matching]
        for name in ("all", *PARAMETERS) if len(part) else ():
            names = PARAMETERS if name == "all" else (name,)
            before, after = (
                Series(np.abs(part[[f"bias_{when}_{n}" for n in names]].to_numpy(float)).ravel())
                for when in ("before", "after")
            )
            lines.append({
                "form": form, "parameter": name, "n": len(after),
                "before": before.median(), "before_most": before.max(),
                "after": after.median(), "after_90": after.quantile(0.9), "after_most": after.max(),
            })  # fmt: skip
    words = "Size of the relative error; campaigns of one or two listed effects, by whether the form is the library's."
    show = {"form": "form", "parameter": "parameter", "n": ("n", ".0f"), "before": ("before, median", ".3g"),
            "before_most": ("largest", ".3g"), "after": ("after, median", ".3g"), "after_90": ("90 %", ".3g"),
            "after_most": ("largest", ".3g")}  # fmt: skip
    return Table("bias", "Bias of the parameters", words, DataFrame(lines), show)


def trust(rows: DataFrame) -> Table:
    lines = []
    for label, part in parts(rows).items():
        for name in PARAMETERS:
            trusted = part[f"trusted_{name}"].astype(bool)
            off = part[f"bias_after_{name}"].astype(float).abs()
            lines.append({"class": label, "parameter": name, "n": len(part), "trusted": trusted.mean(),
                          "off": off[trusted].median(), "off_most": off[trusted].max(),
                          "off_other": off[~trusted].median()})  # fmt: skip
    words = "How often the value after the loop is called trusted, and its relative error where it is and where not."
    show = {"class": "campaigns", "parameter": "parameter", "n": ("n", ".0f"), "trusted": ("trusted [%]", "%"),
            "off": ("trusted: error, median", ".2g"), "off_most": ("largest", ".2g"),
            "off_other": ("not trusted: median", ".2g")}  # fmt: skip
    return Table("trust", "Which parameters are trusted", words, DataFrame(lines), show)


def times(rows: DataFrame) -> Table:
    """Return how long it takes to close a campaign, by class."""
    groups = {"all": rows} | {label: of_class(rows, label) for label in dict.fromkeys(rows["class"])}
    summary = {"median": Series.median, "90": lambda values: values.quantile(0.9), "most": Series.max}
    kinds = {"seconds": "wall", "cpu_seconds": "CPU"}
    lines = [
        {"class": label, "n": len(part)} | {f"{k}_{word}": of(part[k]) for k in kinds for word, of in summary.items()}
        for label, part in groups.items()
    ]
    words = (
        "Time to close one campaign on one thread, what was compiled meanwhile included; 90: nine of ten take no "
        "longer. Times hang on the machine and on what else it did."
    )
    show = WIDE | {f"{k}_{word}": (f"{kind} {word} [s]", ".3g") for k, kind in kinds.items() for word in summary}
    return Table("times", "Times", words, DataFrame(lines), show)
