"""Samples of a record that are no data, whatever the model says: clipped stretches, a sensor that froze, wild samples.

They are looked for in the rows that bring a new value, as they were read: on an even grid a straight line between two
rows makes values that no sensor gave.
"""

import math
from dataclasses import dataclass

import numpy as np

from armid.model import Array
from armid.record.sensor import Mask, Sensor

# So many equal values in a row are no chance where the noise exceeds half a step of the sensor.
REPEATED = 8
# Chance of one longer run of equal values in a record of a sound sensor; a larger one loses samples of an encoder.
CHANCE = 0.001
# A sample that is so many times the noise away from the median of its four neighbours, this many times what nearly all
# samples of the record are, and so many times what the closest three of the neighbours span: a step spans them.
ABOVE_NOISE, ABOVE_OTHERS, USUAL, ABOVE_SPAN = 10.0, 6.0, 0.95, 3.0
# Of the first and last samples, which have neighbours on one side, so much of the range of the signal as well: filters
# leave small errors there.
AT_ENDS = 0.1
# An input that changes in one sample by so many times what it usually does, and by so much of its range, makes a signal
# jump too (a current, say); so many samples from there on are no wild ones.
SUDDEN, SUDDEN_SHARE, AFTER_SUDDEN = 6.0, 0.05, 4
# A sensor that froze is left behind by so many times what nearly all samples change.
LEAP = 2.0
# A signal that runs into the limit of its sensor gets there at no less than this share of its usual rate, over so many
# samples, and leaves it so: a machine that ends at rest or at an even speed slows down before.
ABRUPT, RUN_UP = 0.2, 4


@dataclass(frozen=True)
class Broken:
    """Samples of one kind: "gap", "clipped", "stuck" or "spikes".

    count: of the rows of the file, or of the grid samples in a gap; from_s, to_s: first and last [s]; line: of the file
    on which the first stands, 0 for a gap.
    """

    kind: str
    count: int
    from_s: float
    to_s: float
    line: int = 0


def repeated_samples(values: Array, noise: float, known: bool, sensor: Sensor, sudden: Mask) -> dict[str, Mask]:
    """Return which values are at the limit of the sensor, and which a frozen one repeats, kind -> (n_rows,).

    Equal values are natural for a sensor whose step hides its noise. A rest shows whether it does; where none was
    recorded, motion may pass for noise, and friction or an even speed for a fault. Then values at a limit are those
    that are reached abruptly, and values of a frozen sensor those that are left by a leap.
    values: those that are new, (n_rows,). noise: rms [their unit]; known: from a rest. sudden: where an input has just
    jumped, (n_rows,).
    """
    clipped, stuck = np.zeros((2, values.size), dtype=np.bool_)
    if noise <= 0.5 * sensor.step or values.size <= RUN_UP:
        return {"clipped": clipped, "stuck": stuck}
    usual = float(np.sqrt(np.mean((values[RUN_UP:] - values[:-RUN_UP]) ** 2)))
    leap = max(ABOVE_NOISE * noise, LEAP * float(np.quantile(np.abs(np.diff(values)), USUAL)))
    repeated = runs(values)
    for limit in (float(values.max()), float(values.min())):
        stretches = visits(values, limit) if abs(limit) > sensor.step else []
        longest = max((end - begin for begin, end in repeated if values[begin] == limit), default=0)
        # noise leaves a limit for some samples where the signal reaches it; a frozen sensor has one run
        in_noise = known and int(np.sum(values == limit)) > longest
        if longest and any(in_noise or is_abrupt(values, *stretch, ABRUPT * usual) for stretch in stretches):
            clipped |= values == limit
    by_chance = longest_by_chance(noise, sensor.step, values.size)
    for begin, end in repeated:
        if end - begin <= by_chance:
            continue
        last = min(end, values.size - 1)
        away = abs(float(values[last] - values[begin]))
        left_behind = known or (away > leap and not sudden[last])
        # many sensors show a standstill without noise, and a machine may start at once
        stuck[begin:end] = abs(values[begin]) > sensor.step and left_behind
    return {"clipped": clipped, "stuck": stuck & ~clipped}


def longest_by_chance(noise: float, step: float, n: int) -> float:
    """Return the longest run of equal values that noise leaves within one step of the sensor among n values.

    p^(r - 1) n = CHANCE, p = erf(step / (2 sqrt(2) sigma)) the chance that a value at the middle of a step stays in it,
    sigma^2 = noise^2 - step^2/12 the noise before it is rounded. noise: rms with the rounding.
    """
    sigma = math.sqrt(max(noise**2 - step**2 / 12.0, 0.0))
    stays = math.erf(0.5 * step / (math.sqrt(2.0) * sigma)) if sigma > 0.0 else 1.0
    if stays in (0.0, 1.0):
        return math.inf if stays else 1.0
    return 1.0 + math.log(CHANCE / n) / math.log(stays)


def visits(values: Array, limit: float) -> list[tuple[int, int]]:
    """Return first row and end of the stretches at a limit; noise may leave it for some samples near the ends."""
    at = np.flatnonzero(values == limit)
    parts = np.split(at, np.flatnonzero(np.diff(at) > RUN_UP) + 1)
    return [(int(part[0]), int(part[-1]) + 1) for part in parts if part.size >= REPEATED]


def is_abrupt(values: Array, begin: int, end: int, least: float) -> bool:
    """Tell whether a signal reaches and leaves a stretch of equal values by so much within a few samples."""
    sides = (values[max(begin - RUN_UP, 0) : begin], values[end : end + RUN_UP])
    away = [float(np.mean(np.abs(side - values[begin]))) for side in sides if side.size == RUN_UP]
    return bool(away) and min(away) >= least


def runs(values: Array) -> list[tuple[int, int]]:
    """Return first row and end of the runs of equal values that are too long for a chance."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0.0) + 1, [values.size]])
    long = np.flatnonzero(np.diff(edges) >= REPEATED)
    return list(zip(edges[long].tolist(), edges[long + 1].tolist(), strict=True))


def wild_samples(values: Array, noise: float) -> Mask:
    """Return the samples that their neighbours on both sides do not explain, (n_rows,).

    Of the first and last samples the neighbours are the straight lines through those next to them.
    """
    if values.size < 2 * RUN_UP:
        return np.zeros(values.size, dtype=np.bool_)
    sides = np.sort(neighbours(values), axis=0)
    away = np.abs(values - 0.5 * (sides[1] + sides[2]))
    span = np.minimum(sides[2] - sides[0], sides[3] - sides[1])
    usual = np.full(values.size, max(ABOVE_NOISE * noise, ABOVE_OTHERS * float(np.quantile(away, USUAL))))
    ends = [0, 1, -2, -1]
    usual[ends] = np.maximum(usual[ends], AT_ENDS * float(np.ptp(np.quantile(values, [1.0 - USUAL, USUAL]))))
    return np.asarray(away > np.maximum(usual, ABOVE_SPAN * span))


def neighbours(values: Array) -> Array:
    """Return two values on either side of each, (4, n_rows)."""
    padded = np.pad(values, 2, mode="reflect", reflect_type="odd")
    sides = np.stack([padded[i : i + values.size] for i in (0, 1, 3, 4)])
    x = values
    for at, (a, b, c, d) in ((0, (1, 2, 3, 4)), (-1, (-2, -3, -4, -5))):
        sides[:, at] = 2 * x[a] - x[b], 1.5 * x[a] - 0.5 * x[c], 2 * x[b] - x[d], 3 * x[a] - 3 * x[b] + x[c]
    for at, (end, a, b, c) in ((1, (0, 2, 3, 4)), (-2, (-1, -3, -4, -5))):
        sides[:, at] = x[end], x[a], 2 * x[a] - x[b], 1.5 * x[a] - 0.5 * x[c]
    return sides


def after_sudden(values: Array) -> Mask:
    """Return the rows at which an input has just jumped; values: of the input, (n_rows,)."""
    mask = np.zeros(values.size, dtype=np.bool_)
    change = np.abs(np.diff(values))
    if change.size:
        least = max(SUDDEN * float(np.quantile(change, USUAL)), SUDDEN_SHARE * float(np.ptp(values)))
        for place in np.flatnonzero(change > least):
            mask[place : place + AFTER_SUDDEN] = True
    return mask


def in_runs(true: Mask, shortest: int) -> Mask:
    """Return the runs of a mask that are so long or longer."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(np.int8)))
    mask = np.zeros(true.size, dtype=np.bool_)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        mask[begin:end] = end - begin >= shortest
    return mask
