"""Unknowns, and the natural sizes of a machine, so that one effect serves a 0.2 N m pendulum and a 600 N m arm."""

import keyword
import math
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

from armid.errors import ModelError, nearest


def check_name(name: str, what: str) -> None:
    """Refuse a name that equations could not use."""
    if name == "time":
        raise ModelError(f"{what} 'time' cannot have this name: in the equations, time is the time [s]")
    if not name.isidentifier() or keyword.iskeyword(name) or "__" in name or name != name.strip("_"):
        raise ModelError(f"{what} '{name}' is not a usable name: letters, digits and single underscores are expected")


def check_numbers(what: str, **values: Any) -> None:
    """Refuse what stands where a number is expected; None is passed over."""
    for word, value in values.items():
        if value is not None and (isinstance(value, bool) or not isinstance(value, Real)):
            raise ModelError(f"{what} has {word} {value!r}: a number is expected")


@dataclass(frozen=True)
class Parameter:
    """Declare one unknown.

    name: as the equations spell it.
    unit: a physical unit, or a product of the plant's scales `effort`, `speed`, `inertia` (effort over speed, times
        1 s) such as `effort/speed`; then `low`, `high`, `null`, `fixed` and `nominal` are multiples of that scale.
    low, high: bounds of the search, SI (or multiples of the scale).
    null: the value at which an effect vanishes (None for a parameter of a plant or of an effect's shape).
    fixed: the value at which it stays unless someone frees it (None: it is free).
    nominal: the value of a simulation without another one (None: `null`, then `fixed`, else it has to be given).
    note: what it is, in words.
    """

    name: str
    unit: str
    low: float
    high: float
    null: float | None = None
    fixed: float | None = None
    nominal: float | None = None
    note: str = ""

    def __post_init__(self) -> None:
        check_name(self.name, "parameter")
        numbers = {word: getattr(self, word) for word in ("low", "high", "null", "fixed", "nominal")}
        check_numbers(f"parameter '{self.name}'", **numbers)
        if not self.low < self.high:
            raise ModelError(f"parameter '{self.name}' has low {self.low} and high {self.high}: low < high is expected")


# By such a factor a value misses its declared range that was given in another unit: degrees, percent, MPa.
FAR_OUT = 20.0


def warn_if_far(parameter: Parameter, values: Sequence[float], where: str) -> None:
    """Warn where every value is far outside the declared range (SI), as a forgotten factor of the unit gives.

    A negative value of what is declared to be positive warns as well: no inertia is below 0.
    """
    low, high = parameter.low, parameter.high
    declared = f"the declared range, {low:g} to {high:g} {parameter.unit}; it is taken as it is"
    if low > 0.0 and any(v < 0.0 for v in values):
        warnings.warn(f"{where} is negative, outside {declared}", stacklevel=3)
    elif all(abs(v) > FAR_OUT * max(abs(low), abs(high)) or (low > 0.0 and FAR_OUT * v < low) for v in values):
        warnings.warn(f"{where} is far outside {declared}", stacklevel=3)


def warn_of_far(
    parameters: Mapping[str, Parameter], fixed: Mapping[str, float], bounds: Mapping[str, tuple[float, float]]
) -> None:
    """Warn of fixed values and bounds far outside the declared range, as a forgotten factor gives."""
    given = {name: ([v], f"fix {name} = {v:g}") for name, v in fixed.items() if math.isfinite(v)}
    finite = {n: pair for n, pair in bounds.items() if all(map(math.isfinite, pair)) and pair[0] < pair[1]}
    given |= {n: (list(pair), f"bounds {n} = {pair[0]:g} to {pair[1]:g}") for n, pair in finite.items()}
    for name, (values, text) in given.items():
        if name in parameters:
            warn_if_far(parameters[name], values, text)


SCALE_WORDS = ("effort", "speed", "inertia", "s", "1")


@dataclass(frozen=True)
class Scales:
    """Declare the sizes of effort and speed of a machine.

    effort, speed: typical largest effort and speed, SI.
    effort_unit: "N m" or "N"; length_unit: "rad" or "m" (speed is in length_unit/s). A plant whose speed `omega` is in
    m/s has N and m, whether or not it says so.
    """

    effort: float
    speed: float
    effort_unit: str = "N m"
    length_unit: str = "rad"

    @property
    def inertia_unit(self) -> str:
        """Unit of effort over acceleration."""
        return "kg" if self.length_unit == "m" else "kg m2"


def powers_of(unit: str) -> dict[str, int] | None:
    """Return word -> exponent of a product of scales, or None when the unit is a physical one."""
    if not re.search(r"effort|speed|inertia", unit):
        return None
    if not re.fullmatch(r"\w+(\^\d)?([*/]\w+(\^\d)?)*", unit):
        raise ModelError(f"unit '{unit}' is not a product of scales: words joined by * and /, such as effort/speed^2, "
                         "are expected")  # fmt: skip
    powers: dict[str, int] = {}
    for sign, word, power in re.findall(r"(^|[*/])(\w+)(?:\^(\d))?", unit):
        if word not in SCALE_WORDS:
            raise ModelError(f"unit '{unit}' holds '{word}': {nearest(word, SCALE_WORDS)}")
        powers[word] = powers.get(word, 0) + (-1 if sign == "/" else 1) * int(power or 1)
    return powers


def physical_unit(powers: dict[str, int], scales: Scales) -> str:
    """Return the SI unit of a product of scales, such as `N m s/rad`."""
    if powers == {"inertia": 1}:
        return scales.inertia_unit
    units = {
        scales.effort_unit: powers.get("effort", 0),
        scales.inertia_unit: powers.get("inertia", 0),
        "s": powers.get("s", 0) - powers.get("speed", 0),
        scales.length_unit: powers.get("speed", 0),
    }
    above = " ".join(u if p == 1 else f"{u}{p}" for u, p in units.items() if p > 0)
    below = " ".join(u if p == -1 else f"{u}{-p}" for u, p in units.items() if p < 0)
    return f"{above or '1'}/{below}" if below else above or "1"


def resolve(parameter: Parameter, scales: Scales) -> Parameter:
    """Return the parameter with bounds, null and fixed value in SI."""
    powers = powers_of(parameter.unit)
    if powers is None:
        return parameter
    sizes = {"effort": scales.effort, "speed": scales.speed, "inertia": scales.effort / scales.speed}
    size = math.prod(sizes.get(word, 1.0) ** power for word, power in powers.items())
    values = {name: getattr(parameter, name) for name in ("low", "high", "null", "fixed", "nominal")}
    scaled: dict[str, Any] = {name: None if value is None else value * size for name, value in values.items()}
    return replace(parameter, unit=physical_unit(powers, scales), **scaled)
