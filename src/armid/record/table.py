"""A CSV file of numbers under one header line.

numpy's reader is used, not that of pandas: it is as strict as the format (pandas fills short rows and takes words for
missing numbers), and a program that reads records of some thousand samples need not import pandas.
"""

import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError, nearest, shown
from armid.model import Input, Plant

Array = NDArray[np.float64]
LARGEST = 1e30
LONGEST_HEADER = 1 << 16
NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)


@dataclass(frozen=True, eq=False)
class Table:
    """Hold the columns of one file.

    file: name to show. path: where it is. columns: header -> values, shape (n_rows,), all finite.
    """

    file: str
    path: Path
    columns: dict[str, Array]

    def line_of(self, row: int) -> int:
        """Return the line of the file, counted from 1, on which a row of numbers stands."""
        filled = (number for number, line in lines_of(self.path) if number > 1 and line)
        return next(number for i, number in enumerate(filled) if i == row)


def read_table(path: Path, file: str) -> Table:
    """Read a CSV file: one header line, then numbers separated by commas; empty lines are skipped.

    file: how messages name it. A million rows of four columns take about a second.

    Raises ArmidError, with the line where there is one, for an empty or unreadable file, text that is not UTF-8, a
    header with unnamed or repeated columns, a row of another length and anything that is no finite number.
    """
    try:
        header, values = header_of(path), numbers_of(path)
    except OSError as error:
        raise ArmidError(f"{file} cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise fault_of(path, file, error) from error
    names = names_of(header, file)
    if values.shape[0] == 0:
        raise ArmidError(f"{file} holds no samples: rows of numbers are expected below the header")
    table = Table(file, path, {})
    if values.shape[1] != len(names):
        raise ArmidError(f"{file}, line {table.line_of(0)}: {values.shape[1]} values in a row, {len(names)} are "
                         f"expected as in the header")  # fmt: skip
    check_size(values, names, table)
    table.columns.update({name: np.ascontiguousarray(column) for name, column in zip(names, values.T, strict=True)})
    return table


def header_of(path: Path) -> str:
    """Return the first line; raise ValueError where the file is no text."""
    with path.open(encoding="utf-8-sig") as lines:
        return lines.readline(LONGEST_HEADER)


def names_of(line: str, file: str) -> list[str]:
    """Return the names of the columns in a header.

    Raises ArmidError for a header that names one column twice, leaves one unnamed, or has other separators.
    """
    if not line.strip():
        raise ArmidError(f"{file}, line 1: the file is empty there, a header such as "
                         "'time_s,angular_velocity_deg_s' is expected")  # fmt: skip
    names = [name.strip().strip('"').strip() for name in line.split(",")]
    if len(names) == 1 and any(separator in names[0] for separator in ";\t "):
        raise ArmidError(f"{file}, line 1: one column {shown(names[0])} is there, columns separated by commas are "
                         "expected")  # fmt: skip
    for i, name in enumerate(names):
        if not name or not name.isprintable():
            raise ArmidError(f"{file}, line 1: column {i + 1} is called {shown(name)}, a readable name is expected")
        if name in names[:i]:
            raise ArmidError(f"{file}, line 1: column {shown(name)} is there twice, each name once is expected")
    return names


def numbers_of(path: Path) -> Array:
    """Return the rows below the header, shape (n_rows, n_columns); raise ValueError where they are no table."""
    with warnings.catch_warnings():
        # numpy warns of a file without rows; the caller says it in its own sentence
        warnings.filterwarnings("ignore", message=".*input contained no data", category=UserWarning)
        values: Array = np.loadtxt(path, delimiter=",", comments=None, skiprows=1, ndmin=2, encoding="utf-8-sig")
    return values


def check_size(values: Array, names: list[str], table: Table) -> None:
    """Refuse the first number that is not finite or too large to be squared safely."""
    wrong = ~(np.abs(values) <= LARGEST)
    if wrong.any():
        row, column = (int(i) for i in np.argwhere(wrong)[0])
        value = float(values[row, column])
        expected = f"a number within +-{LARGEST:g}" if np.isfinite(value) else "a finite number"
        raise ArmidError(f"{table.file}, line {table.line_of(row)}: {names[column]} is {value:g}, {expected} "
                         "is expected")  # fmt: skip


def fault_of(path: Path, file: str, error: ValueError) -> ArmidError:
    """Return the sentence for a file that is no table of numbers: the first line that is wrong, and why."""
    names: list[str] = []
    for number, line in lines_of(path):
        try:
            text = line.decode("utf-8-sig" if number == 1 else "utf-8")
        except UnicodeDecodeError:
            return ArmidError(f"{file}, line {number}: not readable as text, a CSV file in UTF-8 is expected")
        if number == 1:
            names = names_of(text, file)
        elif text and (wrong := fault_of_row(text.split(","), names)):
            return ArmidError(f"{file}, line {number}: {wrong}")
    return ArmidError(f"{file} cannot be read as a table of numbers: {shown(str(error))}")


def fault_of_row(fields: list[str], names: list[str]) -> str:
    """Return what is wrong with a row, "" when nothing is."""
    if len(fields) != len(names):
        return f"{len(fields)} values in a row, {len(names)} are expected as in the header"
    wrong = [i for i, text in enumerate(fields) if not NUMBER.fullmatch(text)]
    if not wrong:
        return ""
    return f"{names[wrong[0]]} is {shown(fields[wrong[0]].strip())}, a finite number is expected"


def lines_of(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield (number from 1, line without its end), whatever ends the lines."""
    with path.open(encoding="latin-1") as lines:
        for number, line in enumerate(lines, start=1):
            yield number, line.rstrip("\n").encode("latin-1")


# What the headers of a record mean: quantity and unit.
#
# A header is a quantity and its unit, `angular_velocity_deg_s`; the factor turns the column into SI.

DEGREE = np.pi / 180.0
TIME = "time_s"
SPEEDS = {
    "angular_velocity_deg_s": ("rad/s", DEGREE),
    "angular_velocity_rad_s": ("rad/s", 1.0),
    "velocity_m_s": ("m/s", 1.0),
}
POSITIONS = {
    "position_m": ("m/s", 1.0),
    "angle_rad": ("rad/s", 1.0),
    "angle_deg": ("rad/s", DEGREE),
}


def time_column(table: Table) -> Array:
    """Return the times [s], shape (n_rows,).

    Raises ArmidError when the column is missing or the times do not increase.
    """
    if TIME not in table.columns:
        raise missing(table, "time column", [TIME])
    times = table.columns[TIME]
    wrong = np.flatnonzero(np.diff(times) <= 0)
    if wrong.size:
        before, row = float(times[wrong[0]]), int(wrong[0]) + 1
        found = "is there twice" if times[row] == before else f"comes after {before:.12g}"
        raise ArmidError(f"{table.file}, line {table.line_of(row)}: time_s {float(times[row]):.12g} {found}, "
                         "increasing times are expected")  # fmt: skip
    return times


def speed_column(table: Table, units: Sequence[str]) -> tuple[str, str]:
    """Return the header of the recorded speed and its SI unit; units: those that the plant can record.

    Raises ArmidError unless exactly one of the known headers is there.
    """
    found = [name for name in SPEEDS if name in table.columns]
    if len(found) > 1:
        raise ArmidError(f"{table.file}, line 1: {' and '.join(found)} are both there, exactly one speed column is "
                         "expected")  # fmt: skip
    if not found:
        raise missing(table, "speed column", [name for name, (unit, _) in SPEEDS.items() if unit in units])
    return found[0], SPEEDS[found[0]][0]


def speed_of(table: Table, header: str) -> Array:
    """Return the recorded speed, SI, shape (n_rows,)."""
    return table.columns[header] * SPEEDS[header][1]


def position_of(table: Table, unit: str) -> Array | None:
    """Return the position [m or rad] that belongs to a speed in `unit`, shape (n_rows,), None where there is none.

    Raises ArmidError when two columns tell it.
    """
    found = [name for name, (speed_unit, _) in POSITIONS.items() if speed_unit == unit and name in table.columns]
    if len(found) > 1:
        raise ArmidError(f"{table.file}, line 1: {' and '.join(found)} are both there, at most one position column is "
                         "expected")  # fmt: skip
    return table.columns[found[0]] * POSITIONS[found[0]][1] if found else None


def input_columns(plant: Plant, named: Mapping[str, str], table: Table, where: str) -> dict[str, str]:
    """Return input -> header for every input of the plant that the file holds.

    named: input -> header, as the campaign says. where: how messages name the place that says it.

    Raises ArmidError for an input that the plant does not have, a column that the file does not have, and a required
    input without a column or with two.
    """
    for name, header in named.items():
        if name not in {i.name for i in plant.inputs}:
            raise ArmidError(f"{where}: {shown(name)} in inputs is no input of plant '{plant.name}', "
                             f"{nearest(name, (i.name for i in plant.inputs))}")  # fmt: skip
        if header not in table.columns:
            raise ArmidError(f"{where}: input '{name}' names the column {shown(header)}, which {table.file} does not "
                             f"have, {nearest(header, table.columns)}")  # fmt: skip
    found = {i.name: named.get(i.name) or declared_column(i, table) for i in plant.inputs}
    return {name: header for name, header in found.items() if header is not None}


def declared_column(wanted: Input, table: Table) -> str | None:
    """Return the one header that an input is found under by itself, None where an optional one is absent."""
    found = [name for name in wanted.columns if name in table.columns]
    if len(found) > 1:
        raise ArmidError(f"{table.file}, line 1: {' and '.join(found)} are both there, one column for input "
                         f"'{wanted.name}' is expected, or its name under [records.inputs]")  # fmt: skip
    if not found and wanted.required:
        raise missing(table, f"column for input '{wanted.name}'", wanted.columns)
    return found[0] if found else None


def si_factor(header: str) -> float:
    """Return what turns an input column into SI: degrees into radians, all else taken as it is."""
    return DEGREE if header.endswith(("_deg", "_deg_s")) else 1.0


def missing(table: Table, what: str, expected: Iterable[str]) -> ArmidError:
    """Return the sentence for a column that is not there, naming a look-alike in another unit where there is one."""
    known: Sequence[str] = list(expected)
    quantities = {quantity_of(name) for name in known}
    alike = [name for name in table.columns if quantity_of(name) in quantities]
    wanted = " or ".join(known) or "a name under [records.inputs]"
    if alike:
        return ArmidError(f"{table.file}, line 1: column {shown(alike[0])} is in an unknown unit, {wanted} is expected")
    return ArmidError(f"{table.file}, line 1: no {what} among {shown(list(table.columns))}, {wanted} is expected")


def quantity_of(header: str) -> str:
    """Return the quantity of a header without its unit: `angular_velocity` of `angular_velocity_rpm`."""
    for quantity in ("angular_velocity", "velocity", "time", "drive"):
        if header == quantity or header.startswith(f"{quantity}_"):
            return quantity
    return header
