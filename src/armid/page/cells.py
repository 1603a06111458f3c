"""Cells and tables from numbers and texts."""

import re
from collections.abc import Sequence

import numpy as np

from armid.page.page import Cell, Grid

FIRST_NUMBER = re.compile(r"\s*(?:below )?([-+]?(?:inf|(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?))(?=[\s%,;(]|$)")


def text_cell(text: str) -> Cell:
    """Return a cell that is sorted by the number that it begins with, else as text."""
    found = FIRST_NUMBER.match(text)
    return Cell(text, float(found.group(1))) if found else Cell(text)


def number_cell(value: float | None, digits: str, factor: float = 1.0) -> Cell:
    """Return a number; None and NaN are left empty."""
    if value is None or np.isnan(value):
        return Cell("")
    # + 0.0 takes the sign off a zero
    return Cell(format(factor * value + 0.0, digits), float(value))


def grid(title: str, headers: Sequence[str], rows: Sequence[Sequence[Cell]], note: str = "") -> Grid:
    """Return a table; a column of numbers alone stands to the right."""
    right = tuple(
        any(row[i].number is not None for row in rows) and all(row[i].number is not None or not row[i].text
                                                                for row in rows)
        for i in range(len(headers))
    )  # fmt: skip
    return Grid(title, tuple(headers), tuple(tuple(row) for row in rows), right, note)


def pairs(title: str, rows: Sequence[tuple[str, str]]) -> Grid:
    """Return a table of two columns: what, and its value."""
    return Grid(title, ("what", "value"), tuple((Cell(a), Cell(b)) for a, b in rows), (False, False))
