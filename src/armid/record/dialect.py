"""CSV files that are not written with commas, points and one header line: how they are written, where that is certain.

A file is read in another way than the plain one only where no second way would give numbers. Where a second one would,
the file is refused with the line of pandas that rewrites it. Each assumption is in the sentence of the warning.
"""

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np

from armid.errors import ArmidError, quoted
from armid.model import Array
from armid.units import UNIT_ENDS

CELL_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)
COLUMN = re.compile(r"([+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\n)*", re.ASCII)
# A number with one comma for its point, and one with separators of thousands or the same digits with decimals.
COMMA = re.compile(r"[+-]?(\d+,\d*|,\d+)([eE][+-]?\d+)?", re.ASCII)
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}([.,]\d{3})+", re.ASCII)
# A time of day: with a date or without, and with a zone or without.
CLOCK = re.compile(
    r"(\d{4}-\d\d-\d\d[T ])?([01]?\d|2[0-3]):([0-5]\d):([0-5]\d)(?:[.,](\d+))? ?(Z|[+-]\d\d:?\d\d)?", re.ASCII
)
DAY = 86_400.0  # [s]
# What programs write where they have no number.
NO_NUMBER = ("", "nan", "na", "n/a", "null", "none")
SEPARATORS = {",": "','", ";": "';'", "\t": "a tab"}
COMMENTS = ("#", "%", "//")


@dataclass(frozen=True)
class Cells:
    """The cells of a file, stripped; lines: of the file on which its rows stand; assumed: in words, in order."""

    names: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    header_line: int
    assumed: tuple[str, ...]


def text_of(path: Path, file: str) -> tuple[str, bool]:
    """Return the text of a file and whether it is UTF-16; refuse bytes that are neither this with a mark nor UTF-8."""
    content = path.read_bytes()
    wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        text = content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        check_names(content.splitlines()[0].decode("utf-8", "replace").split(","), 1, file)
        line = 1 if wide else content[: error.start].replace(b"\r\n", b"\n").replace(b"\r", b"\n").count(b"\n") + 1
        raise ArmidError(f"{file}, line {line}: not readable as text, a CSV file in UTF-8 is expected") from error
    return text.replace("\r\n", "\n").replace("\r", "\n"), wide


def cells_of(text: str, wide: bool, file: str) -> Cells:
    """Return the cells of a file with what had to be assumed. Raises ArmidError where two ways to read it are left."""
    numbered = [(number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip()]
    comments = [(number, line) for number, line in numbered if line.lstrip().startswith(COMMENTS)]
    kept = [(number, line) for number, line in numbered if not line.lstrip().startswith(COMMENTS)]
    if not kept:
        check_names([], 1, file)
    assumed = ["UTF-16"] if wide else []
    separator = separator_of(kept, file)
    split = [(number, cells_in(line, separator, f"{file}, line {number}")) for number, line in kept]
    header_line, names = split[0]
    body = split[1:]
    if all(CELL_NUMBER.fullmatch(cell) for cell in names) and comments and comments[-1][0] < header_line:
        above = cells_in(re.sub(r"^\s*(#|%|//)\s*", "", comments[-1][1]), separator, file)
        if len(above) == len(names):
            header_line, names, body = comments[-1][0], above, split
            assumed.append("names in the comment above the numbers")
    if separator != ",":
        assumed.append(f"{SEPARATORS[separator]} between columns")
    if comments and header_line not in dict(comments):
        assumed.append(f"{len(comments)} comment line{'s' * (len(comments) > 1)} left out")
    n = len(names) - (len(names) > 1 and not names[-1] and all(len(c) < len(names) or not c[-1] for _, c in body))
    check_names(names[:n], header_line, file)
    trailing = n < len(names) or (body and all(len(cells) == n + 1 and not cells[-1] for _, cells in body))
    if trailing:
        assumed.append("a separator at the end of each line")
        names, body = names[:n], [(number, c[:n] if len(c) == n + 1 and not c[n] else c) for number, c in body]
    for number, cells in body:
        if len(cells) != n:
            hint = ""
            if separator == "," and len(cells) == 2 * n and all(re.fullmatch(r"[+-]?\d+", c) for c in cells):
                hint = ("; a comma both between columns and in numbers cannot be read: export the file again with a "
                        "semicolon between columns")  # fmt: skip
            raise ArmidError(f"{file}, line {number}: {len(cells)} values in a row, {n} are expected as in the "
                             f"header{hint}")  # fmt: skip
    if body and (units := units_in(body[0][1])):
        names = [with_unit(name, unit, f"{file}, line {body[0][0]}") for name, unit in zip(names, units, strict=True)]
        assumed.append(f"units on line {body[0][0]}")
        body = body[1:]
    rows = [cells for _, cells in body]
    lines = tuple(number for number, _ in body)
    if has_decimal_comma(rows, separator, lines, file):
        rows = [[c.replace(",", ".") if COMMA.fullmatch(c) else c for c in cells] for cells in rows]
        assumed.append("',' for the decimal point")
    return Cells(tuple(names), tuple(map(tuple, rows)), lines, header_line, tuple(assumed))


def check_names(names: Sequence[str], line: int, file: str) -> None:
    """Refuse names of columns that are repeated, not readable, or numbers."""
    where = f"{file}, line {line}"
    if not any(names):
        raise ArmidError(f"{where}: the file is empty there, a header such as 'time_s,angular_velocity_deg_s' is "
                         "expected")  # fmt: skip
    if len(names) == 1 and " " in names[0]:
        raise ArmidError(f"{where}: one column {quoted(names[0])} is there, columns separated by commas are expected")
    if all(CELL_NUMBER.fullmatch(name) for name in names):
        raise ArmidError(f"{where}: numbers are there, and no header: a line of names such as "
                         "'time_s,angular_velocity_deg_s' is expected above them")  # fmt: skip
    for i, name in enumerate(names):
        if not name or not name.isprintable():
            raise ArmidError(f"{where}: column {i + 1} is called {quoted(name)}, a readable name is expected")
        if name in names[:i]:
            raise ArmidError(f"{where}: column {quoted(name)} is there twice, each name once is expected")


def pandas_line(arguments: str) -> str:
    return f"pandas.read_csv(FILE, {arguments}).to_csv(FILE, index=False)"


def separator_of(kept: Sequence[tuple[int, str]], file: str) -> str:
    """Return what separates the columns: what cuts the header, and every row into as many cells."""
    number, header = kept[0]
    present = [s for s in SEPARATORS if s in header]
    fitting = [s for s in present if fits(kept, s)]
    if len(fitting) > 1:
        words = " and ".join(SEPARATORS[s] for s in fitting)
        raise ArmidError(f"{file}, line {number}: {words} both cut every line into as many cells, one separator is "
                         f"expected: write it anew with {pandas_line('sep=SEPARATOR')}")  # fmt: skip
    return fitting[0] if fitting else max(present, key=header.count, default=",")


def fits(kept: Sequence[tuple[int, str]], separator: str) -> bool:
    try:
        counts = [len(cells_in(line, separator, "")) for _, line in kept]
    except ArmidError:
        return False
    return counts[0] > 1 and all(abs(count - counts[0]) <= 1 for count in counts)


def cells_in(line: str, separator: str, where: str) -> list[str]:
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        (cells,) = csv.reader([line], delimiter=separator, strict=True, skipinitialspace=True)
    except (csv.Error, ValueError) as error:
        raise ArmidError(f"{where}: a quotation mark is open or stands inside a cell, quotes around whole cells are "
                         "expected") from error  # fmt: skip
    return [cell.strip() for cell in cells]


def units_in(cells: Sequence[str]) -> list[str]:
    """Return the unit of each column where a row holds units and no number, else an empty list."""
    bare = [cell.strip("[]() ") for cell in cells]
    known = [unit in UNIT_ENDS for unit in bare]
    words = all(not CELL_NUMBER.fullmatch(c) and not COMMA.fullmatch(c) and (k or c.lower() not in NO_NUMBER or not c)
                for c, k in zip(bare, known, strict=True))  # fmt: skip
    return bare if any(known) and words else []


def with_unit(name: str, unit: str, where: str) -> str:
    """Return the name of a column with the end of its unit; refuse a name that ends in another one."""
    end = UNIT_ENDS.get(unit)
    if end is None or name.endswith(f"_{end}"):
        return name
    other = max((e for e in UNIT_ENDS.values() if name.endswith(f"_{e}")), key=len, default="")
    if other:
        raise ArmidError(f"{where}: the unit of {quoted(name)} is {quoted(unit)}, the unit at the end of its name is "
                         "expected")  # fmt: skip
    return f"{name}_{end}"


def has_decimal_comma(rows: Sequence[Sequence[str]], separator: str, lines: Sequence[int], file: str) -> bool:
    """Tell whether numbers have a comma for their point; refuse a file in which it may part thousands.

    Numbers such as 0,5 or 12,25 tell; where all are such as 1,234 nothing does. A file that has points, too, keeps
    them: a cell with a comma is not a number then.
    """
    sign = ","
    marked = [(number, c) for number, cells in zip(lines, rows, strict=True) for c in cells if COMMA.fullmatch(c)]
    pointed = any("." in c and CELL_NUMBER.fullmatch(c) for cells in rows for c in cells)
    if pointed or not marked:
        if separator == "," or marked:
            return False
        # in a file that a program of a language with decimal commas may have written, 1.234 may be a thousand
        sign = "."
        marked = [(number, c) for number, cells in zip(lines, rows, strict=True) for c in cells if "." in c]
        marked = [(number, c) for number, c in marked if CELL_NUMBER.fullmatch(c) or THOUSANDS.fullmatch(c)]
    if marked and all(THOUSANDS.fullmatch(c) for _, c in marked):
        number, cell = marked[0]
        arguments = f"sep={separator!r}, decimal={sign!r}".replace("'", '"')
        raise ArmidError(f"{file}, line {number}: {quoted(cell)} may be {cell.replace(sign, '')} or "
                         f"{cell.replace(sign, '.')}, as no other number decides: one meaning is expected, by "
                         f"{pandas_line(arguments)}")  # fmt: skip
    return sign == ","


def columns_of(cells: Cells) -> Iterator[tuple[str, Array | tuple[int, str]]]:
    """Yield each column: name, and its numbers (NaN where a cell is empty), or line and text of a cell without one."""
    for name, column in zip(cells.names, zip(*cells.rows, strict=True), strict=True):
        if COLUMN.fullmatch("\n".join(column) + "\n"):
            yield name, np.array(column, dtype=np.float64)
            continue
        filled = ["nan" if cell.lower() in NO_NUMBER else cell for cell in column]
        wrong = next((i for i, cell in enumerate(filled) if cell != "nan" and not CELL_NUMBER.fullmatch(cell)), None)
        if wrong is not None and CLOCK.fullmatch(column[wrong]):  # the fault is the cell that differs
            wrong = next((i for i, cell in enumerate(column) if not CLOCK.fullmatch(cell)), wrong)
        yield name, np.array(filled, dtype=np.float64) if wrong is None else (cells.lines[wrong], column[wrong])


def clocks_of(cells: Cells) -> dict[str, Array]:
    """Return columns of times of day: name -> seconds after the first, (n_rows,); without a date midnight may pass."""
    clocks: dict[str, Array] = {}
    for name, column in zip(cells.names, zip(*cells.rows, strict=True), strict=True):
        read = [CLOCK.fullmatch(cell) for cell in column] if CLOCK.fullmatch(column[0]) else []
        parts = [one.groups(default="") for one in read if one is not None]
        if len(parts) < len(column) or len({(bool(part[0]), part[-1]) for part in parts}) > 1:
            continue
        try:
            days = np.array([date.fromisoformat(part[0].strip("T ")).toordinal() if part[0] else 0 for part in parts])
        except ValueError:
            continue
        times = np.array([3600 * int(h) + 60 * int(m) + int(s) + float(f"0.{f}") for _, h, m, s, f, _ in parts])
        times = times - times[0] + DAY * (days - days[0])
        if not parts[0][0]:
            times[1:] += DAY * np.cumsum(np.diff(times) < -0.5 * DAY)
        clocks[name] = np.round(times, 9)
    return clocks
