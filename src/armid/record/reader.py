"""One record out of its CSV file and its entry in the campaign."""

import os.path
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError, nearest, shown
from armid.model import Manoeuvre, ManoeuvreKey, Plant
from armid.record.noise import noise_of, smallest_step
from armid.record.record import Record
from armid.record.resample import (
    Timing,
    Track,
    is_constant,
    moved_onto_grid,
    onto_grid,
    part,
    piece_length,
    timing_of,
    track_of,
    with_window,
)
from armid.record.schema import KindError, RecordSheet, number
from armid.record.table import (
    LARGEST,
    POSITIONS,
    TIME,
    CsvTable,
    input_columns,
    position_of,
    read_table,
    si_factor,
    speed_column,
    time_column,
)

Array = NDArray[np.float64]
NAME, SUFFIX = "campaign.toml", ".csv"
POSITION, SPEED = "start_position", "start_speed"
ROUNDING = 1e-9
SATURATED_SAMPLES = 5


@dataclass(frozen=True)
class SharedEntries:
    """Hold what the records of a campaign have in common: constants (SI), inputs, hold, gyro range [rad/s].

    folder: what messages put before the name of a file.
    """

    folder: str
    constants: Mapping[str, float]
    inputs: Mapping[str, str]
    hold: str
    gyro_range: float | None


def read_record(path: Path, sheet: RecordSheet, plant: Plant, shared: SharedEntries, where: str) -> Record:
    """Read the record of one [[records]] entry.

    plant: the one that the campaign names; its sibling for the record's unit is taken. where: how messages name the
    entry. Warns with IrregularSamplingWarning where the file is resampled for its uneven times.

    Raises ArmidError for all that makes the record unusable.
    """
    table = read_table(path, f"{shared.folder}{sheet.file}")
    times = time_column(table)
    header, unit, speed = speed_column(table, [p.output_unit for p in (plant, *plant.variants)])
    try:
        plant = plant.for_unit(unit)
    except ArmidError as error:
        raise ArmidError(f"{table.file}, line 1: a speed in {unit} is not what is expected: {error}") from error
    timing = timing_of(times, plant.from_rest, table.file)
    check_speed(speed, timing, shared.gyro_range, unit, table)
    rest, motion = speed[: timing.first], speed[timing.first :]
    rest_interval = float(np.median(np.diff(times[: timing.first]))) if timing.first > 1 else timing.interval
    irregular = times[timing.first :] if timing.irregularity else None
    others = {name: values for name, values in table.columns.items() if name not in (TIME, header)}
    record = Record(
        file=sheet.file,
        role=sheet.role,
        unit=unit,
        manoeuvre=manoeuvre_of(plant, shared, sheet, table, timing, where=where),
        measured=moved_onto_grid(speed, times, timing),
        rest=rest,
        noise=noise_of(rest, motion, rest_interval, irregular),
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
    plant: Plant, shared: SharedEntries, sheet: RecordSheet, table: CsvTable, timing: Timing, *, where: str
) -> Manoeuvre:
    """Return the manoeuvre of a whole record, still without the measured state at its start.

    An optional input without a column has its default throughout.
    """
    constants = record_constants(plant, shared.constants, sheet, where)
    hold = sheet.hold or shared.hold
    sources = input_columns(plant, {**shared.inputs, **sheet.inputs}, table, where)
    inputs = {}
    for driven in plant.inputs:
        header = sources.get(driven.name)
        if header is None:
            inputs[driven.name] = np.full(timing.n_samples, driven.default)
        else:
            values = table.columns[header] * si_factor(header)
            inputs[driven.name] = onto_grid(values, table.columns[TIME], timing, driven.hold or hold)
    return Manoeuvre(timing.interval, timing.n_samples, constants, inputs, hold, timing.start)


def check_speed(speed: Array, timing: Timing, gyro_range: float | None, unit: str, table: CsvTable) -> None:
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


def started(record: Record, plant: Plant, tracks: Mapping[str, Track], where: str) -> Record:
    """Return the record with its pieces, each from the state that the tracks tell at its first sample.

    An incomplete last piece is dropped. Raises ArmidError for restarts of a plant that starts from rest.
    """
    manoeuvre, measured = record.manoeuvre, record.measured
    length = measured.size
    if record.restart_s is not None:
        if plant.from_rest:
            raise ArmidError(f"{where}: restart_s is given, but plant '{plant.name}' starts at rest: a record without "
                             "restarts is expected")  # fmt: skip
        length = piece_length(record.restart_s, manoeuvre.interval, measured.size, where)
    starts = range(0, measured.size - length + 1, length)
    pieces = tuple(part(manoeuvre, measured, start, length, tracks) for start in starts)
    # the first piece starts where the record does
    from_there = replace(manoeuvre, constants=pieces[0].manoeuvre.constants)
    return replace(record, manoeuvre=from_there, whole_pieces=pieces)


def tracks_of(record: Record, plant: Plant, table: CsvTable, speed: Array, timing: Timing) -> dict[str, Track]:
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


def record_constants(plant: Plant, shared: Mapping[str, float], sheet: RecordSheet, where: str) -> dict[str, float]:
    """Return the constants of a record's manoeuvre, SI: the campaign's, then its keys, then [records.constants].

    Raises ArmidError for an unknown constant, one that the record's own start sets, a missing key, a value of another
    kind or outside its range.
    """
    known = [c.name for c in plant.constants]
    for what, given in (("constants of the campaign", shared), ("constants", sheet.constants)):
        for name in given:
            if name not in known:
                raise ArmidError(f"{where}: {shown(name)} in {what} is no constant of plant '{plant.name}', "
                                 f"{nearest(name, known)}")  # fmt: skip
            if not plant.from_rest and name in (POSITION, SPEED):
                raise ArmidError(f"{where}: '{name}' in {what} is set, but it comes from the first samples of a "
                                 "record: another constant is expected")  # fmt: skip
    own = {k.constant: key_value(k, sheet.keys[k.key], where) for k in plant.keys if k.key in sheet.keys}
    constants = {**shared, **own, **sheet.constants}
    for key in plant.keys:
        check_key(key, constants, where)
    return constants


def key_value(key: ManoeuvreKey, value: object, where: str) -> float:
    """Return the constant (SI) that a key of the plant sets."""
    if key.boolean:
        if isinstance(value, bool):
            return float(value)
        raise ArmidError(f"{where}: key '{key.key}' is {shown(value)}, true or false is expected")
    try:
        return key.factor * number(value)
    except KindError as error:
        raise ArmidError(f"{where}: key '{key.key}' is {shown(value)}, a finite number is expected") from error


def check_key(key: ManoeuvreKey, constants: Mapping[str, float], where: str) -> None:
    """Refuse a manoeuvre without a required key, outside the machine's travel, or without a motion."""
    if key.constant not in constants:
        if key.required:
            raise ArmidError(f"{where}: key '{key.key}' is missing, {range_of(key)} is expected, here or as "
                             f"{key.constant} under [constants]")  # fmt: skip
        return
    value = constants[key.constant] / key.factor
    if key.unlike and constants[key.constant] == constants.get(key.unlike):
        raise ArmidError(f"{where}: {key.key} is {value:.9g}, where the record starts: a motion is expected")
    slack = ROUNDING * abs(value)
    low = key.low if key.low is not None else -LARGEST / abs(key.factor)
    high = key.high if key.high is not None else LARGEST / abs(key.factor)
    if not low - slack <= value <= high + slack or (key.boolean and value not in (0.0, 1.0)):
        raise ArmidError(f"{where}: {key.key} is {value:.9g}, {range_of(key)} is expected")


def range_of(key: ManoeuvreKey) -> str:
    if key.boolean:
        return "true or false"
    if key.low is None and key.high is None:
        return "a finite number"
    if key.low is None or key.high is None:
        return f"at most {key.high:g}" if key.low is None else f"at least {key.low:g}"
    return f"a value from {key.low:g} to {key.high:g}"


def campaign_path(path: str | Path) -> Path:
    """Return the campaign.toml that a folder or a file stands for; refuse with ArmidError where there is none."""
    if not os.path.exists(path):
        raise ArmidError(f"campaign {shown(str(path))} does not exist, a folder with a {NAME} is expected")
    if os.path.isfile(path):
        return Path(path)
    if not os.path.isfile(os.path.join(path, NAME)):
        raise ArmidError(f"campaign {shown(str(path))} holds no {NAME}, a folder with one is expected")
    return Path(path) / NAME


def record_path(folder: Path, file: str, where: str) -> Path:
    """Return where the file of a record is.

    Raises ArmidError for a name that leads out of the folder (also through a link), is no CSV file, or does not exist.
    """
    pure = PurePosixPath(file.replace("\\", "/"))
    if pure.is_absolute() or PureWindowsPath(file).drive or ".." in pure.parts:
        raise ArmidError(f"{where}: file {shown(file)} leads out of the campaign's folder, a file inside is expected")
    if pure.suffix.lower() != SUFFIX or not file.isprintable():
        raise ArmidError(f"{where}: file {shown(file)} is no CSV file, a name that ends in {SUFFIX} is expected")
    path = os.path.join(folder, file)
    if not os.path.isfile(path):
        there = sorted(p.name for p in folder.glob(f"*{SUFFIX}"))
        raise ArmidError(f"{where}: file {shown(file)} does not exist, {nearest(file, there)}")
    real = Path(os.path.realpath(path))
    if not real.is_relative_to(os.path.realpath(folder)):
        raise ArmidError(f"{where}: file {shown(file)} links out of the campaign's folder, a file inside is expected")
    return real
