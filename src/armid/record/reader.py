"""One record out of its CSV file and its entry in the campaign."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armid.model import ArmidError, Manoeuvre, Plant
from armid.record.columns import (
    POSITIONS,
    TIME,
    input_columns,
    position_of,
    si_factor,
    speed_column,
    speed_of,
    time_column,
)
from armid.record.constants import record_constants
from armid.record.grid import moved_onto_grid, onto_grid
from armid.record.noise import noise_of, smallest_step
from armid.record.pieces import is_constant, part, piece_length, restarted, with_window
from armid.record.record import Piece, Record
from armid.record.schema import RecordSheet
from armid.record.start import POSITION, SPEED, Track, track_of
from armid.record.table import Table, read_table
from armid.record.timing import Timing, timing_of

Array = NDArray[np.float64]
SATURATED_SAMPLES = 5


@dataclass(frozen=True)
class Shared:
    """Hold what the records of a campaign have in common: constants (SI), inputs, hold, gyro range [rad/s].

    folder: what messages put before the name of a file.
    """

    folder: str
    constants: Mapping[str, float]
    inputs: Mapping[str, str]
    hold: str
    gyro_range: float | None


def read_record(path: Path, sheet: RecordSheet, plant: Plant, shared: Shared, where: str) -> Record:
    """Read the record of one [[records]] entry.

    plant: the one that the campaign names; its sibling for the record's unit is taken. where: how messages name the
    entry. Warns with IrregularSamplingWarning where the file is resampled for its uneven times.

    Raises ArmidError for all that makes the record unusable.
    """
    table = read_table(path, f"{shared.folder}{sheet.file}")
    times = time_column(table)
    header, unit = speed_column(table, [p.output_unit for p in (plant, *plant.variants)])
    plant, speed = sibling(plant, unit, table), speed_of(table, header)
    timing = timing_of(times, plant.from_rest, table.file)
    check_speed(speed, timing, shared.gyro_range, unit, table)
    irregular = times[timing.first :] if timing.irregularity else None
    others = {name: values for name, values in table.columns.items() if name not in (TIME, header)}
    record = Record(
        file=sheet.file,
        role=sheet.role,
        unit=unit,
        manoeuvre=manoeuvre_of(plant, shared, sheet, table, timing, where=where),
        measured=moved_onto_grid(speed, times, timing),
        rest=speed[: timing.first],
        noise=noise_of(speed[: timing.first], speed[timing.first :], rest_interval(times, timing), irregular),
        pieces=(),
        whole_pieces=(),
        earliest=timing.earliest,
        columns={name: onto_grid(values, times, timing) for name, values in others.items()},
        repeat_of=sheet.repeat_of or "",
        restart_s=sheet.restart_s,
        irregularity=timing.irregularity,
    )
    tracks = {} if plant.from_rest else tracks_of(record, plant, table, speed, timing)
    return with_window(started(record, plant, tracks, where), sheet.window_s, where)


def manoeuvre_of(
    plant: Plant, shared: Shared, sheet: RecordSheet, table: Table, timing: Timing, *, where: str
) -> Manoeuvre:
    """Return the manoeuvre of a whole record, still without the measured state at its start."""
    constants = record_constants(plant, shared.constants, sheet, where)
    hold = sheet.hold or shared.hold
    sources = input_columns(plant, {**shared.inputs, **sheet.inputs}, table, where)
    inputs = inputs_of(plant, sources, table, timing, hold)
    return Manoeuvre(timing.interval, timing.n_samples, constants, inputs, hold, timing.start)


def rest_interval(times: Array, timing: Timing) -> float:
    """Return the interval between the samples of rest [s]."""
    return float(np.median(np.diff(times[: timing.first]))) if timing.first > 1 else timing.interval


def sibling(plant: Plant, unit: str, table: Table) -> Plant:
    """Return the plant whose recorded signal has the unit of the file."""
    try:
        return plant.for_unit(unit)
    except ArmidError as error:
        raise ArmidError(f"{table.file}, line 1: a speed in {unit} is not what is expected: {error}") from error


def check_speed(speed: Array, timing: Timing, gyro_range: float | None, unit: str, table: Table) -> None:
    """Refuse a signal that shows no motion, or is cut off by the range of the gyro.

    speed: SI, (n_rows,). Saturated are 5 samples in a row within one quantisation step of the range; the step is the
    smallest change between neighbours, but at most a hundredth of the range.
    """
    if is_constant(speed[timing.first :]):
        raise ArmidError(f"{table.file}: the measured speed is constant after the start, a motion is expected")
    if gyro_range is None:
        return
    if unit != "rad/s":
        raise ArmidError(f"{table.file}: gyro_range_deg_s is given, but the speed is in {unit}: a speed in deg/s or "
                         "rad/s is expected")  # fmt: skip
    step = min(smallest_step(speed), gyro_range / 100)
    # the slack keeps a value that is one step below the range inside, whatever its last binary digit
    near = np.abs(speed) >= gyro_range - step * (1 + 1e-6)
    runs = np.convolve(near, np.ones(SATURATED_SAMPLES), mode="valid")
    saturated = np.flatnonzero(runs > SATURATED_SAMPLES - 0.5)
    if saturated.size:
        row = int(saturated[0])
        raise ArmidError(f"{table.file}, line {table.line_of(row)}: {SATURATED_SAMPLES} samples in a row are at the "
                         f"gyro range of {np.rad2deg(gyro_range):.6g} deg/s (saturated), a motion within it is "
                         "expected")  # fmt: skip


def inputs_of(plant: Plant, sources: Mapping[str, str], table: Table, timing: Timing, hold: str) -> dict[str, Array]:
    """Return input -> values on the grid, SI; an optional input without a column has its default throughout."""
    values = {}
    for driven in plant.inputs:
        header = sources.get(driven.name)
        if header is None:
            values[driven.name] = np.full(timing.n_samples, driven.default)
            continue
        column = table.columns[header] * si_factor(header)
        values[driven.name] = onto_grid(column, table.columns[TIME], timing, driven.hold or hold)
    return values


def started(record: Record, plant: Plant, tracks: Mapping[str, Track], where: str) -> Record:
    """Return the record with its pieces, each from the state that the tracks tell at its first sample.

    Raises ArmidError for restarts of a plant that starts from rest.
    """
    manoeuvre, measured = record.manoeuvre, record.measured
    if plant.from_rest and record.restart_s is not None:
        raise ArmidError(f"{where}: restart_s is given, but plant '{plant.name}' starts at rest: a record without "
                         "restarts is expected")  # fmt: skip
    if record.restart_s is None:
        pieces: tuple[Piece, ...] = (part(manoeuvre, measured, 0, measured.size, tracks),)
    else:
        length = piece_length(record.restart_s, manoeuvre.interval, measured.size, where)
        pieces = restarted(manoeuvre, measured, tracks, length)
    # the first piece starts where the record does
    from_there = replace(manoeuvre, constants=pieces[0].manoeuvre.constants)
    return replace(record, manoeuvre=from_there, whole_pieces=pieces)


def tracks_of(record: Record, plant: Plant, table: Table, speed: Array, timing: Timing) -> dict[str, Track]:
    """Return the signals from which the start constants that the plant declares are taken.

    speed: as in the file, SI, (n_rows,).

    Raises ArmidError where a position is needed and the file has none. An axis without gravity needs none: it starts at
    its default.
    """
    declared = {c.name for c in plant.constants}
    position, times = position_of(table, record.unit), table.columns[TIME]
    tracks = {SPEED: track_of(speed, times, timing)} if SPEED in declared else {}
    if POSITION in declared and position is not None:
        tracks[POSITION] = track_of(position, times, timing)
    elif POSITION in declared and ("gravity_moment" not in declared or gravity_of(plant, record.constants) != 0):
        why = "gravity_moment is not 0" if "gravity_moment" in declared else f"plant '{plant.name}' declares it"
        headers = " or ".join(name for name, (unit, _) in POSITIONS.items() if unit == record.unit)
        raise ArmidError(f"{table.file}, line 1: the start needs a position, as {why}: a column {headers} is expected")
    return tracks


def gravity_of(plant: Plant, constants: Mapping[str, float]) -> float:
    """Return the moment of gravity, 0 for a plant that has none."""
    declared = {c.name: c.value for c in plant.constants}
    return constants.get("gravity_moment", declared.get("gravity_moment", 0.0))
