"""Hold the judgements of a suite against the targets."""

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import Any

from stand.arm import PARAMETERS

Row = dict[str, Any]
RIGHT = ("right", "group")
SIGNS = {"<=": operator.le, ">=": operator.ge, "=": operator.eq, ">": operator.gt}


@dataclass(frozen=True)
class Target:
    """Hold one line: what is asked, what was found among how many, the limit, and whether it is met.

    `is_share`: `found` is a share of those campaigns. `met` is None for a line that informs only, and for a target that
    no campaign of the suite can tell of.
    """

    question: str
    found: float | None
    among: int
    limit: str = ""
    met: bool | None = None
    is_share: bool = False


def aim(question: str, found: float | None, among: int, limit: str = "", is_share: bool = False) -> Target:
    """Give a target; `limit` reads as "<= 0.02", and is neither met nor missed where nothing was found."""
    sign, _, number = limit.partition(" ")
    met = bool(SIGNS[sign](found, float(number))) if limit and found is not None else None
    return Target(question, found, among, limit, met, is_share)


def targets_of(rows: Sequence[Row], missing: int) -> list[Target]:
    """Reckon every target; `rows` are the judged campaigns, `missing` those without a report."""
    unlisted, one = _of(rows, "unlisted"), _of(rows, "one_stroke")
    trusted = [row for row in one if row["trusted_p0"] or row["trusted_eta3"] or row["trusted_n"]]
    not_claimed = [row["judgement"] != "claimed" for row in unlisted]
    return [
        without_report(missing, len(rows) + missing),
        share("controls: false alarms", _of(rows, "control"), lambda row: row["judgement"] != "right", "<= 0.02"),
        *_singles(rows),
        share("two effects: both right", _of(rows, "two"), _is_right, ">= 0.8"),
        *_fits(rows),
        share("effects of no library: no library name said to explain all", not_claimed, bool, ">= 0.8"),
        _summary("effects of no library: cut of the held-out error, median", _column(unlisted, "cut"), ">= 0.6"),
        _summary("effects of no library: cut of what is above noise, median", _column(unlisted, "excess_cut")),
        share("one stroke: wrong name alone", one, lambda row: row["wrong_alone"], "<= 0"),
        share("one stroke: a group without the truth", one, lambda row: row["wrong_group"]),
        Target("one stroke: p0, eta3 or n trusted", len(trusted), len(one), "= 0", not trusted if one else None),
    ]


def without_report(missing: int, among: int) -> Target:
    return aim("campaigns without a report", missing, among, "= 0")


def _singles(rows: Sequence[Row]) -> list[Target]:
    singles = _of(rows, "single")
    weighty = [row for row in singles if row["matters"]]
    alone = [row["judgement"] == "wrong" and row["wrong_alone"] for row in weighty]
    held = "single effects that move the held-out error by more than 20 %"
    sizes = [row["group_of_truth"] for row in weighty if row["group_of_truth"]]
    return [
        share(f"{held}: share of all", singles, lambda row: row["matters"], ">= 0.7"),
        share(f"{held}: right name, or a group that holds it", weighty, _is_right, ">= 0.95"),
        # the truth is in no name and no group, and a name stands without a group
        share(f"{held}: wrong name alone", alone, bool, "<= 0.02"),
        _summary(f"{held}: mean size of the group that holds the truth", sizes, of=fmean),
    ]


def _fits(rows: Sequence[Row]) -> list[Target]:
    """Look at the held-out error and the bias for listed effects in a matching form."""
    listed = [row for row in (*_of(rows, "single"), *_of(rows, "two")) if row["matching"]]
    held = "listed effects in a matching form"
    bias = [abs(row[f"bias_after_{name}"]) for row in listed for name in PARAMETERS]
    errors = [row for row in listed if row["after_over_floor"] is not None]
    return [
        _summary(f"{held}: held-out error over noise, median", _column(listed, "after_over_floor"), "<= 1.1"),
        share(f"{held}: held-out error up to 1.10 of noise", errors, lambda row: row["after_over_floor"] <= 1.10),
        _summary(f"{held}: held-out error over noise before, median", _column(listed, "before_over_floor")),
        _summary(f"{held}: bias of the four parameters, median", bias, "<= 0.01"),
    ]


def _of(rows: Sequence[Row], label: str) -> list[Row]:
    return [row for row in rows if row["class"] == label]


def _is_right(row: Row) -> bool:
    return row["judgement"] in RIGHT


def _column(rows: Sequence[Row], name: str) -> list[float]:
    return [row[name] for row in rows if row[name] is not None]


def share(question: str, rows: Sequence[Any], test: Callable[[Any], bool], limit: str = "") -> Target:
    """Give the share of rows, or of values, that pass a test."""
    return aim(question, sum(map(test, rows)) / len(rows) if rows else None, len(rows), limit, is_share=True)


def _summary(question: str, values: Sequence[float], limit: str = "", of: Callable[[Any], float] = median) -> Target:
    return aim(question, of(values) if values else None, len(values), limit)
