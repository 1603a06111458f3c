"""Columns of a file on the even grid of its record."""

import numpy as np
from numpy.typing import NDArray

from armid.record.timing import EVEN, Timing

Array = NDArray[np.float64]
# A row this near to a grid sample, in intervals, stands for it.
NEAR = 0.75
NEIGHBOURS = 7


def onto_grid(values: Array, times: Array, timing: Timing, hold: str = "linear") -> Array:
    """Return a column on the even grid, shape (n_samples,), from values and times, both (n_rows,).

    Samples that are on the grid are kept. Else between samples: a straight line, whose error is interval^2/8 times the
    curvature and which never overshoots at the kinks of a record; `hold` "zero": what the column, holding each value
    until the next, is on average over the interval that a grid sample begins, so that no impulse comes late.
    """
    if not timing.resampled:
        return np.ascontiguousarray(values[timing.first :])
    grid = timing.start + timing.interval * np.arange(timing.n_samples, dtype=np.float64)
    if hold == "zero":
        return held(values, times, grid, timing.interval)
    return np.asarray(np.interp(grid, times, values), dtype=np.float64)


def moved_onto_grid(values: Array, times: Array, timing: Timing) -> Array:
    """Return a noisy column on the even grid, shape (n_samples,), from values and times, both (n_rows,).

    Each grid sample takes the nearest row, moved along the slope of a parabola through 7 neighbours: the noise
    stays that of one sample and white, where a line between two rows would take a third off its variance and correlate
    neighbours. Where no row is near, a straight line bridges the gap.
    """
    if not timing.resampled or times.size < NEIGHBOURS:
        return onto_grid(values, times, timing)
    grid = timing.start + timing.interval * np.arange(timing.n_samples, dtype=np.float64)
    right = np.clip(np.searchsorted(times, grid), 1, times.size - 1)
    nearest = np.where(grid - times[right - 1] < times[right] - grid, right - 1, right)
    along = grid - times[nearest]
    moved = values[nearest] + slopes(values, times, nearest) * along
    gap = np.maximum(np.abs(along), times[right] - times[right - 1] - timing.interval) > NEAR * timing.interval
    return np.where(gap, np.interp(grid, times, values), moved)


def slopes(values: Array, times: Array, rows: NDArray[np.int64]) -> Array:
    """Return the slope at each row of the least-squares parabola through 7 neighbours, those at the ends beside it.

    v = a + b t + c t^2 with t from the neighbours' mean time; returns b + 2 c t of the row.
    """
    first, n = np.clip(rows - NEIGHBOURS // 2, 0, times.size - NEIGHBOURS), NEIGHBOURS
    unit = float(np.median(np.diff(times)))
    middle = sum((times[first + i] for i in range(n)), np.zeros(rows.size)) / n
    places = [(times[first + i] - middle) / unit for i in range(n)]
    second, third, fourth = (sum((t**k for t in places), np.zeros(rows.size)) for k in (2, 3, 4))
    straight, curved = np.zeros(rows.size), np.zeros(rows.size)
    for i, t in enumerate(places):
        straight += t * values[first + i]
        curved += (t**2 - second / n) * values[first + i]
    bend = fourth - second**2 / n
    share = second * bend - third**2
    own = (times[rows] - middle) / unit
    b, c = (bend * straight - third * curved) / share, (second * curved - third * straight) / share
    return np.asarray((b + 2.0 * c * own) / unit)


def held(values: Array, times: Array, grid: Array, interval: float) -> Array:
    """Return the mean over each interval of an even grid of a column that holds its values, shape (n_samples,)."""
    # a sample counts from a thousandth of an interval before its time on, so that rounding does not delay it
    edges = np.append(grid, grid[-1] + interval) + EVEN * interval
    rows = np.maximum(np.searchsorted(times, edges, side="right") - 1, 0)
    first, last = rows[:-1], rows[1:]
    impulse = np.append(0.0, np.cumsum(values[:-1] * np.diff(times)))
    at_edges = impulse[rows] + values[rows] * (edges - times[rows])
    changes = np.append(0, np.cumsum(np.diff(values) != 0))
    return np.where(changes[first] == changes[last], values[first], np.diff(at_edges) / interval)
