"""A table of a report: its numbers, and how they are shown."""

from dataclasses import dataclass

import numpy as np
from pandas import DataFrame

MOST_SHOWN = 60


@dataclass(frozen=True)
class Column:
    """Say how one column of a frame is shown.

    key: the column; header: its heading, with the unit; digits: a format such as ".3g", "" for text; factor: from the
    number in the frame to the one shown.
    """

    key: str
    header: str
    digits: str = ""
    factor: float = 1.0


@dataclass(frozen=True, eq=False)
class Table:
    """Hold one table.

    name: of its files; title; words: what it shows, how each number was computed, and the number of runs;
    frame: SI numbers; columns: what is shown, in order; most: rows shown in the text, the files hold all.
    """

    name: str
    title: str
    words: str
    frame: DataFrame
    columns: tuple[Column, ...]
    most: int = MOST_SHOWN

    @property
    def n_hidden(self) -> int:
        """How many rows the text does not show."""
        return max(0, len(self.frame) - self.most)


def shown_rows(table: Table, all_rows: bool = False) -> list[list[str]]:
    """Return the cells as text, row by row."""
    frame = table.frame if all_rows else table.frame.head(table.most)
    columns = [[cell(value, c) for value in frame[c.key]] for c in table.columns]
    return [list(row) for row in zip(*columns, strict=True)]


def cell(value: object, column: Column) -> str:
    """Return one cell; a number that does not exist is left empty."""
    if not column.digits:
        return "" if value is None or value != value else str(value)  # noqa: PLR0124 - a NaN differs from itself
    number = float(value) * column.factor  # type: ignore[arg-type]
    if np.isnan(number):
        return ""
    return format(number, column.digits)
