"""What the headers of a record mean: quantity and unit.

A header is a quantity and its unit, `angular_velocity_deg_s`; the factor turns the column into SI.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from armid.model import ArmidError, Input, Plant, nearest
from armid.record.shown import shown
from armid.record.table import Table

Array = NDArray[np.float64]
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
