"""Hold the judgements of a suite against the targets."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

from stand.score.judge import PARAMETERS

Row = dict[str, Any]
RIGHT = ("right", "group")


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


def targets_of(rows: Sequence[Row], missing: int) -> list[Target]:
    """Reckon every target; `rows` are the judged campaigns, `missing` those without a report."""
    first = Target("campaigns without a report", missing, len(rows) + missing, "= 0", missing == 0)
    return [first, *_controls(rows), *_singles(rows), *_two(rows), *_fits(rows), *_unlisted(rows), *_one_stroke(rows)]


def _controls(rows: Sequence[Row]) -> list[Target]:
    controls = _of(rows, "control")
    lines = [most("controls: false alarms", controls, _is_alarm, 0.02)]
    for noise in ("white", "coloured"):
        some = [row for row in controls if row["noise"] == noise]
        lines.append(share(f"controls with {noise} noise: false alarms", some, _is_alarm))
    return lines


def _singles(rows: Sequence[Row]) -> list[Target]:
    singles = _of(rows, "single")
    weighty = [row for row in singles if row["matters"]]
    held = "single effects that move the held-out error by more than 20 %"
    lines = [
        least(f"{held}: share of all", singles, lambda row: row["matters"], 0.70),
        least(f"{held}: right name, or a group that holds it", weighty, _is_right, 0.95),
        most(f"{held}: wrong name alone", weighty, _is_wrong_alone, 0.02),
    ]
    for word, count in sorted(Counter(row["judgement"] for row in weighty).items()):
        lines.append(Target(f"{held}: judged {word}", count / len(weighty), len(weighty), is_share=True))
    for matching in (True, False):
        some = [row for row in weighty if row["matching"] == matching]
        form = "matching" if matching else "non-matching"
        lines.append(share(f"{held}, {form} form: right name, or a group that holds it", some, _is_right))
        lines.append(_middle(f"{held}, {form} form: held-out error over noise, median", some, "after_over_floor"))
    sizes = [row["group_of_truth"] for row in weighty if row["group_of_truth"]]
    mean = sum(sizes) / len(sizes) if sizes else None
    return [*lines, Target(f"{held}: mean size of the group that holds the truth", mean, len(sizes))]


def _two(rows: Sequence[Row]) -> list[Target]:
    return [least("two effects: both right", _of(rows, "two"), _is_right, 0.80)]


def _fits(rows: Sequence[Row]) -> list[Target]:
    """Look at the held-out error and the bias for listed effects in a matching form."""
    listed = [row for row in (*_of(rows, "single"), *_of(rows, "two")) if row["matching"]]
    held = "listed effects in a matching form"
    before, after = (_biases(listed, when) for when in ("before", "after"))
    errors = [row for row in listed if row["after_over_floor"] is not None]
    lines = [
        _middle(f"{held}: held-out error over noise, median", listed, "after_over_floor", 1.10),
        share(f"{held}: held-out error up to 1.10 of noise", errors, lambda row: row["after_over_floor"] <= 1.10),
        _middle(f"{held}: held-out error over noise before, median", listed, "before_over_floor"),
        _limited(f"{held}: bias of the four parameters, median", median(after) if after else None, len(after), 0.01),
        Target(f"{held}: bias before, median", median(before) if before else None, len(before)),
        Target(f"{held}: bias before, largest", max(before, default=None), len(before)),
        Target(f"{held}: bias after, largest", max(after, default=None), len(after)),
    ]
    for name in PARAMETERS:
        some = [abs(row[f"bias_after_{name}"]) for row in listed]
        lines.append(Target(f"{held}: bias of {name}, median", median(some) if some else None, len(some)))
    return lines


def _unlisted(rows: Sequence[Row]) -> list[Target]:
    some, held = _of(rows, "unlisted"), "effects of no library"
    cut = [row["cut"] for row in some if row["cut"] is not None]
    excess = [row["excess_cut"] for row in some if row["excess_cut"] is not None]
    middle = median(cut) if cut else None
    met = None if middle is None else middle >= 0.60
    return [
        least(f"{held}: no library name said to explain all", some, lambda row: row["judgement"] != "claimed", 0.80),
        Target(f"{held}: cut of the held-out error, median", middle, len(cut), ">= 0.6", met),
        Target(f"{held}: cut of what is above noise, median", median(excess) if excess else None, len(excess)),
    ]


def _one_stroke(rows: Sequence[Row]) -> list[Target]:
    some = _of(rows, "one_stroke")
    trusted = [row for row in some if row["trusted_p0"] or row["trusted_eta3"] or row["trusted_n"]]
    met = None if not some else not trusted
    return [
        most("one stroke: wrong name alone", some, lambda row: row["wrong_alone"], 0.0),
        share("one stroke: a group without the truth", some, lambda row: row["wrong_group"]),
        Target("one stroke: p0, eta3 or n trusted", len(trusted), len(some), "= 0", met),
    ]


def _of(rows: Sequence[Row], label: str) -> list[Row]:
    return [row for row in rows if row["class"] == label]


def _is_right(row: Row) -> bool:
    return row["judgement"] in RIGHT


def _is_alarm(row: Row) -> bool:
    return bool(row["judgement"] != "right")


def _is_wrong_alone(row: Row) -> bool:
    """Tell whether the truth is in no name and no group, and a name stands without a group."""
    return bool(row["judgement"] == "wrong" and row["wrong_alone"])


def _biases(rows: Iterable[Row], when: str) -> list[float]:
    return [abs(row[f"bias_{when}_{name}"]) for row in rows for name in PARAMETERS]


def share(question: str, rows: Sequence[Row], test: Callable[[Row], bool]) -> Target:
    found = sum(map(test, rows)) / len(rows) if rows else None
    return Target(question, found, len(rows), is_share=True)


def least(question: str, rows: Sequence[Row], test: Callable[[Row], bool], limit: float) -> Target:
    line = share(question, rows, test)
    met = None if line.found is None else line.found >= limit
    return replace(line, limit=f">= {limit:g}", met=met)


def most(question: str, rows: Sequence[Row], test: Callable[[Row], bool], limit: float) -> Target:
    line = share(question, rows, test)
    return replace(line, limit=f"<= {limit:g}", met=None if line.found is None else line.found <= limit)


def _middle(question: str, rows: Sequence[Row], column: str, limit: float | None = None) -> Target:
    values = [row[column] for row in rows if row[column] is not None]
    found = median(values) if values else None
    return Target(question, found, len(values)) if limit is None else _limited(question, found, len(values), limit)


def _limited(question: str, found: float | None, among: int, limit: float) -> Target:
    return Target(question, found, among, f"<= {limit:g}", None if found is None else found <= limit)
