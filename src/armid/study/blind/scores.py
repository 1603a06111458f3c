"""Hold the reports of closed loops against the truth: one row a campaign."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pandas import DataFrame, Series

from armid.errors import ArmidError
from armid.study.analyses.success import wilson

EMPIRICAL = "unnamed:"
# A group of more effects than this is no finding, whatever it holds.
LARGEST_GROUP = 4


@dataclass(frozen=True)
class Claim:
    """Hold what a report claims.

    groups: each named effect -> the effects that it cannot be told from, itself included. empirical: terms without a
    name.
    """

    groups: Mapping[str, frozenset[str]]
    empirical: tuple[str, ...]
    verdict: str

    @property
    def said(self) -> str:
        """The names, each with what it cannot be told from."""
        told = [" or ".join((name, *sorted(group - {name}))) for name, group in self.groups.items()]
        return "; ".join((*told, *self.empirical))


@dataclass(frozen=True)
class Matched:
    """Hold which truths are named, which are held by a group alone, and which names belong to no truth."""

    named: tuple[str, ...]
    grouped: tuple[str, ...]
    extra: tuple[str, ...]


def claim_of(report: Mapping[str, Any]) -> Claim:
    """Return what a report claims in the end; an effect that was added and taken out again does not count."""
    steps = {step["effect"]: step for step in report["steps"]}
    empirical = tuple(n for n in report["effects"] if n.startswith(EMPIRICAL) or steps.get(n, {}).get("empirical"))
    named = [name for name in report["effects"] if name not in empirical]
    groups = {name: frozenset((name, *steps.get(name, {}).get("alternatives", ()))) for name in named}
    return Claim(groups, empirical, report["verdict"])


def matched(truths: Sequence[str], claim: Claim) -> Matched:
    """Return how a claim meets the truth: each truth by its own name, else by one group of at most 4 that holds it."""
    named = tuple(truth for truth in truths if truth in claim.groups)
    free = {name: group for name, group in claim.groups.items() if name not in named}
    grouped = []
    for truth in truths:
        holding = next((n for n, g in free.items() if truth in g and len(g) <= LARGEST_GROUP), None)
        if truth not in named and holding is not None:
            grouped.append(truth)
            del free[holding]
    return Matched(named, tuple(grouped), tuple(free))


def judgement(label: str, truths: Sequence[str], claim: Claim, match: Matched) -> str:
    """Return one word for a campaign of a class.

    control, or nothing to find: right, false_alarm. unlisted: claimed (names alone are said to explain all), else
    empirical, partial, none. Others: right, group (a group holds what is not named), right_with_extra, half,
    half_with_extra (one of two), wrong, cannot_tell, empirical, none.
    """
    if label == "unlisted":
        claimed = bool(claim.groups) and claim.verdict == "explained"
        return "claimed" if claimed else "empirical" if claim.empirical else "partial" if claim.groups else "none"
    if not truths:
        silent = not claim.groups and not claim.empirical and claim.verdict == "no_discrepancy"
        return "right" if silent else "false_alarm"
    found = len(match.named) + len(match.grouped)
    if found:
        return found_word(found == len(truths), match)
    if claim.groups:
        return "wrong"
    return "empirical" if claim.empirical else "cannot_tell" if claim.verdict == "cannot_tell_apart" else "none"


def found_word(is_whole: bool, match: Matched) -> str:
    """Return the word for a claim that holds some truth."""
    word = "right" if is_whole else "half"
    if match.extra:
        return f"{word}_with_extra"
    return "group" if is_whole and match.grouped else word


Entry = Mapping[str, Any]


def read_key(path: Path, made_by: str = "") -> dict[str, Entry]:
    """Return campaign -> what is true of it.

    path: a JSON file whose `campaigns` holds class, parameters, effects, noise, floor and declared_fit of each.
    made_by: the command that makes campaigns and key, told where the file is absent.

    Raises ArmidError for a file that is not there or is no key.
    """
    if not path.is_file():
        made = f"`{made_by}` makes it with the campaigns" if made_by else "the file that holds the truth is expected"
        raise ArmidError(f"key {path} does not exist: {made}")
    try:
        campaigns = json.loads(path.read_text(encoding="utf-8"))["campaigns"]
        return {str(name): check_entry(entry) for name, entry in campaigns.items()}
    except (OSError, ValueError) as error:
        raise ArmidError(f"key {path} cannot be read: {error}") from error
    except (KeyError, TypeError, AttributeError) as error:
        raise ArmidError(f"key {path} is no key of blind campaigns: {error} is not as expected") from error


def check_entry(entry: Entry) -> Entry:
    """Return an entry that holds what a report asks of it."""
    for name in ("class", "parameters", "declared_fit"):
        entry[name]
    for effect in entry["effects"]:
        for name in ("name", "listed", "matching", "strength", "form", "port"):
            effect[name]
    entry["noise"]["kind"], entry["floor"]["holdout"]
    return entry


NOTHING, SEVERAL = "nothing", "; "
# Answers on one true effect, from the best to the worst.
ANSWERS = ("right alone", "named first of a group", "held by a group", "right and one more", "cannot tell apart",
           "unnamed term", "nothing", "wrong group", "wrong alone")  # fmt: skip
MISSING = "missing"


def judged(loops: DataFrame, key: Mapping[str, Entry], names: list[str]) -> DataFrame:
    """Return one row a campaign that the study asks for: truth, claim, judgement, errors over noise, bias.

    loops: case, seconds, cpu_seconds, report. names: of the campaigns; one without a report is judged "missing".

    Raises ArmidError for a campaign that the key does not know, and for a report of another shape.
    """
    found = {str(case): row for case, (_, row) in zip(loops["case"], loops.iterrows(), strict=True)}
    rows = []
    for name in names:
        if name not in key:
            raise ArmidError(f"the key tells nothing of campaign '{name}': campaigns and key are not of one suite")
        try:
            rows.append(row_of(name, key[name], found.get(name)))
        except (KeyError, TypeError) as error:
            raise ArmidError(f"campaign '{name}': {error} of its report or of the key is not as expected") from error
    return DataFrame(rows)


def row_of(name: str, entry: Entry, found: "Series[Any] | None") -> dict[str, Any]:
    """Return the row of one campaign."""
    row = told(name, entry)
    if found is None:
        return row | {"judgement": MISSING, "answer": MISSING}
    report, truths = found["report"], [e["name"] for e in entry["effects"] if e["listed"]]
    claim = claim_of(report)
    match = matched(truths, claim)
    own = [len(group) for group in claim.groups.values() if group & set(truths)]
    wrong = [len(claim.groups[name]) for name in match.extra]
    row |= {
        "verdict": claim.verdict,
        "named": claim.said,
        "first": next(iter((*claim.groups, *claim.empirical)), NOTHING),
        "judgement": judgement(entry["class"], truths, claim, match),
        "wrong_alone": 1 in wrong,
        "wrong_group": any(size > 1 for size in wrong),
        "largest_group": max(map(len, claim.groups.values()), default=0),
        "group_of_truth": max(own, default=0),
        "has_empirical": bool(claim.empirical),
        "seconds": found["seconds"],
        "cpu_seconds": found["cpu_seconds"],
    }
    return row | {"answer": answer_of(row)} | errors(entry, report) | parameters(entry, report)


def told(name: str, entry: Entry) -> dict[str, Any]:
    """Return what the key tells of a campaign."""
    effects, fit = entry["effects"], entry["declared_fit"]
    return {
        "campaign": name,
        "class": entry["class"],
        "noise": entry["noise"]["kind"],
        "truth": SEVERAL.join(e["name"] for e in effects) or NOTHING,
        "form": SEVERAL.join(e["form"] for e in effects),
        "matching": all(e["matching"] for e in effects),
        "strength": SEVERAL.join(str(e["strength"]) for e in effects),
        "matters": bool(fit and fit["matters"]),
        "floor": number(entry["floor"]["holdout"]),
    }


def answer_of(row: Mapping[str, Any]) -> str:
    """Return the answer in words that readers tell apart at a glance, a member of ANSWERS for one true effect."""
    word = str(row["judgement"])
    if word == "right":
        return ANSWERS[0] if row["group_of_truth"] <= 1 else ANSWERS[1]
    if word == "wrong":
        return ANSWERS[8] if row["wrong_alone"] else ANSWERS[7]
    known = {"group": ANSWERS[2], "right_with_extra": ANSWERS[3], "cannot_tell": ANSWERS[4], "empirical": ANSWERS[5],
             "none": ANSWERS[6]}  # fmt: skip
    return known.get(word, word)


def errors(entry: Entry, report: Mapping[str, Any]) -> dict[str, float]:
    """Return held-out RMSE before and after [SI], over the noise, and by which share it fell; NaN without holdout.

    excess_cut: the fall of what is above the noise, 1 - sqrt((after^2 - floor^2)/(before^2 - floor^2)).
    """
    floor = number(entry["floor"]["holdout"])
    before, after = (number((report["error"][when]["holdout"] or {}).get("rmse")) for when in ("before", "after"))
    excess = [float(np.sqrt(np.maximum(0.0, rmse**2 - floor**2))) for rmse in (before, after)]
    return {
        "before": before,
        "after": after,
        "before_over_floor": before / floor,
        "after_over_floor": after / floor,
        "cut": 1.0 - after / before,
        "excess_cut": 1.0 - excess[1] / excess[0] if excess[0] else np.nan,
    }


def parameters(entry: Entry, report: Mapping[str, Any]) -> dict[str, Any]:
    """Return the relative error of each true parameter before and after, and whether it is trusted after."""
    row: dict[str, Any] = {}
    for name, truth in entry["parameters"].items():
        for when in ("before", "after"):
            row[f"bias_{when}_{name}"] = report["parameters"][when][name]["value"] / truth - 1.0
        row[f"trusted_{name}"] = bool(report["parameters"]["after"][name]["trusted"])
    return row


def number(value: float | None) -> float:
    """Return a number, NaN for none."""
    return np.nan if value is None else float(value)


RIGHT = ("right", "group")
PARAMETERS = ("p0", "k", "eta3", "n")
# Workers that the suite is meant for, each with one thread.
WORKERS = 2
HELD = "single effects that move the held-out error by more than 20 %"
MATCHING = "listed effects in a matching form"
UNLISTED, ONE_STROKE, TIME = "effects of no library", "one stroke only", "time on one thread each"


@dataclass(frozen=True)
class Target:
    """Hold one aim.

    topic: which campaigns it is about. found: NaN where no campaign tells of it. kind: "share", "ratio", "count", "s"
    or "min" of found and limit. n: how many campaigns (of a bias: values) it is reckoned from. at_most: whether found
    must not exceed the limit, else it must not fall below it. is_counted: whether found is a share of the n, which has
    an interval. is_strict: whether the limit itself is not enough.
    """

    topic: str
    question: str
    found: float
    n: int
    limit: float
    kind: str = "share"
    at_most: bool = True
    is_counted: bool = False
    is_strict: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the aim is met, None where nothing tells."""
        if not np.isfinite(self.found):
            return None
        if self.is_strict and self.found == self.limit:
            return False
        return bool(self.found <= self.limit) if self.at_most else bool(self.found >= self.limit)


def targets_of(rows: DataFrame) -> list[Target]:
    """Return every aim of a suite, from what was judged campaign by campaign."""
    there = rows[rows["judgement"] != MISSING]
    missing = len(rows) - len(there)
    lines = [Target("all", "campaigns without a report", float(missing), len(rows), 0.0, "count")]
    if there.empty:
        return lines
    return [*lines, *answers(there), *fits(there), *unlisted(there), *one_stroke(there), *times(there)]


def answers(rows: DataFrame) -> list[Target]:
    """Return what is asked of the names."""
    controls, singles, two = (of_class(rows, label) for label in ("control", "single", "two"))
    held = singles[singles["matters"].astype(bool)]
    return [
        share("controls", "false alarms", controls, controls["judgement"] != "right", 0.02),
        share("single effects", "those that move the held-out error by more than 20 %", singles,
              singles["matters"].astype(bool), 0.70, at_most=False),
        share(HELD, "right name, or a group that holds it", held, is_right(held), 0.95, at_most=False),
        share(HELD, "wrong name alone", held, is_wrong_alone(held), 0.02),
        share("two effects", "both right", two, is_right(two), 0.80, at_most=False),
    ]  # fmt: skip


def fits(rows: DataFrame) -> list[Target]:
    """Return what is asked of the error held out and of the parameters."""
    listed = matching_rows(rows)
    ratios, biases = listed["after_over_floor"].dropna(), bias(listed, "after")
    return [
        Target(MATCHING, "held-out error over noise, median", middle(ratios), len(ratios), 1.10, "ratio"),
        Target(MATCHING, "bias of the four parameters, median", middle(biases), len(biases), 0.01),
    ]


def unlisted(rows: DataFrame) -> list[Target]:
    """Return what is asked where no library has the effect."""
    some = of_class(rows, "unlisted")
    cut, unclaimed = some["cut"].dropna(), some["judgement"] != "claimed"
    return [
        share(UNLISTED, "no library name said to explain all", some, unclaimed, 0.80, at_most=False),
        Target(UNLISTED, "cut of the held-out error, median", middle(cut), len(cut), 0.60, at_most=False),
    ]


def one_stroke(rows: DataFrame) -> list[Target]:
    """Return what is asked where there is one stroke only."""
    some = of_class(rows, "one_stroke")
    trusted = some[["trusted_p0", "trusted_eta3", "trusted_n"]].astype(bool).any(axis=1)
    found = float(trusted.sum()) if len(some) else np.nan
    return [
        share(ONE_STROKE, "wrong name alone", some, some["wrong_alone"].astype(bool), 0.0),
        Target(ONE_STROKE, "campaigns that trust p0, eta3 or n", found, len(some), 0.0, "count"),
    ]


def times(rows: DataFrame) -> list[Target]:
    """Return what is asked of the time, as the clock on the wall showed it."""
    seconds = rows["seconds"].astype(float)
    suite = float(seconds.sum()) / 60.0 / WORKERS
    return [
        Target(TIME, "closing one campaign, median", middle(seconds), len(seconds), 30.0, "s"),
        Target(TIME, f"closing the whole suite with {WORKERS} workers", suite, len(seconds), 60.0, "min"),
    ]


def of_class(rows: DataFrame, label: str) -> DataFrame:
    """Return the campaigns of a class."""
    return rows[rows["class"] == label]


def matching_rows(rows: DataFrame, matching: bool = True) -> DataFrame:
    """Return campaigns of listed effects, one or two, in a form that a library would fit, or in another."""
    return rows[rows["class"].isin(["single", "two"]) & (rows["matching"] == matching)]


def is_right(rows: DataFrame) -> "Series[bool]":
    """Tell where every truth is named or held by a group, and nothing else is named."""
    return rows["judgement"].isin(RIGHT)


def is_wrong_alone(rows: DataFrame) -> "Series[bool]":
    """Tell where the truth is in no name and no group, and a name stands without a group."""
    return (rows["judgement"] == "wrong") & rows["wrong_alone"].astype(bool)


def bias(rows: DataFrame, when: str, names: Sequence[str] = PARAMETERS) -> "Series[float]":
    """Return the size of the relative errors of some parameters in all campaigns."""
    columns = rows[[f"bias_{when}_{name}" for name in names]].to_numpy(float)
    return Series(np.abs(columns).ravel())


def middle(values: "Series[float]") -> float:
    """Return the median, NaN of nothing."""
    return float(values.median()) if len(values) else np.nan


def share(
    topic: str, question: str, rows: DataFrame, found: "Series[bool]", limit: float, at_most: bool = True
) -> Target:
    """Return an aim about a share of campaigns."""
    rate = float(found.mean()) if len(rows) else np.nan
    return Target(topic, question, rate, len(rows), limit, "share", at_most, True)


ADVISED, RANDOM = "advised", "random"
TOLD_APART, TOGETHER, WRONG, NONE, NO_REPORT = "told apart", "still together", "wrong one", "neither", "missing"
ALL = "all pairs"
DOUBT = "cannot_tell_apart"


def separations(loops: DataFrame, key: Mapping[str, Entry], names: list[str]) -> DataFrame:
    """Return one row a campaign with a record more: its pair, who chose the record, what was said then.

    loops: case, report. names: of the campaigns that the study asks for.

    Raises ArmidError for a campaign of which the key does not tell who chose the record.
    """
    reports = dict(zip(loops["case"], loops["report"], strict=True))
    rows = []
    for name in names:
        entry = key.get(name, {})
        if not {"pair", "choice", "base", "power", "tried", "in_doubt"} <= set(entry):
            raise ArmidError(f"the key does not tell of campaign '{name}' who chose its last record")
        (truth,) = [effect["name"] for effect in entry["effects"]]
        said = claim_of(reports[name]) if name in reports else None
        rows.append({
            "campaign": name, "pair": " / ".join(entry["pair"]), "truth": truth, "noise": entry["noise"]["kind"],
            "choice": entry["choice"], "base": entry["base"], "rank": entry.get("rank"), "power": entry["power"],
            "next": words_of(entry.get("next")), "tried": entry["tried"], "in_doubt": entry["in_doubt"],
            "said": said.said if said else "", "verdict": said.verdict if said else "",
            "answer": advice_answer(truth, said),
        })  # fmt: skip
    return DataFrame(rows)


def words_of(manoeuvre: Mapping[str, Any] | None) -> str:
    """Return a manoeuvre as its keys say it, "none" where the machine could make none."""
    return ", ".join(f"{k} {v}" for k, v in manoeuvre.items()) if manoeuvre else "none"


def advice_answer(truth: str, claim: Claim | None) -> str:
    """Return whether the true effect stands alone, nothing else named and no rival left."""
    if claim is None:
        return NO_REPORT
    if claim.verdict == DOUBT:
        return TOGETHER
    if set(claim.groups) == {truth} and not claim.empirical:
        return TOLD_APART
    return WRONG if claim.groups and truth not in claim.groups else TOGETHER if claim.groups else NONE


def rates(rows: DataFrame) -> DataFrame:
    """Return, per pair and over all, the share that either choice told apart, with its 95 % Wilson interval.

    p: chance of so great a lead of the advised record over the random one where neither is better: exact sign test
    over the campaigns on which only one of both told the pair apart (McNemar 1947, doi:10.1007/BF02295996).
    """
    there = rows[rows["answer"] != NO_REPORT]
    whole = there[there["base"].isin(both(there))]
    groups = {str(pair): part for pair, part in whole.groupby("pair", sort=False)}
    return DataFrame([rate_line(pair, part) for pair, part in (groups | {ALL: whole}).items() if len(part)])


def both(rows: DataFrame) -> list[str]:
    """Return the first campaigns that both choices were made for."""
    counts = rows.groupby("base")["choice"].nunique()
    return [str(base) for base in counts.index[counts == 2]]


def rate_line(pair: str, rows: DataFrame) -> dict[str, Any]:
    """Return the rates of one pair."""
    apart = rows.assign(apart=rows["answer"] == TOLD_APART).pivot(index="base", columns="choice", values="apart")
    advised, random = apart[ADVISED].astype(bool), apart[RANDOM].astype(bool)
    line: dict[str, Any] = {"pair": pair, "n": len(apart)}
    if pair != ALL:
        line |= {"tried": rows["tried"].iloc[0], "in_doubt": rows["in_doubt"].iloc[0]}
    for choice, found in ((ADVISED, advised), (RANDOM, random)):
        low, high = wilson(int(found.sum()), len(found))
        wrong = int(((rows["choice"] == choice) & (rows["answer"] == WRONG)).sum())
        line |= {choice: float(found.mean()), f"{choice}_low": low, f"{choice}_high": high, f"{choice}_wrong": wrong}
    line |= {"power": rows.loc[rows["choice"] == ADVISED, "power"].mean()}
    return line | {"p": sign_test(int((advised & ~random).sum()), int((random & ~advised).sum()))}


def sign_test(wins: int, losses: int) -> float:
    """Return the one-sided chance of at least so many wins of a fair coin, 1 where nothing was won or lost."""
    from scipy.stats import binomtest

    return float(binomtest(wins, wins + losses, alternative="greater").pvalue) if wins + losses else 1.0


def advice_targets(rows: DataFrame) -> list[Target]:
    """Return what is asked of the advice."""
    found = rates(rows)
    missing = int((rows["answer"] == NO_REPORT).sum())
    lines = [Target("all", "campaigns without a report", float(missing), len(rows), 0.0, "count")]
    for line in found.to_dict("records"):
        pair, n = str(line["pair"]), int(line["n"])
        lead = float(line[ADVISED] - line[RANDOM])
        lines.append(Target(pair, "told apart by the advised record", line[ADVISED], n, 0.80, "share", False, True))
        lines.append(Target(pair, "lead over a random record", lead, n, 0.0, at_most=False, is_strict=True))
    return lines
