"""Kinds of values in a TOML file.

A kind is a function that returns a value as it is wanted, or raises KindError. These few stand here in place of
pydantic, whose import alone would take a tenth of the time in which the program starts.
"""

from collections.abc import Callable
from typing import Any

from armid.record.table import LARGEST

Kind = Callable[[object], Any]


class KindError(Exception):
    """Tell that a value is not of its kind: the path to the part that is not, and what was found there."""

    def __init__(self, found: object, path: str = "") -> None:
        super().__init__(path)
        self.found, self.path = found, path


def part(kind: Kind, value: object, path: str) -> Any:
    """Return a part of a value as its kind wants it."""
    try:
        return kind(value)
    except KindError as error:
        raise KindError(error.found, path + error.path) from None


def number(value: object) -> float:
    """Return a finite number that can be squared safely."""
    # in Python a bool is an int too
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST:
        return float(value)
    raise KindError(value)


def above_zero(value: object) -> float:
    """Return a number above 0."""
    if number(value) <= 0:
        raise KindError(value)
    return number(value)


def text(value: object) -> str:
    """Return a text that is not empty."""
    if isinstance(value, str) and value:
        return value
    raise KindError(value)


def any_table(value: object) -> dict[str, Any]:
    """Return a table, whatever it holds."""
    if isinstance(value, dict):
        return value
    raise KindError(value)


def one_of(*words: str) -> Kind:
    """Return the kind of a text that is one of some words."""

    def kind(value: object) -> str:
        if text(value) not in words:
            raise KindError(value)
        return text(value)

    return kind


def table_of(inner: Kind) -> Kind:
    """Return the kind of a table whose values are of one kind."""
    return lambda value: {name: part(inner, v, f".{name}") for name, v in any_table(value).items()}


def list_of(inner: Kind, shortest: int = 0, longest: float = float("inf")) -> Kind:
    """Return the kind of a list whose values are of one kind."""

    def kind(value: object) -> tuple[Any, ...]:
        if not isinstance(value, list) or not shortest <= len(value) <= longest:
            raise KindError(value)
        return tuple(part(inner, v, f".{i}") for i, v in enumerate(value))

    return kind
