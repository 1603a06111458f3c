"""One record out of its table and its entry in the campaign: its measured columns, its start, its constants."""

import os.path
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError, nearest, quoted
from armid.model import Array, Manoeuvre, ManoeuvreKey, Plant
from armid.record.record import Piece, Record, RecordWarning, Signal
from armid.record.resample import (
    Held,
    Timing,
    check_number,
    gap_samples,
    is_constant,
    moved_onto_grid,
    onto_grid,
    piece_length,
    timing_of,
    with_window,
)
from armid.record.schema import CampaignSheet, KindError, RecordSheet, number
from armid.record.sensor import (
    FEWEST_REST_SAMPLES,
    Broken,
    InputNoise,
    Mask,
    Noise,
    after_sudden,
    difference_rms,
    in_runs,
    length_of_rest,
    noise_of,
    noise_of_input,
    renewed,
    repeated_samples,
    rest_between,
    sensor_of,
    wild_samples,
)
from armid.record.start import State, Track, n_spent, state_at, state_shown, track_of
from armid.record.table import (
    LARGEST_CELL,
    POSITIONS,
    TIME_HEADER,
    CsvTable,
    input_columns,
    output_columns,
    position_of,
    time_column,
)
from armid.units import DEGREE, SUFFIXES

CAMPAIGN_FILE, CSV_SUFFIX = "campaign.toml", ".csv"
POSITION, START_SPEED = "start_position", "start_speed"
KEY_ROUNDING = 1e-9
SATURATED_SAMPLES = 5
TURN_ROUNDING = 1e-6
# Samples of the grid without a row near by that make a gap: fewer are a lost sample or jitter of the clock.
BRIDGED = 2
# An output without a number in more than this share of the rows is not a measurement of the record.
MOST_EMPTY = 0.5
BROKEN_WORDS = {"clipped": "are at the limit of the sensor", "stuck": "are repeated while the signal leaps",
         "spikes": "are far from their neighbours"}  # fmt: skip
DATA_IN_MOTION = "that are data in the motion"
# Share of a turn that an angle which wraps spans at least.
SPANNED = 0.75
# End of the header of an angle -> values at which it wraps to 0.
WRAPS = {"rad": (2.0 * np.pi,), "deg": (360.0,), "turns": (1.0,), "counts": (2.0**16, 2.0**32)}


def record_of(table: CsvTable, sheet: RecordSheet, campaign: CampaignSheet, plant: Plant, where: str) -> Record:
    """Return the record of one [[records]] entry and its table, with a signal for each output that it holds.

    plant: the one that the campaign names; its sibling for the record's unit is taken. Warns with RecordWarning of what
    is not data, of uneven times with IrregularSamplingWarning.
    """
    times = time_column(table)
    plant, outputs = output_columns(table, plant)
    timing = timing_of(times, plant.from_rest, table.file)
    sources, hold = input_columns(plant, {**campaign.inputs, **sheet.inputs}, table, where), sheet.hold or campaign.hold
    driven = {i.name: table.numbers(sources[i.name]) * input_factor(sources[i.name], i.unit, table)
              for i in plant.inputs if i.name in sources}  # fmt: skip
    most_lost = campaign.most_lost if sheet.most_lost is None else sheet.most_lost
    inputs = {i.name: onto_grid(driven[i.name], times, timing, i.hold or hold) if i.name in driven
              else np.full(timing.n_samples, i.default) for i in plant.inputs}  # fmt: skip
    held = [(driven[i.name], inputs[i.name]) for i in plant.inputs if i.name in driven and (i.hold or hold) == "zero"]
    read = partial(signal_of, table, times, timing, list(driven.values()), held, campaign.unwrap, most_lost)
    measured = [read(header, o.factors[header], o.unit, o.name) for o, header in outputs.items()]
    if campaign.gyro_range_deg_s is not None:
        check_range(measured, campaign.gyro_range_deg_s, table)
    others = {name: values for name, values in table.columns.items() if name not in (TIME_HEADER, *outputs.values())}
    columns = {name: onto_grid(values, times, timing) for name, values in others.items() if np.isfinite(values).all()}
    constants = record_constants(plant, campaign.constants, sheet, where)
    noises = {name: noise_of_input(u, [(y, s.is_speed) for s, y in measured]).on_finer_grid(timing.finer)
              for name, u in driven.items()}  # fmt: skip
    record = Record(
        file=sheet.file,
        role=sheet.role,
        manoeuvre=Manoeuvre(timing.interval, timing.n_samples, constants, inputs, hold, timing.start),
        signals=tuple(signal for signal, _ in measured),
        pieces=(),
        whole_pieces=(),
        earliest=timing.earliest,
        columns=columns,
        unused=tuple(name for name in others if name not in {*sources.values(), *POSITIONS}),
        repeat_of=sheet.repeat_of or "",
        restart_s=sheet.restart_s,
        irregularity=timing.irregularity,
        input_noise={name: noise for name, noise in noises.items() if noise != InputNoise()},
    )
    tracks = {} if plant.from_rest else tracks_of(record, plant, table, read)
    return with_window(started(record, plant, tracks, where), sheet.window_s, f"{where}, window_s")


def signal_of(
    table: CsvTable, times: Array, timing: Timing, inputs: Sequence[Array], held: Sequence[Held], unwrap: bool,
    most_lost: float, header: str, factor: float, unit: str, output: str = "",
) -> tuple[Signal, Array]:  # fmt: skip
    """Return the signal of a column of a file, and the column, SI, (n_rows,); warn of what of it is not data.

    inputs: the columns that drive the machine, (n_rows,) each; held: those that keep each value, also on the grid.
    unwrap: whether whole turns are taken out. most_lost: share of the samples that may be no data. factor: to the SI
    unit, NaN for counts. output: whose signal it is, which has to show a motion; "" for one that serves a start alone.
    Raises ArmidError for a column with too few numbers or too many that are no data.
    """
    raw, is_speed = table.numbers(header, gaps=True), unit in ("rad/s", "m/s")
    present = np.isfinite(raw)
    check_empty(table, header, present)
    values = without_turns(table, header, raw, unwrap) * table.factor(header, factor)
    sensor = sensor_of(values[present])
    rows = present.copy()
    rows[present] = renewed(values[present], sensor.hold)
    if sensor.hold > 1:
        warn(table, f"{header} is renewed every {sensor.hold} rows: one sample of each renewal counts")
    check_number(int(rows[timing.first :].sum()), f"{table.file}: {header} has", DATA_IN_MOTION)
    n_new = int(rows.sum())
    jumps = np.cumsum(np.any([after_sudden(x) for x in inputs], axis=0)) if inputs else np.zeros(values.size)
    new = New(values, rows, times, timing)
    wild = wild_samples(new.values, max(difference_rms(new.motion, new.uneven), sensor.rounding))
    broken = {"spikes": new.at[wild & ~new.since(jumps)]}
    rows[broken["spikes"]] = False
    new = New(values, rows, times, timing)
    rest, noise = rest_and_noise(new, inputs, is_speed)
    if not is_constant(new.motion):
        repeated = repeated_samples(new.values, noise.rms, noise.source == "rest", sensor, new.since(jumps))
        broken |= {kind: new.at[mask] for kind, mask in repeated.items()}
    rows[np.concatenate([*broken.values()])] = False
    faults = [lost(table, header, kind, at, times) for kind, at in broken.items() if at.size]
    check_lost(table, header, faults, n_new, most_lost)
    check_number(int(rows[timing.first :].sum()), f"{table.file}: {header} has", DATA_IN_MOTION)
    measured, data = moved_onto_grid(values, times, timing, rows, held)
    if output and is_constant(values[timing.first :][rows[timing.first :]]):
        what = "speed" if is_speed else output
        raise ArmidError(f"{table.file}: the measured {what} is constant after the start, a motion is expected")
    return Signal(output, unit, measured, rest, noise, None if data.all() else data, sensor,
                  (*gaps(times, timing), *faults), header), values  # fmt: skip


class New:
    """The rows of a column that are data. at: their numbers; uneven: times of the motion [s], None where even."""

    def __init__(self, values: Array, rows: Mask, times: Array, timing: Timing) -> None:
        self.at = np.flatnonzero(rows)
        self.values, self.times = values[self.at], times[self.at]
        self.n_rest = int(np.searchsorted(self.at, timing.first))
        self.rest, self.motion = self.values[: self.n_rest], self.values[self.n_rest :]
        apart = np.diff(self.at[self.n_rest :])
        even = timing.irregularity is None and apart.size > 0 and apart.min() == apart.max()
        self.uneven = None if even else self.times[self.n_rest :]

    def since(self, counted: Array) -> Mask:
        """Return whether a count over all rows has grown since the row of data before, (n,)."""
        return np.asarray(np.diff(counted[self.at], prepend=counted[0]) > 0)


def rest_and_noise(new: New, inputs: Sequence[Array], is_speed: bool) -> tuple[Array, Noise]:
    """Return the samples at rest, before the motion or between motions, and the noise that they or the motion tell."""
    noise = noise_of(new.rest, new.motion, new.uneven)
    if new.rest.size >= FEWEST_REST_SAMPLES or not inputs:
        return new.rest, noise
    changes = sum((np.append(0, np.cumsum(np.diff(x) != 0.0)) for x in inputs), np.zeros(inputs[0].size))
    n_still = length_of_rest(inputs)
    still = ~new.since(changes)[new.n_rest :] | (new.at[new.n_rest :] < n_still)
    rest = rest_between(new.motion, still, is_speed)
    # equal values tell the step of the sensor alone, which the motion tells as well
    if not rest.size or np.ptp(rest) == 0.0:
        return new.rest, noise
    noise = noise_of(rest, new.motion, new.uneven)
    return (rest - np.mean(rest), noise) if noise.source == "rest" else (new.rest, noise)


def warn(table: CsvTable, sentence: str) -> None:
    warnings.warn(f"{table.file}: {sentence}", RecordWarning, stacklevel=2)


def check_empty(table: CsvTable, header: str, present: Mask) -> None:
    empty = np.flatnonzero(~present)
    if empty.size:
        fault = f"{header} has no number in {empty.size} of {present.size} rows, the first on line "
        fault += str(table.lines[int(empty[0])])
        if empty.size > MOST_EMPTY * present.size:
            raise ArmidError(f"{table.file}: {fault}, at most half of the rows without one are expected")
        warn(table, f"{fault}: these are no data")


def lost(table: CsvTable, header: str, kind: str, at: NDArray[np.intp], times: Array) -> Broken:
    line = table.lines[int(at[0])]
    if kind == "spikes":
        more = f", and {at.size - 1} more" if at.size > 1 else ""
        value = float(table.columns[header][at[0]])
        warn(table, f"{header} is {value:g} on line {line}, far from its neighbours: that sample is not data{more}")
    return Broken(kind, at.size, float(times[at[0]]), float(times[at[-1]]), line)


def check_lost(table: CsvTable, header: str, faults: Sequence[Broken], n_new: int, most: float) -> None:
    n = sum(fault.count for fault in faults)
    if n > most * n_new:
        worst = max(faults, key=lambda fault: fault.count)
        raise ArmidError(f"{table.file}, line {worst.line}: {n / n_new:.1%} of the samples of {header} are no data, "
                         f"most of them {BROKEN_WORDS[worst.kind]}: at most {most:.0%} are expected, under its own "
                         "header (a held input looks so under that of a sensor), in a new recording, or with another "
                         "most_lost of the record")  # fmt: skip


def gaps(times: Array, timing: Timing) -> list[Broken]:
    """Return the gaps between rows that are bridged by two samples of the grid or more."""
    at = timing.grid()[in_runs(gap_samples(times, timing), BRIDGED * timing.finer)]
    return [Broken("gap", at.size, float(at[0]), float(at[-1]))] if at.size else []


def wraps_at(values: Array, header: str) -> float:
    """Return the turn by which an angle jumps where it leaves the range of one turn, 0 where it does not."""
    known = values[np.isfinite(values)]
    largest, span = float(np.max(np.abs(np.diff(known)), initial=0.0)), float(np.ptp(known)) if known.size else 0.0
    unit = next((u for u in WRAPS if header.endswith(f"_{u}")), "")
    fits = (t for t in WRAPS.get(unit, ()) if largest > 0.5 * t and SPANNED * t < span <= t * (1.0 + TURN_ROUNDING))
    return next(fits, 0.0)


def without_turns(table: CsvTable, header: str, raw: Array, unwrap: bool) -> Array:
    """Return an angle without its jumps by a whole turn where that is asked for, else say that it has some."""
    turn = wraps_at(raw, header)
    if turn == 0.0:
        return raw
    present = np.isfinite(raw)
    rows, change = np.flatnonzero(present)[1:], np.diff(raw[present])
    turns = np.rint(change / turn)
    if not unwrap:
        line = table.lines[int(rows[turns != 0.0][0])]
        warn(table, f"{header} wraps at {turn:.6g}, {int(np.sum(turns != 0.0))} times, the first on line {line}: "
                    "unwrap = true in campaign.toml takes the turns out")  # fmt: skip
        return raw
    # of a motion the steps change little from row to row, but where they pass half a turn
    fast = np.flatnonzero(np.abs(np.diff(change - turn * turns)) > 0.5 * turn)
    if fast.size:
        line = table.lines[int(rows[fast[0] + 1])]
        raise ArmidError(f"{table.file}, line {line}: {header} moves by half a turn or more from row to row, so that "
                         "its turns cannot be counted: faster sampling is expected")  # fmt: skip
    unwrapped = raw.copy()
    unwrapped[present] = raw[present] - turn * np.append(0.0, np.cumsum(turns))
    return unwrapped


def input_factor(header: str, unit: str, table: CsvTable) -> float:
    """Return what turns the column of an input into SI: a column without an end of its unit is taken as it is."""
    if header.endswith(("_deg", "_deg_s")):
        return DEGREE
    ends = SUFFIXES.get(unit, {})
    return table.factor(header, next((factor for end, factor in ends.items() if header.endswith(f"_{end}")), 1.0))


def check_range(measured: Sequence[tuple[Signal, Array]], range_deg_s: float, table: CsvTable) -> None:
    """Refuse a speed that is cut off by the range of the gyro.

    Saturated are 5 samples in a row within one step of the sensor of the range, but at most a hundredth of it.
    """
    speed, values = next(((s, values) for s, values in measured if s.unit == "rad/s"), measured[0])
    if speed.unit != "rad/s":
        raise ArmidError(f"{table.file}: gyro_range_deg_s is given, but the speed is in {speed.unit}: a speed in deg/s "
                         "or rad/s is expected")  # fmt: skip
    gyro_range = range_deg_s * DEGREE
    step = min(speed.sensor.step, gyro_range / 100)
    # the slack keeps a value that is one step below the range inside, whatever its last binary digit
    near = np.abs(values) >= gyro_range - step * (1 + 1e-6)
    saturated = np.flatnonzero(in_runs(near, SATURATED_SAMPLES))
    if saturated.size:
        row = int(saturated[0])
        raise ArmidError(f"{table.file}, line {table.lines[row]}: {SATURATED_SAMPLES} samples in a row are at the "
                         f"gyro range of {np.rad2deg(gyro_range):.6g} deg/s (saturated), a motion within it is "
                         "expected")  # fmt: skip


def started(record: Record, plant: Plant, tracks: Mapping[str, Track], where: str) -> Record:
    """Return the record with its pieces, each from the state that the tracks tell at its first sample.

    An incomplete last piece is dropped.
    """
    manoeuvre, length = record.manoeuvre, record.measured.size
    asked = plant.start_constants
    given = [] if plant.records_one_speed else sorted(set(asked.values()) & set(manoeuvre.constants))
    if record.restart_s is not None:
        if plant.from_rest:
            raise ArmidError(f"{where}: restart_s is given, but plant '{plant.name}' starts at rest: a record without "
                             "restarts is expected")  # fmt: skip
        if given:
            raise ArmidError(f"{where}: restart_s and the constant {given[0]} are both given: the start of one piece "
                             "or of each is expected")  # fmt: skip
        length = piece_length(record.restart_s, manoeuvre.interval, record.measured.size, where)
    fitted, trained = len(asked) > len(given), record.role == "train"
    spent = 0 if trained or not fitted or plant.records_one_speed else n_spent(length, manoeuvre.interval)
    pieces: list[Piece] = []
    for start in range(0, record.measured.size - length + 1, length):
        state: State = {}, {}
        if plant.records_one_speed:
            state = state_at(tracks, start)
        elif fitted:
            cut = slice(start, start + spent) if spent else slice(None)
            near = {name: replace(t, values=t.values[cut]) for name, t in tracks.items()}
            inputs = [u[start:] for u in manoeuvre.inputs.values()]
            state = state_shown(plant, manoeuvre.constants, near, manoeuvre.interval, 0 if spent else start, inputs)
        part, shown = manoeuvre.part(start, length, state[0]), state[0] if fitted and trained else {}
        pieces.append(Piece(part, slice(0, length), start, state[1], spent, shown))
    # the first piece starts where the record does
    from_there = replace(manoeuvre, constants=pieces[0].manoeuvre.constants)
    return replace(record, manoeuvre=from_there, whole_pieces=tuple(pieces))


def tracks_of(
    record: Record, plant: Plant, table: CsvTable, read: Callable[[str, float, str], tuple[Signal, Array]]
) -> dict[str, Track]:
    """Return the signals from which a start is taken: of a plant that records one speed by constant, else by output.

    read: `signal_of` for a column of the file.
    """
    if not plant.records_one_speed:
        return {signal.output: track_of(signal) for signal in record.signals}
    (speed,) = record.signals
    declared = {c.name for c in plant.constants}
    header = position_of(table, record.unit)
    tracks = {START_SPEED: track_of(speed)} if START_SPEED in declared else {}
    if POSITION in declared and header is not None:
        unit = "rad" if record.unit == "rad/s" else "m"
        tracks[POSITION] = track_of(read(header, POSITIONS[header][1], unit)[0])
    elif POSITION in declared and ("gravity_moment" not in declared or gravity_of(plant, record.constants) != 0):
        why = "gravity_moment is not 0" if "gravity_moment" in declared else f"plant '{plant.name}' declares it"
        headers = " or ".join(name for name, (unit, _) in POSITIONS.items() if unit == record.unit)
        raise ArmidError(f"{table.where}: the start needs a position, as {why}: a column {headers} is expected")
    return tracks


def gravity_of(plant: Plant, constants: Mapping[str, float]) -> float:
    declared = {c.name: c.value for c in plant.constants}
    return constants.get("gravity_moment", declared.get("gravity_moment", 0.0))


def record_constants(plant: Plant, shared: Mapping[str, float], sheet: RecordSheet, where: str) -> dict[str, float]:
    """Return the constants of a record's manoeuvre, SI: the campaign's, then its keys, then [records.constants]."""
    known = [c.name for c in plant.constants]
    for what, given in (("constants of the campaign", shared), ("constants", sheet.constants)):
        for name in given:
            if name not in known:
                is_parameter = any(name == parameter.name for parameter in plant.parameters)
                kind = "a parameter" if is_parameter else "no constant"
                hint = f"[parameters.{name}] with fixed = VALUE is expected" if is_parameter else nearest(name, known)
                raise ArmidError(f"{where}: {quoted(name)} in {what} is {kind} of plant '{plant.name}', {hint}")
            if not plant.from_rest and plant.records_one_speed and name in (POSITION, START_SPEED):
                raise ArmidError(f"{where}: '{name}' in {what} is set, but it comes from the first samples of a "
                                 "record: another constant is expected")  # fmt: skip
    own = {k.constant: key_value(k, sheet.keys[k.key], where) for k in plant.keys if k.key in sheet.keys}
    constants = {**shared, **own, **sheet.constants}
    for declared in plant.constants:
        value = constants.get(declared.name, declared.value)
        if not declared.low <= value <= declared.high:
            raise ArmidError(f"{where}: constant '{declared.name}' is {value:.9g} {declared.unit}, a value from "
                             f"{declared.low:g} to {declared.high:g} is physically possible and expected")  # fmt: skip
    for key in plant.keys:
        check_key(key, constants, where)
    return constants


def key_value(key: ManoeuvreKey, value: object, where: str) -> float:
    if key.boolean:
        if isinstance(value, bool):
            return float(value)
        raise ArmidError(f"{where}: key '{key.key}' is {quoted(value)}, true or false is expected")
    try:
        return float(key.factor * number(value))
    except KindError as error:
        raise ArmidError(f"{where}: key '{key.key}' is {quoted(value)}, a finite number is expected") from error


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
    slack = KEY_ROUNDING * abs(value)
    low = key.low if key.low is not None else -LARGEST_CELL / abs(key.factor)
    high = key.high if key.high is not None else LARGEST_CELL / abs(key.factor)
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
    if not os.path.exists(path):
        raise ArmidError(f"campaign {quoted(str(path))} does not exist, a folder with a {CAMPAIGN_FILE} is expected")
    if os.path.isfile(path):
        if Path(path).suffix.lower() == CSV_SUFFIX:
            raise ArmidError(
                f"campaign {quoted(str(path))} is a record, the folder with its {CAMPAIGN_FILE} is expected"
            )
        return Path(path)
    if not os.path.isfile(os.path.join(path, CAMPAIGN_FILE)):
        raise ArmidError(f"campaign {quoted(str(path))} holds no {CAMPAIGN_FILE}, a folder with one is expected")
    return Path(path) / CAMPAIGN_FILE


def record_path(folder: Path, file: str, where: str, named: Collection[str] = ()) -> Path:
    """Return where a record is; named: the files of all records, which a message does not propose in its place."""
    pure = PurePosixPath(file.replace("\\", "/"))
    if pure.is_absolute() or PureWindowsPath(file).drive or ".." in pure.parts:
        raise ArmidError(f"{where}: file {quoted(file)} leads out of the campaign's folder, a file inside is expected")
    if pure.suffix.lower() != CSV_SUFFIX or not file.isprintable():
        raise ArmidError(
            f"{where}: file {quoted(file)} is not a CSV file, a name that ends in {CSV_SUFFIX} is expected"
        )
    path = os.path.join(folder, file)
    if not os.path.isfile(path):
        files = sorted(p.name for p in folder.glob(f"*{CSV_SUFFIX}") if p.is_file() and p.name not in named)
        if os.path.lexists(path):
            raise ArmidError(f"{where}: file {quoted(file)} does not exist: a folder or a dead link has that name, a "
                             "CSV file is expected")  # fmt: skip
        hint = nearest(file, files) if files else "and no CSV file of that folder is left that no record names"
        raise ArmidError(f"{where}: file {quoted(file)} does not exist, {hint}")
    real = Path(os.path.realpath(path))
    if not real.is_relative_to(os.path.realpath(folder)):
        raise ArmidError(f"{where}: file {quoted(file)} links out of the campaign's folder, a file inside is expected")
    return real
