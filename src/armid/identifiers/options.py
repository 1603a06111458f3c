"""Options of identifiers: checked, never swallowed."""

from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

from armid.model.errors import ArmidError, nearest

OF_PYMOO = (
    "termination", "output", "display", "callback", "archive", "return_least_infeasible", "save_history", "verbose",
    "seed", "evaluator",
)  # fmt: skip
OF_SETUP = (*OF_PYMOO, "progress")

Settings = TypeVar("Settings")


def options_of(kind: type[Settings], given: Mapping[str, Any], whose: str) -> Settings:
    """Return the options of a dataclass, defaults where nothing is given.

    whose: how a message names the identifier. Raises ArmidError for an unknown name; the dataclass checks its values.
    """
    refuse_unknown(given, [f.name for f in fields(kind)], whose)  # type: ignore[arg-type]
    return kind(**given)


def refuse_unknown(given: Iterable[str], known: Iterable[str], whose: str) -> None:
    """Raise ArmidError for an option that nobody knows, naming the nearest that is known."""
    names = list(known)
    for name in given:
        if name not in names:
            raise ArmidError(f"{whose} has no option '{name}', {nearest(name, names)}")


def checked(name: str, value: Any, least: float = 0.0, expected: str = "a number of at least 0") -> float:
    """Return an option as a float; refuse with ArmidError what is no finite number or is below the least."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not least <= value < np.inf:
        raise ArmidError(f"{name} is {value!r}, expected {expected}")
    return float(value)


def checked_share(name: str, value: Any) -> float:
    """Return an option as a float; refuse with ArmidError what is not above 0 and at most 1."""
    expected = "a number above 0 and at most 1"
    share = checked(name, value, float(np.finfo(np.float64).tiny), expected)
    if share > 1.0:
        raise ArmidError(f"{name} is {value!r}, expected {expected}")
    return share


def checked_count(name: str, value: Any) -> int:
    """Return an option as an int; refuse with ArmidError what is no whole number above 0."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ArmidError(f"{name} is {value!r}, expected a whole number above 0")
    return int(value)


def checked_choice(name: str, value: Any, known: tuple[str, ...]) -> str:
    """Return an option as it is; refuse with ArmidError what is none of the known words."""
    if value not in known:
        raise ArmidError(f"{name} is {value!r}, {nearest(str(value), known)}")
    return str(value)
