"""Options of identifiers: checked, never swallowed."""

from collections.abc import Iterable, Mapping
from dataclasses import fields
from difflib import get_close_matches
from typing import Any, TypeVar

import numpy as np

from armid.model.errors import ArmidError, nearest

OF_PYMOO = (
    "termination", "output", "display", "callback", "archive", "return_least_infeasible", "save_history", "verbose",
    "seed", "evaluator",
)  # fmt: skip
OF_SETUP = (*OF_PYMOO, "progress")

# A share below the rounding of 1 changes nothing.
SMALLEST_SHARE = 1e-15
# Larger populations do not fit into memory, larger budgets and schedules into no lifetime.
LARGEST_POPULATION, LARGEST_COUNT = 10**6, 10**15

Settings = TypeVar("Settings")


def options_of(kind: type[Settings], given: Mapping[str, Any], whose: str) -> Settings:
    """Return the options of a dataclass, defaults where nothing is given.

    whose: how a message names the identifier. Raises ArmidError for an unknown name; the dataclass checks its values.
    """
    refuse_unknown(given, [f.name for f in fields(kind)], whose)  # type: ignore[arg-type]
    return kind(**given)


def refuse_unknown(given: Iterable[str], known: Iterable[str], whose: str, unsaid: Iterable[str] = ()) -> None:
    """Raise ArmidError for an option that nobody knows, naming the nearest that is known.

    unsaid: options that are known too, and are named only where they are near.
    """
    names, further = list(known), list(unsaid)
    for name in given:
        if name not in (*names, *further):
            names += get_close_matches(name, further, n=1)
            raise ArmidError(f"{whose} has no option '{name}', {nearest(name, names)}")


def checked(name: str, value: Any, least: float = 0.0, expected: str = "a number of at least 0") -> float:
    """Return an option as a float; refuse with ArmidError what is no finite number or is below the least."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not least <= value < np.inf:
        raise ArmidError(f"{name} is {value!r}, expected {expected}")
    return float(value)


def checked_share(name: str, value: Any, most: float = 1.0) -> float:
    """Return an option as a float; refuse with ArmidError what is not above 0 or too small to count, or too large."""
    expected = f"a number above 0 and at most {most:g}"
    share = checked(name, value, SMALLEST_SHARE, expected)
    if share > most:
        raise ArmidError(f"{name} is {value!r}, expected {expected}")
    return share


def checked_count(name: str, value: Any, most: int = LARGEST_COUNT) -> int:
    """Return an option as an int; refuse with ArmidError what is no whole number above 0, or above the most."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ArmidError(f"{name} is {value!r}, expected a whole number above 0")
    if value > most:
        raise ArmidError(f"{name} is {value:.6g}, expected a whole number of at most {most:,}")
    return int(value)


def checked_population(name: str, value: Any) -> int:
    """Return a number of candidates at a time as an int; refuse with ArmidError what could not be kept."""
    return checked_count(name, value, LARGEST_POPULATION)


def checked_flag(name: str, value: Any) -> bool:
    """Return an option as it is; refuse with ArmidError what is neither true nor false."""
    if not isinstance(value, bool | np.bool_):
        raise ArmidError(f"{name} is {value!r}, expected true or false")
    return bool(value)


def checked_choice(name: str, value: Any, known: tuple[str, ...]) -> str:
    """Return an option as it is; refuse with ArmidError what is none of the known words."""
    if value not in known:
        raise ArmidError(f"{name} is {value!r}, {nearest(str(value), known)}")
    return str(value)
