"""The six scores: shares and means over campaigns, each with its 95 % interval and what is asked of it.

Intervals are percentiles of 1,000 bootstrap samples of campaigns, so that the parameters or names of one campaign go
together. A target is met where the interval touches it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from blind.families import AT_NOISE, MOVES, WORSE
from calibration.truth import Truth, all_found
from stand.score.judge import LARGEST_GROUP, read_claim

# A pair of campaign and effect counts in the calibration error from this probability on; bins of equal count.
COUNTS, N_BINS = 0.02, 10
NEARLY_SURE, ACCUSED = 0.9, 0.5
N_BOOTSTRAP, LEVEL = 1000, 0.05


@dataclass(frozen=True, eq=False)
class Closed:
    """Hold one closed campaign: its family, its group (arm, machines, left out), its truth, the answer.

    former: the answer of an earlier version to the same campaign, None where it was not asked or ended in an error.
    """

    name: str
    family: str
    group: str
    machine: str
    truth: Truth
    entry: dict[str, Any]
    answer: dict[str, Any]
    former: dict[str, Any] | None = None

    @property
    def chances(self) -> dict[str, float]:
        return dict(self.answer["probabilities"]["effects"])

    @cached_property
    def groups(self) -> list[frozenset[str]]:
        return list(read_claim(self.answer).groups.values())

    @property
    def is_unlisted(self) -> bool:
        """Tell whether an effect is planted that the library, or what is left of it, does not hold."""
        return any(not sets for sets, _ in self.truth.effects)

    @property
    def is_sound(self) -> bool:
        return not self.truth.fault

    @property
    def leaves_more(self) -> bool:
        """Tell whether the model in force misses the records by more than noise."""
        return bool(self.answer["leaves_more"])

    @property
    def leaves_declared(self) -> bool:
        """Tell whether a planted effect moves a record by clearly more than its noise."""
        moves = [effect.get("moves", MOVES + 1.0) for effect in self.entry["effects"]]
        return any(move > MOVES for move in moves)

    def pairs(self) -> list[tuple[float, float]]:
        """Return the probability of each effect that counts, and how true it is."""
        return [(p, self.truth.share(name, self.chances)) for name, p in self.chances.items() if p >= COUNTS]

    def wrong(self, least: float, kin: bool = False) -> bool:
        """Tell whether a name of at least such a probability belongs to no planted effect; kin: of no such physics."""
        return any(p >= least and not self.truth.holds(name) and not (kin and self.truth.is_same_physics(name))
                   for name, p in self.chances.items())  # fmt: skip

    def held(self) -> list[tuple[float, float, float]]:
        """Return value, low and high of each parameter, in units of the true value."""
        return self.held_in(self.answer)

    def held_in(self, answer: dict[str, Any]) -> list[tuple[float, float, float]]:
        found = []
        for name, true in self.truth.parameters.items():
            one = answer["parameters"]["after"][name]
            found.append((one["value"] / true, *sorted((one["low"] / true, one["high"] / true))))
        return found

    def beside_former(self) -> list[tuple[float, float]]:
        """Return the interval score of each parameter, and that of the earlier version."""
        if self.former is None:
            return []
        pairs = zip(self.held(), self.held_in(self.former), strict=True)
        return [(interval_score([mine]), interval_score([its])) for mine, its in pairs]

    def times_beside_former(self) -> list[tuple[float, float]]:
        return [] if self.former is None else [(self.answer["cpu_s"], self.former["cpu_s"])]


@dataclass(frozen=True)
class Score:
    """Hold one line: what is asked of which campaigns, how many these are, what was found, and the target."""

    score: str
    question: str
    group: str
    n: int
    value: float
    low: float
    high: float
    target: str = ""

    @property
    def met(self) -> bool | None:
        """Tell whether the interval touches the target; None where nothing is asked."""
        sign, _, limit = self.target.partition(" ")
        if not sign or math.isnan(self.value):
            return None
        return self.low <= float(limit) if sign == "<=" else self.high >= float(limit)


def score(name: str, question: str, group: str, each: Sequence[Closed], of: Callable[[Closed], Sequence[Any]],
          target: str = "", total: Callable[[list[Any]], float] | None = None) -> Score:  # fmt: skip
    """Return one line; of: the values of a campaign, empty where it does not count; total: of all values, the mean."""
    values = [found for one in each if (found := list(of(one)))]
    total = total or (lambda all_values: float(np.mean(all_values)))
    if not values:
        return Score(name, question, group, 0, math.nan, math.nan, math.nan, target)
    rng = np.random.default_rng(0)
    flat = [value for found in values for value in found]
    drawn = []
    for _ in range(N_BOOTSTRAP):
        chosen = [values[i] for i in rng.integers(len(values), size=len(values))]
        drawn.append(total([value for found in chosen for value in found]))
    low, high = np.quantile(drawn, [LEVEL / 2, 1 - LEVEL / 2])
    # Where all campaigns say the same the bootstrap sees no doubt: the rule of three does.
    value = total(flat)
    if total is not calibration_error and value in (0.0, 1.0):
        low, high = (0.0, min(3.0 / len(values), 1.0)) if value == 0.0 else (max(1.0 - 3.0 / len(values), 0.0), 1.0)
    return Score(name, question, group, len(values), value, float(low), float(high), target)


def calibration_error(pairs: Sequence[tuple[float, float]]) -> float:
    """Return the mean distance of probability and frequency over bins of equal count."""
    return sum(n * abs(p - true) for n, p, true in reliability(pairs)) / len(pairs)


def reliability(pairs: Sequence[tuple[float, float]]) -> list[tuple[int, float, float]]:
    """Return of each bin its number of pairs, mean probability and frequency."""
    ordered = np.array(sorted(pairs))
    return [(len(part), float(part[:, 0].mean()), float(part[:, 1].mean()))
            for part in np.array_split(ordered, min(N_BINS, len(ordered)))]  # fmt: skip


def brier(pairs: Sequence[tuple[float, float]]) -> float:
    return float(np.mean([(p - true) ** 2 for p, true in pairs]))


def interval_score(held: Sequence[tuple[float, float, float]]) -> float:
    """Return the mean width plus penalty of 95 % intervals, in units of the value (Gneiting, Raftery 2007)."""
    return float(np.mean([high - low + 2.0 / LEVEL * (max(low - 1.0, 0.0) + max(1.0 - high, 0.0))
                          for _, low, high in held]))  # fmt: skip


def ratio_of(total: Callable[[Sequence[float]], float]) -> Callable[[Sequence[tuple[float, float]]], float]:
    """Return the total of the first of all pairs over that of the second."""
    return lambda pairs: total([mine for mine, _ in pairs]) / total([its for _, its in pairs])


def median(values: Sequence[float]) -> float:
    return float(np.median(values))


def median_ratio(pairs: Sequence[tuple[float, float]]) -> float:
    return median([mine / its for mine, its in pairs])


def inside(one: Closed) -> list[bool]:
    return [low <= 1.0 <= high for _, low, high in one.held()]


def narrow(one: Closed) -> list[bool]:
    return [max(value - low, high - value) <= 0.01 for value, low, high in one.held()]


def off_and_narrow(one: Closed) -> list[bool]:
    """Return of each parameter with an interval within 1 % whether it is off by more than 1 %."""
    return [abs(value - 1.0) > 0.01 for value, low, high in one.held() if max(value - low, high - value) <= 0.01]


def over_noise(one: Closed) -> tuple[float, float] | None:
    """Return held-out errors of the declared model and of the one in force, over the noise; None without records.

    The noise of several outputs has no common unit, so that only machines with one output count.
    """
    floor = one.entry["floor"]["holdout"]
    before, after = (one.answer["error"][when]["holdout"] for when in ("before", "after"))
    if not floor or before is None or len(after["outputs"]) > 1:
        return None
    return before["rmse"] / floor, after["rmse"] / floor


def ratio(one: Closed) -> list[float]:
    """Return the held-out error over the noise where the declared model is off by at least 1.3 times the noise."""
    errors = over_noise(one)
    return [errors[1]] if errors is not None and errors[0] >= 1.3 else []


def is_worse(one: Closed) -> list[bool]:
    errors = over_noise(one)
    return [] if errors is None else [errors[1] > max(WORSE * errors[0], AT_NOISE)]


def accused(one: Closed) -> bool:
    """Tell whether a record is accused that has no fault; of a gap the report counts the samples only."""
    there = one.truth.fault.get("record")
    return any(s["record"] != there for s in one.answer["suspects"] if s["kind"] not in ("gap", "trend"))


def fault_found(one: Closed) -> bool:
    fault = one.truth.fault
    return any((s["record"], s["kind"]) == (fault["record"], fault["kind"]) for s in one.answer["suspects"])


def named(one: Closed) -> bool:
    return all_found(one.truth, one.groups, LARGEST_GROUP)


def off_reported(one: Closed) -> bool:
    """Tell whether a constant that is off, or a doubt of the model, is reported."""
    answer = one.answer
    return bool(answer["probabilities"]["nothing"] < ACCUSED or answer["probabilities"]["drifts"]
                or max((abs(z) for z in answer["probabilities"]["constants"].values()), default=0.0) > 2.0)  # fmt: skip


def scores_of(every: Sequence[Closed]) -> list[Score]:
    """Return all lines, for the arm, for the machines, and for the two kinds that the fit of the priors never saw."""
    found: list[Score] = []
    for group in dict.fromkeys(one.group for one in every):
        mine = [one for one in every if one.group == group]
        found += of_group(group, mine)
    return found


def of_group(group: str, mine: Sequence[Closed]) -> list[Score]:
    family = {name: [one for one in mine if one.family == name] for name in dict.fromkeys(one.family for one in mine)}

    def line(name: str, question: str, of: Callable[[Closed], Sequence[Any]], target: str = "",
             among: Sequence[Closed] = mine, total: Callable[[list[Any]], float] | None = None) -> None:  # fmt: skip
        found.append(score(name, question, group, among, of, target, total))

    found: list[Score] = []
    claimed = [one for one in mine if one.groups]
    listed = [one for one in mine if one.truth.effects and not one.is_unlisted]
    unlisted, controls = [one for one in mine if one.is_unlisted], family.get("control", [])
    line("S1", "expected calibration error of names", Closed.pairs, "<= 0.04", total=calibration_error)
    line("S1", "Brier score of names", Closed.pairs, total=brier)
    line("S1", "claims that are true", lambda c: [any(map(c.truth.holds, g)) for g in c.groups], ">= 0.97", claimed)
    line(
        "S1",
        "claims that are true, or of the same physics",
        lambda c: [any(c.truth.holds(n) or c.truth.is_same_physics(n) for n in g) for g in c.groups],
        "",
        claimed,
    )
    wrong = Closed.wrong
    line("S2", "a wrong name at 0.9, effect in the library", lambda c: [wrong(c, NEARLY_SURE)], "<= 0.01", listed)
    line("S2", "a wrong name at 0.9, effect not in the library", lambda c: [wrong(c, NEARLY_SURE)], "<= 0.05", unlisted)
    line(
        "S2", "the same, other names of the same physics allowed", lambda c: [wrong(c, NEARLY_SURE, True)], "", unlisted
    )
    line("S2", "a wrong name at 0.9, controls", lambda c: [wrong(c, NEARLY_SURE)], "<= 0", controls)
    for name, part in family.items():
        target = {"hidden": ">= 0.8", "unlisted": ">= 0.7", "wrong": ""}.get(name, ">= 0.95")
        line("S3", f"parameters inside their interval: {name}", inside, target, part)
        line("S4", f"interval score: {name}", Closed.held, "", part, interval_score)
    line("S3", "a constant off by three deviations is reported", lambda c: [off_reported(c)], ">= 0.8",
         family.get("wrong", []))  # fmt: skip
    exact = [one for one in controls if one.truth.exact]
    line("S4", "controls with exact constants: intervals within 1 %", narrow, ">= 0.9", exact)
    line("S4", "of these off by more than 1 %", off_and_narrow, "<= 0.01", exact)
    more = [one for one in unlisted if one.leaves_more]
    line("S5", "unknown at 0.5 where the library lacks an effect and more than noise is left",
         lambda c: [c.answer["probabilities"]["unknown"] >= 0.5], ">= 0.85", more)  # fmt: skip
    line(
        "S5", "unknown at 0.5 in controls", lambda c: [c.answer["probabilities"]["unknown"] >= 0.5], "<= 0.03", controls
    )
    for name, target in (("one", ">= 0.98"), ("two", ">= 0.97"), ("three", ">= 0.95")):
        line("S6", f"all effects named or grouped: {name}", lambda c: [named(c)], target,
             [one for one in family.get(name, []) if not one.is_unlisted])  # fmt: skip
    faults = [one for one in family.get("fault", []) if one.truth.fault["role"] == "train"
              and one.truth.fault.get("moves", 0.0) > MOVES]  # fmt: skip
    line("S6", "record and kind of a fault of a train record", lambda c: [fault_found(c)], ">= 0.98", faults)
    line("S6", "a sound record accused", lambda c: [accused(c)], "<= 0.01")
    line("S6", "held out worse than the declared model", is_worse, "<= 0")
    line("held out", "error over noise up to 1.1", lambda c: [r <= 1.1 for r in ratio(c)], ">= 0.85")
    line("held out", "error over noise up to 1.5", lambda c: [r <= 1.5 for r in ratio(c)], ">= 0.97")
    line("S4", "interval score over that of the former loop", Closed.beside_former, "<= 0.7", total=ratio_of(sum))
    line("S4", "the same, the median of parameters", Closed.beside_former, total=median_ratio)
    line("time", "processor time of a campaign, median [s]", lambda c: [c.answer["cpu_s"]], "", total=median)
    line("time", "processor time of a campaign, longest [s]", lambda c: [c.answer["cpu_s"]], "", total=max)
    times = Closed.times_beside_former
    line("time", "median over that of the former loop", times, "<= 1.5", total=ratio_of(median))
    line("time", "longest over that of the former loop", times, "<= 0.5", total=ratio_of(max))
    return [one for one in found if one.n]
