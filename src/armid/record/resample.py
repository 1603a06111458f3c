"""Even time grids out of the times of a file, and its columns on them."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError
from armid.model import Array
from armid.record.record import Irregularity, Record, RecordWarning
from armid.record.sensor import Mask

FEWEST_SAMPLES = 20
SHORTEST_INTERVAL = 1e-9
LATEST_START = 2.0
MOST_FILLING = 10
EVEN_TIMES = 1e-3
LARGE_GAP = 3.0
# A row this near to a grid sample, in intervals, is that sample.
NEAR_SAMPLE = 0.75
# Rows are off a grid by so much of an interval at most, rms, where at most so many samples for a row get them there:
# what drives the machine may change at each row.
OFF_GRID, MOST_FOR_A_ROW = 0.08, 4
NEIGHBOURS = 7
# A held input as in the rows of a file, (n_rows,), and on the grid, (n_samples,).
Held = tuple[Array, Array]


class IrregularSamplingWarning(RecordWarning):
    """Say how irregular the times of a record are that was resampled."""


@dataclass(frozen=True)
class Timing:
    """How the samples of a file come onto an even grid.

    first: row of the first sample at or after the start. earliest: first sample of the grid that was measured and is
    not before t = 0. resampled: False when the rows from `first` on are the samples of the grid. finer: samples of the
    grid for a row; most of them were not measured.
    """

    start: float
    interval: float
    n_samples: int
    first: int
    earliest: int
    resampled: bool
    irregularity: Irregularity | None
    finer: int = 1

    @property
    def widest(self) -> float:
        """How far [s] a sample of the grid may be from a row: further away is a gap."""
        return NEAR_SAMPLE * self.finer * self.interval

    def grid(self) -> Array:
        return self.start + self.interval * np.arange(self.n_samples, dtype=np.float64)


def timing_of(times: Array, from_rest: bool, file: str) -> Timing:
    """Find the even grid of a record.

    from_rest: the grid begins at t = 0 exactly (samples before are rest), else at the first sample. The interval is the
    slope of the times where they are even but for rounding and jitter, else the median interval, with a warning. Where
    the rows are too far off such a grid it is a finer one.
    """
    first = 0
    if from_rest:
        # a thousandth of an interval before t = 0 counts as 0
        slack = EVEN_TIMES * float(np.median(np.diff(times))) if times.size > 1 else 0.0
        first = int(np.searchsorted(times, -slack))
    motion, place = times[first:], "after t = 0" if from_rest else "in the record"
    check_number(motion.size, f"{file}:", place)
    interval, tolerance, even = fitted_grid(motion, file)
    begin, start = float(motion[0]), 0.0 if from_rest else float(motion[0])
    if begin - start > LATEST_START * interval:
        raise ArmidError(f"{file}: the first sample is at {begin:.6g} s, but the arm starts at t = 0: a first sample "
                         "at or before 0 is expected")  # fmt: skip
    resampled = not even or abs(begin - start) > tolerance
    finer = 1 if even else fineness(motion, start, interval)
    n_samples = grid_size(motion, start, interval, finer, file) if resampled else motion.size
    interval /= finer
    check_number(n_samples, f"{file}:", place)
    # a plant from rest may have lost its sample at t = 0; an axis may begin before 0, and what is before 0 never counts
    earliest = 0 if from_rest and first > 0 else int(np.ceil((max(begin, 0.0) - start) / interval - EVEN_TIMES))
    irregularity = None if even else irregularity_of(motion)
    if irregularity is not None:
        share, widest = irregularity.share, irregularity.largest_gap
        message = (f"{file}: irregular sampling: {share:.2%} of {motion.size - 1} intervals are off by more than 1 %, "
                   f"the largest is {widest:.3g} times the median, at t = {irregularity.at_s:.6g} s")  # fmt: skip
        message += ", a large gap that is bridged by a straight line" if widest > LARGE_GAP else ""
        warnings.warn(f"{message}; resampled evenly at {interval:.6g} s", IrregularSamplingWarning, stacklevel=2)
    return Timing(start, interval, n_samples, first, max(earliest, 0), resampled, irregularity, finer)


def fineness(times: Array, start: float, interval: float) -> int:
    """Return how many samples for a row a grid needs to hold uneven times, 4 where none does."""

    def off(parts: int) -> float:
        places = (times - start) / interval * parts
        return float(np.sqrt(np.mean((places - np.rint(places)) ** 2))) / parts

    return next((n for n in range(1, MOST_FOR_A_ROW) if off(n) <= OFF_GRID), MOST_FOR_A_ROW)


def check_number(n_samples: int, where: str, which: str) -> None:
    """Refuse fewer than 20 samples; where, which: the words around their number."""
    if n_samples < FEWEST_SAMPLES:
        raise ArmidError(f"{where} {n_samples} samples {which}, at least {FEWEST_SAMPLES} are expected")


def fitted_grid(times: Array, file: str) -> tuple[float, float, bool]:
    """Return interval [s], how far [s] even times may be off the line through them, and whether they are even."""
    index = np.arange(times.size) - 0.5 * (times.size - 1)
    middle = float(np.mean(times))
    interval = float(index @ (times - middle)) / float(index @ index)
    interval = rounded(interval, times - middle - interval * index)
    if interval < SHORTEST_INTERVAL:
        raise ArmidError(f"{file}: the samples are {interval:.3g} s apart, at least {SHORTEST_INTERVAL:g} s is "
                         "expected")  # fmt: skip
    tolerance = max(EVEN_TIMES * interval, 0.75 * printed_resolution(times, interval))
    off = float(np.max(np.abs(times - middle - interval * index)))
    even = off <= tolerance
    # where only jitter is there, each row has its own sample of the grid
    return interval if even or off < 0.5 * interval else float(np.median(np.diff(times))), tolerance, even


def rounded(interval: float, offsets: Array) -> float:
    """Return the roundest interval that the times allow: 0.001 rather than 0.00099999999999."""
    doubt = float(np.max(np.abs(offsets))) * np.sqrt(12 / offsets.size) + 1e-9 * interval
    candidates = (float(f"{interval:.{digits}g}") for digits in range(1, 16))
    return next((c for c in candidates if abs(c - interval) * offsets.size <= doubt), interval)


def printed_resolution(times: Array, interval: float) -> float:
    """Return the decimal step [s] to which the times were rounded, 0 where it cannot explain an uneven grid."""
    for decimals in range(10):
        step = 10.0**-decimals
        scaled = times / step
        if step <= interval / 3 and np.all(np.abs(scaled - np.rint(scaled)) <= 1e-6 + 1e-15 * np.abs(scaled)):
            return step
    return 0.0


def irregularity_of(times: Array) -> Irregularity | None:
    """Return how irregular times are, None where their rounding explains it."""
    intervals = np.diff(times)
    median = float(np.median(intervals))
    relative = intervals / median
    if np.max(np.abs(relative - 1)) <= EVEN_TIMES + 1.01 * printed_resolution(times, median) / median:
        return None
    widest = int(np.argmax(relative))
    return Irregularity(float(np.mean(np.abs(relative - 1) > 0.01)), float(relative[widest]), float(times[widest]))


def grid_size(times: Array, start: float, interval: float, finer: int, file: str) -> int:
    """Return the number of grid samples, the last at most half of one off; refuse a grid that is mostly gaps.

    interval: of the rows. finer: samples for a row.
    """
    length = float(times[-1]) - start
    size = length / interval
    if size > MOST_FILLING * times.size:
        raise ArmidError(f"{file}: {times.size} samples at a median interval of {interval:.3g} s leave most of "
                         f"{length:.6g} s unmeasured, a record without such gaps is expected")  # fmt: skip
    return int(finer * size + 0.5) + 1


def onto_grid(values: Array, times: Array, timing: Timing, hold: str = "linear") -> Array:
    """Return a column on the even grid, (n_samples,), from values and times, both (n_rows,).

    `hold` "linear" interpolates between rows, which never overshoots at the kinks of a record. With "zero" the column
    keeps each value until the next row; a grid sample is its mean over the interval that follows. Where the value
    changes within an interval, a part of that goes to the sample after it, so that no impulse comes late or early.
    """
    if not timing.resampled:
        return np.ascontiguousarray(values[timing.first :])
    grid = timing.grid()
    if hold != "zero":
        return np.asarray(np.interp(grid, times, values), dtype=np.float64)
    # a sample counts from a thousandth of an interval before its time on, so that rounding does not delay it
    edges = np.append(grid, grid[-1] + timing.interval) + EVEN_TIMES * timing.interval
    points = np.union1d(edges, times[(times > edges[0]) & (times < edges[-1])])
    middles, lengths = 0.5 * (points[1:] + points[:-1]), np.diff(points)
    held = values[np.maximum(np.searchsorted(times, middles, side="right") - 1, 0)]
    own = np.searchsorted(edges, middles) - 1
    mean = np.bincount(own, held * lengths) / timing.interval
    off_centre = held * lengths * (middles - 0.5 * (edges[own] + edges[own + 1]))
    # what an interval sees of one value is that value to the last digit
    changed = np.bincount(own, held != held[np.searchsorted(own, own)]) > 0
    late = np.where(changed, np.bincount(own, off_centre) / timing.interval**2, 0.0)
    own_value = held[np.searchsorted(own, np.arange(grid.size))]
    return np.asarray(np.where(changed, mean, own_value) - late + np.append(0.0, late[:-1]))


def moved_onto_grid(
    values: Array, times: Array, timing: Timing, rows: Mask, held: Sequence[Held] = ()
) -> tuple[Array, Mask]:  # fmt: skip
    """Return a noisy column on the even grid and which of its samples were measured, both (n_samples,).

    Each grid sample takes the nearest row, moved along a parabola through 7 neighbours: the noise stays that of one
    sample and white, where a line between two rows would take a third off its variance and correlate neighbours. Where
    no row of data is near, a straight line runs between those around. The part that follows a held input at once is not
    moved: it jumps where the input jumps on the grid.
    values, times, rows (which are data): (n_rows,). held: inputs, each as in the rows and on the grid.
    """
    if timing.resampled and held:
        in_rows, on_grid = (np.array(u) for u in zip(*held, strict=True))
        share = share_at_once([values[rows]], [in_rows[:, rows]])
        smooth, data = moved_onto_grid(values - share @ in_rows, times, timing, rows)
        return smooth + share @ on_grid, data
    known = values if rows.all() else np.where(rows, values, np.interp(times, times[rows], values[rows]))
    if not timing.resampled:
        return np.ascontiguousarray(known[timing.first :]), rows[timing.first :].copy()
    grid = timing.grid()
    right, nearest = around(times, grid)
    along = grid - times[nearest]
    # of a finer grid no two samples are one row
    near = NEAR_SAMPLE if timing.finer == 1 else 0.5
    data = rows[nearest] & (np.abs(along) <= near * timing.interval)
    if times.size < NEIGHBOURS:
        return onto_grid(known, times, timing), data
    slope, bend = parabolas(known, times, nearest)
    moved = known[nearest] + (slope + bend * along) * along
    apart = times[right] - times[right - 1] - timing.finer * timing.interval
    gap = np.maximum(np.abs(along), apart) > timing.widest
    return np.where(gap, np.interp(grid, times, known), moved), data


def share_at_once(signals: Sequence[Array], inputs: Sequence[Array]) -> Array:
    """Return by how much a signal changes at once with each held input, (n_inputs,), from some records.

    Least squares of y_k = b u_k + c u_(k-1) + d u_(k-2) + e y_(k-1) + f y_(k-2) + g. signals: each (n_rows,); inputs:
    of each (n_inputs, n_rows).
    """
    known = np.hstack([np.vstack([u[:, 2:], u[:, 1:-1], u[:, :-2], y[1:-1], y[:-2], np.ones(y.size - 2)])
                       for y, u in zip(signals, inputs, strict=True)])  # fmt: skip
    sizes = np.maximum(np.max(np.abs(known), axis=1), 1e-300)
    wanted = np.concatenate([y[2:] for y in signals])
    solution, *_ = np.linalg.lstsq((known / sizes[:, np.newaxis]).T, wanted, rcond=None)
    n_inputs = len(inputs[0])
    return np.asarray(solution[:n_inputs] / sizes[:n_inputs])


def gap_samples(times: Array, timing: Timing) -> Mask:
    """Return the samples of the grid without a row near by, (n_samples,)."""
    if not timing.resampled:
        return np.zeros(timing.n_samples, dtype=np.bool_)
    grid = timing.grid()
    return np.asarray(np.abs(grid - times[around(times, grid)[1]]) > timing.widest)


def around(times: Array, grid: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the row on the right of each grid sample, and the nearest one."""
    right = np.clip(np.searchsorted(times, grid), 1, times.size - 1)
    return right, np.where(grid - times[right - 1] < times[right] - grid, right - 1, right)


def parabolas(values: Array, times: Array, rows: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return slope and half the curvature at each row of the parabola through 7 neighbours, at the ends on one side."""
    n, unit = NEIGHBOURS, float(np.median(np.diff(times)))
    near = np.clip(rows - n // 2, 0, times.size - n) + np.arange(n)[:, np.newaxis]
    middle = np.sum(times[near], axis=0) / n
    t, x = (times[near] - middle) / unit, values[near]
    second, third, fourth = (np.sum(t**k, axis=0) for k in (2, 3, 4))
    straight, curved = np.sum(t * x, axis=0), np.sum((t**2 - second / n) * x, axis=0)
    bend = fourth - second**2 / n
    share = second * bend - third**2
    own = (times[rows] - middle) / unit
    b, c = (bend * straight - third * curved) / share, (second * curved - third * straight) / share
    return np.asarray((b + 2.0 * c * own) / unit), np.asarray(c / unit**2)


# Samples by which a window may miss one and still hold it.
SLACK = 1e-3


def piece_length(restart_s: float, interval: float, n_samples: int, where: str) -> int:
    length = int(min(restart_s / interval + 0.5, n_samples + 1))
    if length > n_samples:
        raise ArmidError(f"{where}: restart_s is {restart_s:g}, at most the record's {n_samples * interval:.6g} s are "
                         "expected")  # fmt: skip
    if length < FEWEST_SAMPLES:
        raise ArmidError(f"{where}: restart_s is {restart_s:g}, which holds {length} samples, at least "
                         f"{FEWEST_SAMPLES} are expected")  # fmt: skip
    return length


def with_window(record: Record, window_s: Sequence[float] | None, where: str) -> Record:
    """Return the record whose pieces show fitness and errors the samples of a window [s] only, None: from t = 0 on.

    A piece of a restarted record with fewer than 20 samples in the window is left out.
    """
    low, high = window_samples(record, window_s, where)
    for signal in record.signals:
        if is_constant(signal.measured[low:high]):
            what = "speed" if signal.unit in ("rad/s", "m/s") else signal.output
            raise ArmidError(f"{where}: the {what} of {record.file} is constant in the window, a motion is expected")
    pieces = []
    for piece in record.whole_pieces:
        begin = max(low - piece.start_index, piece.n_spent)
        end = min(high - piece.start_index, piece.manoeuvre.n_samples)
        if end - begin >= FEWEST_SAMPLES:
            pieces.append(replace(piece, window=slice(begin, end)))
    if not pieces:
        raise ArmidError(f"{where}: no piece of {record.file} has {FEWEST_SAMPLES} samples in the window, a longer "
                         "window or restart_s is expected")  # fmt: skip
    return replace(record, pieces=tuple(pieces))


def window_samples(record: Record, window_s: Sequence[float] | None, where: str) -> tuple[int, int]:
    n_samples, grid = record.measured.size, record.manoeuvre
    low, high = record.earliest, n_samples
    if window_s is not None:
        begin, end = window_s
        if not begin < end:
            raise ArmidError(f"{where}: the window is [{begin:g}, {end:g}] s, an end after its beginning is expected")
        ends = np.clip((np.array([begin, end]) - grid.start_time) / grid.interval, -1.0, n_samples)
        low = max(int(np.ceil(ends[0] - SLACK)), low)
        high = min(int(np.floor(ends[1] + SLACK)) + 1, high)
    check_number(max(high - low, 0), f"{where}: the window holds", f"of {record.file}")
    return low, high


def is_constant(speed: Array) -> bool:
    return bool(np.ptp(speed) < 1e-30)
