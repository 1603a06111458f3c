"""One measured column of a file: which of its rows are data, what its sensor and its noise are, its turns."""

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError
from armid.model import Array
from armid.record.record import RecordWarning, Signal
from armid.record.resample import FEWEST_SAMPLES, Timing, gap_samples, is_constant, moved_onto_grid
from armid.record.sensor import (
    FEWEST_REST_SAMPLES,
    Broken,
    Mask,
    Noise,
    after_sudden,
    difference_rms,
    in_runs,
    lengths_of_rest,
    noise_of,
    renewed,
    repeated_samples,
    rest_between,
    sensor_of,
    wild_samples,
)
from armid.record.table import CsvTable

TURN_ROUNDING = 1e-6
# Samples of the grid without a row near by that make a gap: fewer are a lost sample or jitter of the clock.
BRIDGED = 2
# An output without a number in more than this share of the rows is not a measurement of the record.
MOST_EMPTY = 0.5
BROKEN_WORDS = {"clipped": "are at the limit of the sensor", "stuck": "are repeated while the signal leaps",
         "spikes": "are far from their neighbours"}  # fmt: skip
# Share of a turn that an angle which wraps spans at least.
SPANNED = 0.75
# End of the header of an angle -> values at which it wraps to 0.
WRAPS = {"rad": (2.0 * np.pi,), "deg": (360.0,), "turns": (1.0,), "counts": (2.0**16, 2.0**32)}


def signal_of(
    table: CsvTable, header: str, unit: str, factor: float, times: Array, timing: Timing, inputs: Sequence[Array],
    unwrap: bool, most_lost: float, output: str,
) -> tuple[Signal, Array]:  # fmt: skip
    """Return the signal of a column of a file, and the column, SI, (n_rows,); warn of what of it is not data.

    factor: to the SI unit, NaN for counts. inputs: the columns that drive the machine, (n_rows,) each. unwrap: whether
    whole turns are taken out. most_lost: share of the samples that may be no data. output: whose signal it is, which
    has to show a motion.
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
    check_number(table, header, rows, timing)
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
    check_number(table, header, rows, timing)
    measured, data = moved_onto_grid(values, times, timing, rows)
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
        before = self.times[: self.n_rest]
        self.interval = float(np.median(np.diff(before))) if before.size > 1 else timing.interval

    def since(self, counted: Array) -> Mask:
        """Return whether a count over all rows has grown since the row of data before, (n,)."""
        return np.asarray(np.diff(counted[self.at], prepend=counted[0]) > 0)


def rest_and_noise(new: New, inputs: Sequence[Array], is_speed: bool) -> tuple[Array, Noise]:
    """Return the samples at rest, before the motion or between motions, and the noise that they or the motion tell."""
    noise = noise_of(new.rest, new.motion, new.interval, new.uneven)
    if new.rest.size >= FEWEST_REST_SAMPLES or not inputs:
        return new.rest, noise
    changes = sum((np.append(0, np.cumsum(np.diff(x) != 0.0)) for x in inputs), np.zeros(inputs[0].size))
    n_still = max(lengths_of_rest(inputs), default=0)
    still = ~new.since(changes)[new.n_rest :] | (new.at[new.n_rest :] < n_still)
    rest = rest_between(new.motion, still, is_speed)
    # equal values tell the step of the sensor alone, which the motion tells as well
    if not rest.size or np.ptp(rest) == 0.0:
        return new.rest, noise
    noise = noise_of(rest, new.motion, new.interval, new.uneven)
    return (rest - np.mean(rest), noise) if noise.source == "rest" else (new.rest, noise)


def warn(table: CsvTable, said: str) -> None:
    warnings.warn(f"{table.file}: {said}", RecordWarning, stacklevel=2)


def check_empty(table: CsvTable, header: str, present: Mask) -> None:
    empty = np.flatnonzero(~present)
    if empty.size:
        fault = f"{header} has no number in {empty.size} of {present.size} rows, the first on line "
        fault += str(table.line_of(int(empty[0])))
        if empty.size > MOST_EMPTY * present.size:
            raise ArmidError(f"{table.file}: {fault}, at most half of the rows without one are expected")
        warn(table, f"{fault}: these are no data")


def check_number(table: CsvTable, header: str, rows: Mask, timing: Timing) -> None:
    n = int(rows[timing.first :].sum())
    if n < FEWEST_SAMPLES:
        raise ArmidError(f"{table.file}: {header} has {n} samples that are data in the motion, at least "
                         f"{FEWEST_SAMPLES} are expected")  # fmt: skip


def lost(table: CsvTable, header: str, kind: str, at: NDArray[np.intp], times: Array) -> Broken:
    line = table.line_of(int(at[0]))
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
                         f"most of them {BROKEN_WORDS[worst.kind]}: at most {most:.0%} are expected, in a new "
                         "recording or with another most_lost of the record")  # fmt: skip


def gaps(times: Array, timing: Timing) -> list[Broken]:
    """Return the gaps between rows that are bridged by two samples of the grid or more."""
    at = timing.grid()[in_runs(gap_samples(times, timing), BRIDGED)]
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
        line = table.line_of(int(rows[turns != 0.0][0]))
        warn(table, f"{header} wraps at {turn:.6g}, {int(np.sum(turns != 0.0))} times, the first on line {line}: "
                    "unwrap = true in campaign.toml takes the turns out")  # fmt: skip
        return raw
    # of a motion the steps change little from row to row, but where they pass half a turn
    fast = np.flatnonzero(np.abs(np.diff(change - turn * turns)) > 0.5 * turn)
    if fast.size:
        line = table.line_of(int(rows[fast[0] + 1]))
        raise ArmidError(f"{table.file}, line {line}: {header} moves by half a turn or more from row to row, so that "
                         "its turns cannot be counted: faster sampling is expected")  # fmt: skip
    unwrapped = raw.copy()
    unwrapped[present] = raw[present] - turn * np.append(0.0, np.cumsum(turns))
    return unwrapped
