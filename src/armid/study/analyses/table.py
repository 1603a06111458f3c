"""A table of a report: its numbers, and how they are shown."""

import re
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


def markdown(table: Table) -> str:
    """Return the table in Markdown, numbers to the right."""
    header = [escaped(c.header) for c in table.columns]
    rule = ["---:" if c.digits else "---" for c in table.columns]
    lines = [header, rule, *([escaped(text) for text in row] for row in shown_rows(table))]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def escaped(text: str) -> str:
    """Return text that stays one cell and carries no HTML."""
    for plain, safe in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("|", "\\|"), ("\n", " ")):
        text = text.replace(plain, safe)
    return text


def csv(table: Table) -> str:
    """Return every row and number of the table, SI, as CSV; its header holds the keys of the frame."""
    return str(table.frame.to_csv(index=False, lineterminator="\n"))


def latex(table: Table) -> str:
    """Return the table as a LaTeX float with booktabs rules."""
    frame = DataFrame(shown_rows(table), columns=[c.header for c in table.columns])
    align = "".join("r" if c.digits else "l" for c in table.columns)
    title = latex_text(table.title)
    return frame.to_latex(
        index=False, escape=True, column_format=align, caption=title, label=f"tab:{table.name}", position="htbp"
    )


def latex_text(text: str) -> str:
    """Return text in which LaTeX reads no command."""
    special = {c: f"\\{c}" for c in "&%$#_{}"} | {"~": "\\textasciitilde{}", "^": "\\textasciicircum{}"}
    special["\\"] = "\\textbackslash{}"
    return "".join(special.get(letter, letter) for letter in text)


def slug(*texts: str) -> str:
    """Return a file name of letters, digits and underscores: "pso, literal" becomes "pso_literal"."""
    return re.sub(r"[^A-Za-z0-9]+", "_", "_".join(texts)).strip("_").lower()


def unlike(names: list[str]) -> list[str]:
    """Return the names with a number behind those that are there already."""
    found: list[str] = []
    for name in names:
        again = sum(re.fullmatch(rf"{re.escape(name)}(_\d+)?", f) is not None for f in found)
        found.append(f"{name}_{again + 1}" if again else name)
    return found
