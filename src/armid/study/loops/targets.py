"""Hold the judgements of a blind suite against what was aimed at."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pandas import DataFrame, Series

from armid.study.loops.judge import MISSING

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
