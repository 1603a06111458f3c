"""CSV files of numbers under one header line, and what the headers of a record mean.

numpy's reader is used, not that of pandas: it is as strict as the format (pandas fills short rows and takes words for
missing numbers), and a program that reads records of some thousand samples need not import pandas. A file that it does
not read is looked at cell by cell (dialect.py).
A header is a quantity and its unit, `angular_velocity_deg_s`; a factor turns the column into SI.
"""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from armid.errors import ArmidError, nearest, quoted
from armid.model import Array, Input, Output, Plant
from armid.model.plant import SPEEDS
from armid.record.dialect import COMMENTS, Cells, cells_of, check_names, clocks_of, columns_of, text_of
from armid.record.record import RecordWarning
from armid.units import SUFFIXES, TURN

if TYPE_CHECKING:
    from pandas import DataFrame

LARGEST_CELL = 1e30
LONGEST_HEADER = 1 << 16
TIME_HEADER = "time_s"
KNOWN_QUANTITIES = ("angular_velocity", "velocity", "time", "drive", "angle", "position")
FURTHER = ("_rpm", "_turns", "_turns_s", "_counts", "_counts_s", "_m_min", "_cm", "_cm_s", "_km_h", "_mA", "_mV", "_kV",
           "_kN", "_mN_m", "_kN_m")  # fmt: skip
# header of a position -> unit of the speed that it belongs to, factor; counts: see `CsvTable.factor`
POSITIONS = {f"position_{end}": ("m/s", factor) for end, factor in SUFFIXES["m"].items()}
POSITIONS |= {f"angle_{end}": ("rad/s", factor) for end, factor in SUFFIXES["rad"].items()}


@dataclass(frozen=True, eq=False)
class CsvTable:
    """The columns of one file.

    file: name to show. lines: of the file, counted from 1, on which the rows and the header stand. columns: header ->
    values, (n_rows,), NaN where a cell is empty. texts: of the columns that hold text, header -> its line, and what it
    is and what is expected. clocks: of those that hold times of day, header -> seconds after the first row, (n_rows,).
    counts_per_turn: of the encoder, None where it is not known.
    """

    file: str
    lines: Sequence[int]
    header_line: int = 1
    counts_per_turn: float | None = None
    columns: dict[str, Array] = field(default_factory=dict)
    texts: dict[str, tuple[int, str]] = field(default_factory=dict)
    clocks: dict[str, Array] = field(default_factory=dict)

    @property
    def where(self) -> str:
        return f"{self.file}, line {self.header_line}"

    @property
    def headers(self) -> tuple[str, ...]:
        return (*self.columns, *self.texts)

    def numbers(self, header: str, gaps: bool = False) -> Array:
        """Return a column, (n_rows,); refuse one with a cell that is not a number; gaps: but for empty ones, NaN."""
        if header in self.texts:
            line, text = self.texts[header]
            raise ArmidError(f"{self.file}, line {line}: {header} is {text} is expected")
        values = self.columns[header]
        empty = np.flatnonzero(np.isnan(values))
        if empty.size and not gaps:
            raise ArmidError(f"{self.file}, line {self.lines[int(empty[0])]}: {header} has no number there, as in "
                             f"{empty.size} of {values.size} rows, a finite number in each is expected")  # fmt: skip
        return values

    def times(self, header: str) -> Array:
        """Return a column of times, (n_rows,): its numbers, or times of day as seconds after the first row."""
        return self.clocks[header] if header in self.clocks else self.numbers(header)

    def factor(self, header: str, factor: float) -> float:
        """Return what turns a column into SI; of counts the turn of the encoder decides."""
        if not np.isnan(factor):
            return factor
        if self.counts_per_turn is None:
            raise ArmidError(f"{self.where}: {header} is in counts, counts_per_turn of the encoder is expected in "
                             "campaign.toml")  # fmt: skip
        return TURN / self.counts_per_turn

    def only_one_of(self, headers: Sequence[str], expected: str) -> str | None:
        """Return the one header that was found, None without any; refuse several with ArmidError."""
        if len(headers) > 1:
            raise ArmidError(f"{self.where}: {' and '.join(headers)} are both there, {expected}")
        return headers[0] if headers else None


def read_table(path: Path, file: str, counts_per_turn: float | None = None) -> CsvTable:
    """Read a CSV file: one header line, then numbers separated by commas; empty lines are skipped.

    Files that are written in another way are read where that is certain, with a RecordWarning that says how.
    """
    try:
        text, wide = text_of(path, file)
    except OSError as error:
        raise ArmidError(f"{file} cannot be read: {error.strerror or error}") from error
    if len(text.partition("\n")[0]) > LONGEST_HEADER:
        raise ArmidError(f"{file}, line 1: the header has more than {LONGEST_HEADER} characters, a shorter one is "
                         "expected")  # fmt: skip
    if not text.strip():
        check_names([], 1, file)
    plain = None if wide else plain_columns(text)
    if plain is not None:
        names, values = plain
        check_names(names, 1, file)
        lines: Sequence[int] = range(2, len(values) + 2)
        if "\n\n" in text:  # empty lines hold no row
            lines = [number for number, line in enumerate(text.split("\n"), start=1) if number > 1 and line]
        plain_ones = zip(names, map(np.ascontiguousarray, values.T), strict=True)
        return filled(CsvTable(file, lines, 1, counts_per_turn), plain_ones)
    cells = cells_of(text, wide, file)
    if cells.assumed:
        warnings.warn(f"{file}: read with {', '.join(cells.assumed)}", RecordWarning, stacklevel=2)
    table = CsvTable(file, cells.lines, cells.header_line, counts_per_turn)
    table.clocks.update(clocks_of(cells) if cells.rows else {})
    return filled(table, columns_of(cells) if cells.rows else ())


def table_of(frame: "DataFrame", file: str, counts_per_turn: float | None = None) -> CsvTable:
    """Return a table of pandas as if it were read from the CSV file that holds its columns."""
    names, lines = [str(name).strip() for name in frame.columns], tuple(range(2, len(frame) + 2))
    check_names(names, 1, file)
    table = CsvTable(file, lines, 1, counts_per_turn)
    if not lines:
        return filled(table, ())
    columns: list[tuple[str, Array | tuple[int, str]]] = []
    for name, (_, column) in zip(names, frame.items(), strict=True):
        if column.dtype in ("float64", "int64"):
            columns.append((name, column.to_numpy(dtype=np.float64)))
        else:
            cells = ["" if empty else str(cell).strip() for cell, empty in zip(column, column.isna(), strict=True)]
            read = Cells((name,), tuple((cell,) for cell in cells), lines, 1, ())
            columns += columns_of(read)
            table.clocks.update(clocks_of(read))
    return filled(table, columns)


def filled(table: CsvTable, columns: Iterable[tuple[str, Array | tuple[int, str]]]) -> CsvTable:
    """Return a table with columns: numbers, or line and text of a cell that holds text. Refuse one without columns."""
    for name, values in columns:
        if isinstance(values, tuple):
            table.texts[name] = values[0], f"{quoted(values[1])}, a finite number"
            continue
        beyond = np.flatnonzero(np.abs(values) > LARGEST_CELL)
        if beyond.size:
            row = int(beyond[0])
            expected = f"a number within +-{LARGEST_CELL:g}" if np.isfinite(values[row]) else "a finite number"
            table.texts[name] = table.lines[row], f"{values[row]:g}, {expected}"
        else:
            table.columns[name] = values
    if not table.headers:
        raise ArmidError(f"{table.file} holds no samples: rows of numbers are expected below the header")
    return table


def plain_columns(text: str) -> tuple[list[str], Array] | None:
    """Return names and numbers, (n_rows, n_columns), of a file with commas, points and one header; None of another."""
    header, _, below = text.partition("\n")
    names = [name.strip().strip('"').strip() for name in header.split(",")]
    if header.startswith(COMMENTS) or (len(names) == 1 and any(separator in names[0] for separator in ";\t")):
        return None
    try:
        with warnings.catch_warnings():
            # of a file without rows, which the caller reports
            warnings.filterwarnings("ignore", message=".*input contained no data", category=UserWarning)
            values: Array = np.loadtxt(StringIO(below), delimiter=",", comments=None, ndmin=2)
    except ValueError:
        return None
    return (names, values) if values.size and values.shape[1] == len(names) else None


def write_table(path: Path, columns: Mapping[str, Array]) -> None:
    """Write columns of equal length as CSV, each number as the shortest text that reads back to the same bits."""
    rows = zip(*(np.asarray(values, dtype=np.float64).tolist() for values in columns.values()), strict=True)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(columns) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)


def time_column(table: CsvTable) -> Array:
    """Return the times [s], (n_rows,); refuse a missing column, and times that do not increase, with ArmidError."""
    if TIME_HEADER not in table.headers:
        raise missing(table, "time column", [TIME_HEADER])
    times = table.times(TIME_HEADER)
    if TIME_HEADER in table.clocks:
        warnings.warn(f"{table.file}: time_s holds times of day, which are read as seconds after the first row",
                      RecordWarning, stacklevel=2)  # fmt: skip
    wrong = np.flatnonzero(np.diff(times) <= 0)
    if wrong.size:
        before, row = float(times[wrong[0]]), int(wrong[0]) + 1
        fault = "is there twice" if times[row] == before else f"comes after {before:.12g}"
        raise ArmidError(f"{table.file}, line {table.lines[row]}: time_s {float(times[row]):.12g} {fault}"
                         f"{why_back(table, times, row)}, increasing times are expected")  # fmt: skip
    return times


# Units of counters of time [s], and their bits.
TICKS, BITS = (1e-9, 1e-6, 1e-3, 1.0), (16, 32)


def why_back(table: CsvTable, times: Array, row: int) -> str:
    """Return the likely cause of a time that is no later than the one before, in words."""
    rows = np.array(list(table.columns.values()))
    step = float(times[row] - times[row - 1])
    usual = float(np.median(np.diff(times)))
    if step == 0.0:
        if np.array_equal(rows[:, row], rows[:, row - 1], equal_nan=True):
            n = int(np.sum(np.all(rows[:, 1:] == rows[:, :-1], axis=0)))
            return f" with all its row ({n} such rows, which drop_duplicates of pandas removes)"
        return " with other values (a clock too coarse for the sampling, or two files merged)"
    for bits in BITS:
        for tick in TICKS:
            if usual > 0.0 and abs(step + 2.0**bits * tick - usual) < 0.5 * usual + tick:
                return f" (a counter of {bits} bits that wraps, {2.0**bits * tick:.6g} s: add that from there on)"
    return " (the clock was set back, or a second recording begins there)"


def output_columns(table: CsvTable, plant: Plant) -> tuple[Plant, dict[Output, str]]:
    """Return the plant, of several for one speed that of its unit, and its outputs in a file, each with its header."""
    if plant.records_one_speed:
        return speed_column(table, plant)
    columns = {o: [c for c in o.factors if c in table.headers] for o in plant.outputs}
    headers = {o: table.only_one_of(c, f"one column of {o.name} is expected") for o, c in columns.items()}
    known = {o: header for o, header in headers.items() if header is not None}
    if not known:
        raise missing(table, "output", [c for o in plant.outputs for c in o.factors])
    for output in plant.outputs:
        alike = [h for h in table.headers
                 if h not in known.values() and (h == output.name or h.startswith(f"{output.name}_"))]  # fmt: skip
        if output not in known and alike:
            wanted, more = usual_and_rarer([*output.factors])
            warnings.warn(f"{table.file}: column {quoted(alike[0])} is not read as output '{output.name}', "
                          f"{wanted}{more} is expected", RecordWarning, stacklevel=2)  # fmt: skip
    return plant, known


def speed_column(table: CsvTable, plant: Plant) -> tuple[Plant, dict[Output, str]]:
    """Return the sibling of a plant for the unit of the recorded speed, and the header of its output."""
    units_of = {c: unit for unit, (_, columns) in SPEEDS.items() for c in columns}
    header = table.only_one_of([c for c in units_of if c in table.headers], "exactly one speed column is expected")
    if header is None:
        units = [p.output_unit for p in (plant, *plant.variants)]
        raise missing(table, "speed column", [c for c, unit in units_of.items() if unit in units])
    try:
        sibling = plant.for_unit(units_of[header])
    except ArmidError as error:
        raise ArmidError(f"{table.where}: a speed in {units_of[header]} is not what is expected: "
                         f"{error}") from error  # fmt: skip
    return sibling, {sibling.outputs[0]: header}


def position_of(table: CsvTable, unit: str) -> str | None:
    """Return the header of the position that belongs to a speed in `unit`, None where there is none."""
    headers = [name for name in table.headers if name in POSITIONS and POSITIONS[name][0] == unit]
    return table.only_one_of(headers, "at most one position column is expected")


def input_columns(plant: Plant, named: Mapping[str, str], table: CsvTable, where: str) -> dict[str, str]:
    """Return input -> header for every input of the plant that the file holds.

    named: input -> header, as the campaign says. where: how messages name the place that says it.
    """
    for name, header in named.items():
        if name not in {i.name for i in plant.inputs}:
            raise ArmidError(f"{where}: {quoted(name)} in inputs is not an input of plant '{plant.name}', "
                             f"{nearest(name, (i.name for i in plant.inputs))}")  # fmt: skip
        if header not in table.headers:
            raise ArmidError(f"{where}: input '{name}' names the column {quoted(header)}, which {table.file} does not "
                             f"have, {nearest(header, table.headers)}")  # fmt: skip
    columns = dict(named)
    for wanted in plant.inputs:
        if wanted.name not in named:
            expected = f"one column for input '{wanted.name}' is expected, or its name under [records.inputs]"
            known = [name for name in wanted.columns if name in table.headers]
            known = known or [name for name in in_other_units(wanted) if name in table.headers]
            column = table.only_one_of(known, expected)
            if column is not None:
                columns[wanted.name] = column
            elif wanted.required:
                taken = {TIME_HEADER, *POSITIONS, *columns.values(), *(c for o in plant.outputs for c in o.factors)}
                unit = "" if wanted.unit in ("", "1") else f" (numbers in {wanted.unit})"
                spare = [f"{wanted.name} = {quoted(h)}{unit} under [inputs] of campaign.toml"
                         for h in table.headers if h not in taken]  # fmt: skip
                raise missing(table, f"column for input '{wanted.name}'", [*wanted.columns, *spare[:1]])
    return columns


def in_other_units(wanted: Input) -> list[str]:
    """Return the usual headers of an input with another end, such as voltage_mV for voltage_V."""
    ends = [f"_{end}" for end in SUFFIXES.get(wanted.unit, {})]
    stems = [name.removesuffix(end) for name in wanted.columns for end in ends if name.endswith(end)]
    return [stem + end for stem in dict.fromkeys(stems) for end in ends]


def usual_and_rarer(expected: Sequence[str]) -> tuple[str, str]:
    """Return the headers that are expected, in words, and the other units of them: all would be too long to read."""
    rarer = [max((e for e in FURTHER if name.endswith(e)), key=len)[1:] for name in expected if name.endswith(FURTHER)]
    usual = [name for name in expected if not name.endswith(FURTHER)] or expected
    return " or ".join(usual), f" (or in {', '.join(dict.fromkeys(rarer))})" if rarer else ""


def missing(table: CsvTable, what: str, expected: Sequence[str]) -> ArmidError:
    def quantity_of(header: str) -> str:
        return next((q for q in KNOWN_QUANTITIES if header == q or header.startswith(f"{q}_")), header)

    wanted, more = usual_and_rarer(expected)
    quantities = {quantity_of(name) for name in expected}
    alike = [name for name in table.headers if quantity_of(name) in quantities]
    wanted = wanted or "a name under [records.inputs]"
    if alike:
        return ArmidError(f"{table.where}: column {quoted(alike[0])} is in an unknown unit, {wanted}{more} is expected")
    return ArmidError(f"{table.where}: no {what} among {quoted(list(table.headers))}, {wanted} is expected")
