"""Write the tables and figures of a document to files: CSV with every digit, LaTeX, PNG and SVG, or PDF."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armid.report.document import Document, Table
from armid.report.latex import latex
from armid.report.style import save, save_for_print
from armid.units import angles_in

if TYPE_CHECKING:
    from pandas import DataFrame

# What a cell begins with that a spreadsheet computes.
FORMULA = ("=", "+", "-", "@", "\t", "\r")


def write_files(document: Document, path_of: Callable[[str], Path]) -> None:
    """Write each named table as CSV and LaTeX and each figure as PNG and SVG; the bytes hold no date and no place."""
    for table in document.tables:
        path_of(f"{table.name}.csv").write_text(csv(table), encoding="utf-8")
        if table.most:
            path_of(f"{table.name}.tex").write_text(latex(table), encoding="utf-8")
    with angles_in(document.angle):
        for figure in document.figures:
            if figure.draw is not None:
                save(figure.draw(), path_of(f"{figure.name}.png"), path_of(f"{figure.name}.svg"))


def write_prints(document: Document, width: str, path_of: Callable[[str], Path]) -> None:
    """Write each figure as PDF of the width of a page's "single" or "double" column."""
    with angles_in(document.angle):
        for figure in document.figures:
            if figure.draw is not None:
                save_for_print(figure.draw, path_of(f"{figure.name}.pdf"), width)


def csv(table: Table) -> str:
    """Return every row and number of the table, SI, as CSV; its header holds the keys of the columns."""
    from pandas import DataFrame

    frame = table.frame
    if not isinstance(frame, DataFrame):
        frame = DataFrame([list(row) for row in frame], columns=[c.key for c in table.columns])
    return csv_text(frame)


def csv_text(frame: "DataFrame") -> str:
    """Return a frame as CSV in which a spreadsheet finds no formula: names that look like one get an apostrophe."""
    from pandas.api.types import is_numeric_dtype

    safe = frame.rename(columns=no_formula)
    for i, kind in enumerate(frame.dtypes):
        if not is_numeric_dtype(kind):
            safe.isetitem(i, frame.iloc[:, i].map(no_formula).array)
    return str(safe.to_csv(index=False, lineterminator="\n"))


def no_formula(value: Any) -> Any:
    if not isinstance(value, str) or not value.startswith(FORMULA):
        return value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value


def frame_of(table: Table) -> "DataFrame":
    """Return the rows that are shown under their headings, numbers in the units of these."""
    from pandas import DataFrame

    heads = [c.header or c.key for c in table.columns]
    frame = DataFrame([[c.text or None for c in row] for row in table.cells()], columns=heads)
    for i, column in enumerate(table.columns):
        if column.digits:
            numbers = [np.nan if row[i].number is None else row[i].number for row in table.cells()]
            frame.isetitem(i, column.factor * np.array(numbers, dtype=float))
    return frame
