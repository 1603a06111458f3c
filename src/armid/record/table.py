"""CSV files of numbers under one header line, and what the headers of a record mean.

numpy's reader is used, not that of pandas: it is as strict as the format (pandas fills short rows and takes words for
missing numbers), and a program that reads records of some thousand samples need not import pandas.
A header is a quantity and its unit, `angular_velocity_deg_s`; a factor turns the column into SI.
"""

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armid.errors import ArmidError, nearest, quoted
from armid.model import Array, Output, Plant
from armid.model.plant import SPEEDS
from armid.units import DEGREE

LARGEST = 1e30
LONGEST_HEADER = 1 << 16
NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)
TIME = "time_s"
# header of a position -> unit of the speed that it belongs to, factor
QUANTITIES = ("angular_velocity", "velocity", "time", "drive")
POSITIONS = {"position_m": ("m/s", 1.0), "angle_rad": ("rad/s", 1.0), "angle_deg": ("rad/s", DEGREE)}


@dataclass(frozen=True, eq=False)
class CsvTable:
    """The columns of one file; file: name to show; columns: header -> values, (n_rows,), all finite."""

    file: str
    path: Path
    columns: dict[str, Array]

    def line_of(self, row: int) -> int:
        """Return the line of the file, counted from 1, on which a row of numbers stands."""
        filled = (number for number, line in lines_of(self.path) if number > 1 and line)
        return next(number for i, number in enumerate(filled) if i == row)

    def only_one_of(self, found: Sequence[str], expected: str) -> str | None:
        """Return the one header that was found, None without any; refuse several with ArmidError."""
        if len(found) > 1:
            raise ArmidError(f"{self.file}, line 1: {' and '.join(found)} are both there, {expected}")
        return found[0] if found else None


def read_table(path: Path, file: str) -> CsvTable:
    """Read a CSV file: one header line, then numbers separated by commas; empty lines are skipped."""
    try:
        with path.open(encoding="utf-8-sig") as lines:
            header = lines.readline(LONGEST_HEADER + 1)
        if len(header) > LONGEST_HEADER:
            raise ArmidError(f"{file}, line 1: the header has more than {LONGEST_HEADER} characters, a shorter one is "
                             "expected")  # fmt: skip
        with warnings.catch_warnings():
            # of a file without rows; said below in a sentence of our own
            warnings.filterwarnings("ignore", message=".*input contained no data", category=UserWarning)
            values: Array = np.loadtxt(path, delimiter=",", comments=None, skiprows=1, ndmin=2, encoding="utf-8-sig")
    except ArmidError:
        raise
    except OSError as error:
        raise ArmidError(f"{file} cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise wrong_line(path, file, error) from error
    names = column_names(header, file)
    if values.shape[0] == 0:
        raise ArmidError(f"{file} holds no samples: rows of numbers are expected below the header")
    table = CsvTable(file, path, {})
    if values.shape[1] != len(names):
        raise ArmidError(f"{file}, line {table.line_of(0)}: {values.shape[1]} values in a row, {len(names)} are "
                         f"expected as in the header")  # fmt: skip
    too_large = ~(np.abs(values) <= LARGEST)
    if too_large.any():
        row, column = (int(i) for i in np.argwhere(too_large)[0])
        value = float(values[row, column])
        expected = f"a number within +-{LARGEST:g}" if np.isfinite(value) else "a finite number"
        raise ArmidError(f"{file}, line {table.line_of(row)}: {names[column]} is {value:g}, {expected} is expected")
    table.columns.update({name: np.ascontiguousarray(column) for name, column in zip(names, values.T, strict=True)})
    return table


def write_table(path: Path, columns: Mapping[str, Array]) -> None:
    """Write columns of equal length as CSV, each number as the shortest text that reads back to the same bits."""
    rows = zip(*(np.asarray(values, dtype=np.float64).tolist() for values in columns.values()), strict=True)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(columns) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)


def column_names(header: str, file: str) -> list[str]:
    """Return the names in a header; refuse one that is repeated, unnamed, or separated by anything but commas."""
    if not header.strip():
        raise ArmidError(f"{file}, line 1: the file is empty there, a header such as "
                         "'time_s,angular_velocity_deg_s' is expected")  # fmt: skip
    names = [name.strip().strip('"').strip() for name in header.split(",")]
    if len(names) == 1 and any(separator in names[0] for separator in ";\t "):
        raise ArmidError(f"{file}, line 1: one column {quoted(names[0])} is there, columns separated by commas are "
                         "expected")  # fmt: skip
    if all(NUMBER.fullmatch(name) for name in names):
        raise ArmidError(f"{file}, line 1: numbers are there, and no header: a line of names such as "
                         "'time_s,angular_velocity_deg_s' is expected above them")  # fmt: skip
    for i, name in enumerate(names):
        if not name or not name.isprintable():
            raise ArmidError(f"{file}, line 1: column {i + 1} is called {quoted(name)}, a readable name is expected")
        if name in names[:i]:
            raise ArmidError(f"{file}, line 1: column {quoted(name)} is there twice, each name once is expected")
    return names


def wrong_line(path: Path, file: str, error: ValueError) -> ArmidError:
    """Return the sentence for a file that is no table of numbers: the first line that is wrong, and why."""
    names: list[str] = []
    for number, line in lines_of(path):
        where = f"{file}, line {number}"
        try:
            text = line.decode("utf-8-sig" if number == 1 else "utf-8")
        except UnicodeDecodeError:
            return ArmidError(f"{where}: not readable as text, a CSV file in UTF-8 is expected")
        fields = text.split(",")
        if number == 1:
            names = column_names(text, file)
        elif text and len(fields) != len(names):
            return ArmidError(f"{where}: {len(fields)} values in a row, {len(names)} are expected as in the header")
        elif text:
            for name, value in zip(names, fields, strict=True):
                if not NUMBER.fullmatch(value):
                    return ArmidError(f"{where}: {name} is {quoted(value.strip())}, a finite number is expected")
    return ArmidError(f"{file} cannot be read as a table of numbers: {quoted(str(error))}")


def lines_of(path: Path) -> Iterator[tuple[int, bytes]]:
    with path.open(encoding="latin-1") as lines:
        for number, line in enumerate(lines, start=1):
            yield number, line.rstrip("\n").encode("latin-1")


def time_column(table: CsvTable) -> Array:
    """Return the times [s], (n_rows,); refuse a missing column, and times that do not increase, with ArmidError."""
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


def output_columns(table: CsvTable, plant: Plant) -> tuple[Plant, dict[Output, str]]:
    """Return the plant, of several for one speed that of its unit, and its outputs in a file, each with its header."""
    if plant.records_one_speed:
        return speed_column(table, plant)
    columns = {o: [c for c in o.factors if c in table.columns] for o in plant.outputs}
    headers = {o: table.only_one_of(c, f"one column of {o.name} is expected") for o, c in columns.items()}
    known = {o: header for o, header in headers.items() if header is not None}
    if not known:
        raise missing(table, "output", [c for o in plant.outputs for c in o.factors])
    return plant, known


def speed_column(table: CsvTable, plant: Plant) -> tuple[Plant, dict[Output, str]]:
    """Return the sibling of a plant for the unit of the recorded speed, and the header of its output."""
    units_of = {c: unit for unit, (_, columns) in SPEEDS.items() for c in columns}
    header = table.only_one_of([c for c in units_of if c in table.columns], "exactly one speed column is expected")
    if header is None:
        units = [p.output_unit for p in (plant, *plant.variants)]
        raise missing(table, "speed column", [c for c, unit in units_of.items() if unit in units])
    try:
        sibling = plant.for_unit(units_of[header])
    except ArmidError as error:
        raise ArmidError(f"{table.file}, line 1: a speed in {units_of[header]} is not what is expected: "
                         f"{error}") from error  # fmt: skip
    return sibling, {sibling.outputs[0]: header}


def position_of(table: CsvTable, unit: str) -> Array | None:
    """Return the position [m or rad] that belongs to a speed in `unit`, (n_rows,), None where there is none."""
    found = [name for name, (speed_unit, _) in POSITIONS.items() if speed_unit == unit and name in table.columns]
    header = table.only_one_of(found, "at most one position column is expected")
    return None if header is None else table.columns[header] * POSITIONS[header][1]


def input_columns(plant: Plant, named: Mapping[str, str], table: CsvTable, where: str) -> dict[str, str]:
    """Return input -> header for every input of the plant that the file holds.

    named: input -> header, as the campaign says. where: how messages name the place that says it.
    """
    for name, header in named.items():
        if name not in {i.name for i in plant.inputs}:
            raise ArmidError(f"{where}: {quoted(name)} in inputs is no input of plant '{plant.name}', "
                             f"{nearest(name, (i.name for i in plant.inputs))}")  # fmt: skip
        if header not in table.columns:
            raise ArmidError(f"{where}: input '{name}' names the column {quoted(header)}, which {table.file} does not "
                             f"have, {nearest(header, table.columns)}")  # fmt: skip
    found = dict(named)
    for wanted in plant.inputs:
        if wanted.name not in named:
            expected = f"one column for input '{wanted.name}' is expected, or its name under [records.inputs]"
            column = table.only_one_of([name for name in wanted.columns if name in table.columns], expected)
            if column is not None:
                found[wanted.name] = column
            elif wanted.required:
                raise missing(table, f"column for input '{wanted.name}'", wanted.columns)
    return found


def missing(table: CsvTable, what: str, expected: Sequence[str]) -> ArmidError:
    def quantity_of(header: str) -> str:
        return next((q for q in QUANTITIES if header == q or header.startswith(f"{q}_")), header)

    quantities = {quantity_of(name) for name in expected}
    alike = [name for name in table.columns if quantity_of(name) in quantities]
    wanted = " or ".join(expected) or "a name under [records.inputs]"
    if alike:
        return ArmidError(
            f"{table.file}, line 1: column {quoted(alike[0])} is in an unknown unit, {wanted} is expected"
        )
    return ArmidError(f"{table.file}, line 1: no {what} among {quoted(list(table.columns))}, {wanted} is expected")
