"""What a sensor does: its step, how long it holds a value, its noise, and samples that are no data.

The last are looked for in the rows that bring a new value, as they were read: on an even grid a straight line between
two rows makes values that no sensor gave.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil, comb

import numpy as np
from numpy.typing import NDArray

from armid.model import Array

Mask = NDArray[np.bool_]
# A step that is a smaller share of the largest value is the rounding of printed numbers.
FINEST_STEP = 1e-6
# Share of the values that are sound in any record.
NEARLY_ALL = 0.98
# How far from a multiple of the step a value may lie, in steps: printed numbers are rounded once more.
OFF_STEP = 0.05
# Steps that the closest two values may be apart, and the gaps between values that make a finer step no chance.
MOST_STEPS_APART, FEWEST_GAPS = 3, 8
# Changes of the value from which a hold is found.
FEWEST_CHANGES = 20
# Renewals after which clocks that differ have drifted: longer pauses tell nothing of a hold.
MOST_RENEWALS = 3.5
# This share of all changes comes within a quarter of a hold of a multiple of it: by chance only half of them do.
ON_TIME, QUARTER_STEP = 0.9, 0.25
# ... and at least this share of the changes differs from a single step onward: a slow motion makes such steps.
UNLIKE_SLOW_MOTION = 0.2


@dataclass(frozen=True)
class Noise:
    """What is known of a sensor's noise.

    rms: [unit of the output], about the mean. mean: not subtracted anywhere; None where no rest was recorded.
    effective_fraction: independent samples per sample, 1/(1 + 2 sum rho_k), in (0, 1], 1 for white noise. source:
    "rest" (the arm under its brake) or "differences" (high differences of the motion, which cannot tell a correlation:
    the noise is taken for white).
    """

    rms: float
    mean: float | None
    effective_fraction: float
    n_samples: int
    source: str


@dataclass(frozen=True)
class Sensor:
    """Hold what the values of one output tell of its sensor.

    step: all values are multiples of it [unit of the output], 0 for a fine one. hold: samples from one renewal of
    the value to the next, 1 where each sample is new.
    """

    step: float = 0.0
    hold: int = 1

    @property
    def rounding(self) -> float:
        """Rms of what it rounds away [unit of the output]."""
        return self.step / math.sqrt(12.0)

    def reading(self, values: Array, known: float) -> Array:
        """Return values as the sensor rounds them; known: one of its readings [unit of the output]."""
        return known + np.round((values - known) / self.step) * self.step if self.step else values

    def counting_error(self, values: Array, begin: float, over: int = 1) -> Array:
        """Return what counts of so many samples leave of a speed; begin: share of a count that has passed before."""
        way = np.concatenate([np.zeros(over), np.cumsum(values)]) / over
        counts = np.floor(way / self.step + begin)
        return np.asarray(self.step * (counts[over:] - counts[:-over]) - (way[over:] - way[:-over]))


def sensor_of(values: Array) -> Sensor:
    """Return the sensor of the values of one output as they were read, (n_rows,)."""
    return Sensor(step_of(values), hold_of(values))


def step_of(values: Array) -> float:
    """Return the step [unit] that all differences of values are multiples of, 0 for a fine sensor.

    The gaps between neighbouring levels count a few steps each, so that their sum over their counts is the step to
    the last digit, however the numbers were printed.
    """
    gaps = np.diff(np.unique(values))
    # some wild values are on no grid, far from all others
    gaps = gaps[gaps <= np.quantile(gaps, NEARLY_ALL, method="higher")] if gaps.size else gaps
    is_rounding = gaps <= FINEST_STEP * float(np.quantile(np.abs(values), NEARLY_ALL))
    rounding, gaps = gaps[is_rounding], gaps[~is_rounding]
    if not gaps.size or float(np.sum(rounding)) > 1e-3 * float(np.sum(gaps)):
        return 0.0
    # among few values the closest two may be two or three steps apart
    for parts in range(1, MOST_STEPS_APART + 1 if gaps.size >= FEWEST_GAPS else 2):
        counts = np.rint(gaps * parts / np.min(gaps))
        step = float(np.sum(gaps) / np.sum(counts))
        if np.all(np.abs(gaps - counts * step) <= OFF_STEP * step):
            return step
    return 0.0


def hold_of(values: Array) -> int:
    """Return after how many samples the sensor renews its value, 1 where each sample is new.

    A sensor that holds its value changes it after multiples of one time alone, whatever the motion. A coarse sensor of
    a slow motion does so as well where the motion is even; but then each change is one step onward.
    """
    places = np.flatnonzero(np.diff(values) != 0.0)
    if places.size < FEWEST_CHANGES:
        return 1
    apart, changes = np.diff(places), np.diff(values)[places]
    least = int(np.quantile(apart, 0.1))
    hold = float(np.mean(apart[(apart >= least - 1) & (apart < 1.5 * least)]))
    # of two samples and a half every number of samples is within a quarter of a multiple
    if hold < 3.0 and hold != 2.0:
        return 1
    short = apart[apart < MOST_RENEWALS * hold]
    on_time = np.abs(short / hold - np.maximum(np.rint(short / hold), 1.0)) < QUARTER_STEP
    if float(np.mean(on_time)) < ON_TIME or 2 * short.size < apart.size:
        return 1
    single = 1.5 * float(np.min(np.abs(changes)))
    onward = (np.abs(changes[1:]) <= single) & (np.sign(changes[1:]) == np.sign(changes[:-1]))
    return round(hold) if float(np.mean(~onward)) >= UNLIKE_SLOW_MOTION else 1


def renewed(values: Array, hold: int) -> Mask:
    """Return which rows bring a new value, (n_rows,): each first of a hold, as well where the new value is as the old.

    values: (n_rows,), as they were read.
    """
    if hold == 1:
        return np.ones(values.size, dtype=np.bool_)
    changed = np.append(True, np.diff(values) != 0.0)
    begins = np.flatnonzero(changed)
    since = np.arange(values.size) - np.repeat(begins, np.diff(np.append(begins, values.size)))
    left = np.repeat(np.diff(np.append(begins, values.size)), np.diff(np.append(begins, values.size))) - since
    # the last renewal of a run that is as old as half a hold when the run ends was none
    return np.asarray(changed | ((since % hold == 0) & (2 * left > hold)))


FEWEST_REST_SAMPLES = 50
# At rest a sensor whose noise is below this share of its step shows more or less of it, as the step falls. The motion
# tells it where its differences of neighbouring orders agree to such a share: there is no motion in them.
HIDDEN_NOISE, AGREEMENT = 0.6, 0.15
# A rest between motions: a speed is this small against its largest value, and mean and size of the values move by so
# many of their standard errors at most from one half to the other. Of a longer pause the later parts are tried, as a
# machine runs down.
AT_REST, STANDS, HALVINGS = 0.01, 3.0, 3
ORDERS = range(3, 9)
# Differences within so many standard deviations are taken, so often: the first deviation is that of their median. What
# they leave of the rms of normal noise.
TRIMMED, N_TRIMMED, LEFT_OF_NORMAL = 2.5, 3, 0.9546
# Multiples of it fill a step evenly.
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
# Neighbours may correlate as the noise of a filtered sensor does: up to the longest memory, from so many standard
# errors (about 2/sqrt(n)) on.
MEMORIES, DISTINCT, LONGEST_MEMORY = np.linspace(-0.5, 0.95, 146), 3.0, 0.8
# By how much a longer rest of an input is tried. A measured input passes so many steps, and changes in such a share of
# the samples.
LONGER_REST, FEWEST_STEPS, CHANGING = 1.25, 16, 0.1
# Correlation of neighbours among second differences of white noise, and how far that of 50 of them may be from it; the
# least median of their squares, in the mean (of a normal noise 0.45); the largest noise of an input, as a share of how
# far the input moves.
WHITE_BENDS, WHITENESS, SPREAD_OF_NOISE, LARGEST_NOISE = -2.0 / 3.0, 0.2, 0.2, 0.2
# Independent samples of a rest that tell its noise.
FEWEST_INDEPENDENT = 12.0
# Values farther out than this many standard deviations are no noise.
OUTLYING = 4.0


def noise_of(rest: Array, motion: Array, times: Array | None = None) -> Noise:
    """Return the noise of a record.

    rest: samples at rest; with fewer than 50 of them, or where the sensor's step hides their noise, the differences of
    `motion` are used. times: of the motion [s] where they are irregular. The noise is at least that of the sensor's
    step, step/sqrt(12), of a fine one that of the rounding of its largest value, so that it is never 0.
    """
    size, step = float(np.max(np.abs(motion), initial=0.0)), step_of(motion)
    floor = max(step, float(np.spacing(size))) / np.sqrt(12.0)
    is_short = rest.size < FEWEST_REST_SAMPLES
    is_equal = is_short or np.ptp(rest) == 0.0
    if is_equal or np.std(rest) < HIDDEN_NOISE * step:
        apart, agrees = noise_in_motion(motion, times)
        # Of a slow motion the steps alone look like up to twice their noise; what a step hides is less than a step.
        if is_short or not is_equal or (agrees and apart > 2.0 * floor):
            most = np.inf if is_equal else max(step, floor)
            return Noise(float(np.clip(apart, floor, most)), None, 1.0, motion.size, "differences")
    mean = float(np.mean(rest))
    # of equal values the mean can miss the value by its last digit, which would look like correlated noise
    deviations = rest - mean if np.ptp(rest) > 0 else np.zeros_like(rest)
    rms = float(np.sqrt(np.mean(deviations**2)))
    total = correlation_sum(deviations)
    return Noise(max(rms, floor), mean, 1 / (1 + 2 * total), rest.size, "rest")


@dataclass(frozen=True)
class InputNoise:
    """Hold how far a measured input may be from what drove the machine [unit of the input].

    rms: of white noise with the density that a rest shows at low frequencies. step: of the sensor's rounding, 0 for a
    fine one.
    """

    rms: float = 0.0
    step: float = 0.0

    def on_finer_grid(self, finer: int) -> "InputNoise":
        """Return the noise of samples, so many for a row, whose slow changes are as large as those of the rows."""
        if finer == 1:
            return self
        rounding = self.step**2 / 12.0
        return replace(self, rms=float(np.sqrt(finer * (self.rms**2 + rounding) - rounding)))


def noise_of_input(values: Array, outputs: Sequence[tuple[Array, bool]]) -> InputNoise:
    """Return the noise of an input, 0 for a command, which is known exactly.

    A command has a few values only. Else it is that at the beginning of the file while the machine stands still; of
    several lengths of this rest the quietest counts, as the drive may begin before the machine moves. Without a rest,
    as where a controller holds a load, it is what is white in the column.
    values: (n_rows,). outputs: columns of the machine's motion, (n_rows,) each, and whether each is a speed.
    """
    seen = list[float]()
    if np.unique(values).size < FEWEST_STEPS:
        return InputNoise()
    for n in lengths_of_rest([values], outputs):
        deviations = values[:n] - np.mean(values[:n])
        # of equal values the mean can miss the value by its last digit
        is_equal = np.ptp(values[:n]) == 0.0
        seen.append(0.0 if is_equal else float(np.std(deviations)) * np.sqrt(1.0 + 2.0 * correlation_sum(deviations)))
    return InputNoise(float(min(seen)) if seen else white_part(values), rounding_of_input(values))


def white_part(values: Array) -> float:
    """Return the rms of white noise in a column, 0 where it is too large to be noise or where nothing is white.

    Second differences of white noise are correlated by -2/3 from row to row, those of a smooth signal by nearly 1, and
    those of a command that jumps are 0 but at a jump. The stretches of 50 rows in which they are like those of noise
    tell its size, where they are half of all.
    """
    bends = np.diff(values, 2)
    stretches = bends[: bends.size // FEWEST_REST_SAMPLES * FEWEST_REST_SAMPLES].reshape(-1, FEWEST_REST_SAMPLES)
    squares = np.sum(stretches**2, axis=1)
    alike = np.sum(stretches[:, 1:] * stretches[:, :-1], axis=1) / np.maximum(squares, np.finfo(np.float64).tiny)
    everywhere = np.median(stretches**2, axis=1) > SPREAD_OF_NOISE * squares / FEWEST_REST_SAMPLES
    white = everywhere & (np.abs(alike - WHITE_BENDS) < WHITENESS)
    if not len(white) or np.mean(white) < 0.5:
        return 0.0
    rms = float(np.sqrt(np.median(squares[white]) / FEWEST_REST_SAMPLES / 6.0))
    return rms if rms < LARGEST_NOISE * float(np.std(values)) else 0.0


def rounding_of_input(values: Array) -> float:
    """Return the step with which a sensor rounds an input, 0 for a fine one and for a command.

    A command stays, jumps, or runs straight; what is measured passes its steps unevenly.
    """
    step = step_of(values)
    steps = np.rint(np.diff(values) / step) if step else np.zeros(1)
    return step if np.mean((steps != 0.0) & np.append(True, np.diff(steps) != 0.0)) >= CHANGING else 0.0


def lengths_of_rest(inputs: Sequence[Array], outputs: Sequence[tuple[Array, bool]] = ()) -> Iterator[int]:
    """Yield growing numbers of first rows in which inputs and outputs stand still.

    inputs: (n_rows,) each. outputs: columns of the machine's motion, and whether each is a speed.
    """
    columns = [*((u, 0.0, False) for u in inputs), *((y, float(np.nanmax(np.abs(y))), speed) for y, speed in outputs)]
    n = FEWEST_REST_SAMPLES
    while n <= columns[0][0].size and all(stands_still(x[:n], size, is_speed) for x, size, is_speed in columns):
        yield n
        n = ceil(LONGER_REST * n)


def length_of_rest(inputs: Sequence[Array], outputs: Sequence[tuple[Array, bool]] = ()) -> int:
    """Return in how many first rows inputs and outputs stand still, 0 where they move from the first on.

    Of growing lengths the last but one counts, as the motion may begin before this shows. Arguments as for
    `lengths_of_rest`.
    """
    lengths = [0, *lengths_of_rest(inputs, outputs)]
    return lengths[-2] if len(lengths) > 2 else lengths[-1]


def rest_between(values: Array, still: Mask, is_speed: bool) -> Array:
    """Return the longest rest between motions, empty without one of 50 samples.

    A stick of friction under drive is not a rest: the inputs are still, too. values: (n_rows,). still: where no input
    changes, (n_rows,). is_speed: whether a value of 0 tells a standstill, else any that stays does.
    """
    longest = np.empty(0)
    for begin, end in stretches(still):
        for part in range(HALVINGS):
            rest = values[end - (end - begin) // 2**part : end]
            if rest.size < max(FEWEST_REST_SAMPLES, longest.size + 1):
                break
            if stands_still(rest, float(np.max(np.abs(values))), is_speed):
                longest = rest
    return longest


def stands_still(rest: Array, size: float, is_speed: bool) -> bool:
    """Tell whether values are noise about a mean: neither this nor their size moves, and they soon forget.

    The independent samples are those of a variance, n / (1 + 2 sum rho_k^2) (Bartlett 1946): a machine that swings
    freely goes on correlating with itself.
    """
    if is_speed and abs(float(np.mean(rest))) > AT_REST * size:
        return False
    # a drift would look like noise of a long memory
    times = np.arange(rest.size) - 0.5 * (rest.size - 1)
    deviations = rest - np.mean(rest)
    deviations -= times * float(times @ deviations) / float(times @ times)
    correlation = autocorrelation(deviations)
    independent = rest.size / (1.0 + 2.0 * float(np.sum(correlation**2)))
    forgets = 1.0 + 2.0 * sum_above_chance(correlation, rest.size)
    error = 2.0 * float(np.std(deviations)) * np.sqrt(forgets / rest.size)
    first, second = rest[: rest.size // 2], rest[rest.size // 2 :]
    drifts = abs(float(np.mean(first) - np.mean(second))) > STANDS * error
    sizes = np.maximum([np.std(first), np.std(second)], np.finfo(np.float64).tiny)
    log_ratio = 2.0 * abs(float(np.log(sizes[0]) - np.log(sizes[1])))
    return not drifts and independent >= FEWEST_INDEPENDENT and log_ratio <= STANDS * np.sqrt(8.0 / independent)


def autocorrelation(deviations: Array) -> Array:
    """Return the autocorrelation at positive lags up to half of the values, 0 where all are equal."""
    n = deviations.size
    power = np.abs(np.fft.rfft(deviations, 2 * n)) ** 2
    covariance = np.fft.irfft(power)[: max(n // 2, 1)]
    return np.asarray(covariance[1:] / covariance[0] if covariance[0] > 0 else np.zeros(len(covariance) - 1))


def correlation_sum(deviations: Array) -> float:
    """Return the sum of the autocorrelation over positive lags, see `sum_above_chance`."""
    return sum_above_chance(autocorrelation(deviations), deviations.size)


def sum_above_chance(correlation: Array, n: int) -> float:
    """Return the sum of an autocorrelation of n values, at least 0.

    It ends before the first lag whose correlation is below 2/sqrt(n), what white noise shows by chance.
    """
    small = np.flatnonzero(correlation < 2 / np.sqrt(n))
    return float(np.sum(correlation[: small[0] if small.size else None]))


def memory_of(parts: Sequence[Array]) -> float:
    """Return the correlation of neighbouring samples of the noise in residuals, 0 where none is seen or it is too long.

    From second differences, which leave next to nothing of what a model lacks: their correlation tells that of an
    exponential one, rho^k at lag k. Long memory looks like a slow change.
    """
    differences = [np.diff(p, n=2) for p in parts]
    size = OUTLYING * 1.4826 * float(np.median(np.abs(np.concatenate(differences))))
    kept = [np.clip(d, -size, size) for d in differences]
    total, n = sum(float(d @ d) for d in kept), sum(len(d) for d in kept)
    if not total > 0.0:
        return 0.0
    # covariances of second differences of rho^|k|, at lags 0 and 1
    lags = [6.0 - 8.0 * MEMORIES + 2.0 * MEMORIES**2, -4.0 + 7.0 * MEMORIES - 4.0 * MEMORIES**2 + MEMORIES**3]
    seen = sum(float(d[1:] @ d[:-1]) for d in kept) / total
    rho = float(np.interp(seen, lags[1] / lags[0], MEMORIES))
    return rho if 2.0 * DISTINCT / np.sqrt(n) < rho <= LONGEST_MEMORY else 0.0


def new_share(residual: Array) -> float:
    """Return the share of samples that count as independent in a residual with the memory of `memory_of`."""
    memory = memory_of([residual])
    return (1.0 - memory) / (1.0 + memory)


def difference_rms(motion: Array, times: Array | None = None) -> float:
    """Return the rms of the noise in a motion [unit], see `noise_in_motion`."""
    return noise_in_motion(motion, times)[0]


def noise_in_motion(motion: Array, times: Array | None = None) -> tuple[float, bool]:
    """Return the rms of the noise in a motion [unit], and whether the next order of differences agrees with it.

    It comes from differences of high order; the noise is taken as white.

    The k-th difference of white noise has the variance C(2k, k) sigma^2. The third is taken, which removes slow motion;
    where the next order gives less than a tenth of it, the motion was still in it (low-passed noise falls less fast)
    and the next is taken. Differences far beyond the others are transients of the motion: left out. Those of a coarse
    sensor are spread over its step, as else their median is one of a few values.
    Runs of equal samples are left out where the noise of the others is more than a step of the values: a sensor that
    is stuck tells nothing of its noise.
    times: [s], (n_rows,), where they are irregular; then divided differences take the place of plain ones.
    """
    moved, step = changing(motion), step_of(motion)
    if FEWEST_REST_SAMPLES <= moved.sum() < motion.size:
        apart = noise_in_motion(motion[moved], None if times is None else times[moved])
        if apart[0] > step:
            return apart
    estimates: list[float] = []
    for order in ORDERS:
        if times is None:
            spread = step * ((GOLDEN * np.arange(motion.size - order)) % 1.0 - 0.5)
            differences = (np.diff(motion, n=order) + spread) / np.sqrt(comb(2 * order, order))
        else:
            differences = divided_differences(motion, times, order)
        rms = 1.4826 * float(np.median(np.abs(differences)))
        for _ in range(N_TRIMMED):
            kept = differences[np.abs(differences) <= TRIMMED * rms]
            rms = float(np.sqrt(np.mean(kept**2))) / LEFT_OF_NORMAL if rms else 0.0
        estimates.append(rms)
        if len(estimates) > 1 and estimates[-1] > 0.1 * estimates[-2]:
            return estimates[-2], abs(estimates[-1] - estimates[-2]) <= AGREEMENT * estimates[-2]
    return estimates[-1], False


def changing(motion: Array) -> Mask:
    """Return which samples stand in no run of equal ones, (n_samples,)."""
    return ~in_runs(np.append(np.diff(motion) == 0.0, False), REPEATED - 1)


def divided_differences(values: Array, times: Array, order: int) -> Array:
    """Return what each order + 1 neighbours at irregular times hold beyond a polynomial of degree order - 1.

    sum_j c_j x_j with c_j = 1 / prod_i (t_j - t_i) and sum c_j^2 = 1, so that white noise keeps its rms.
    values, times [s]: shape (n,); returns (n - order,).
    """
    n, unit = values.size - order, float(np.median(np.diff(times)))
    total, squares = np.zeros(n), np.zeros(n)
    windows = np.lib.stride_tricks.sliding_window_view(times, order + 1).T
    for j in range(order + 1):
        weight = np.prod(unit / np.delete(windows[j] - windows, j, axis=0), axis=0)
        total += weight * values[j : j + n]
        squares += weight**2
    return total / np.sqrt(squares)


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
    repeated, by_chance = runs(values), longest_by_chance(noise, sensor.step, values.size)
    for limit in (float(values.max()), float(values.min())):
        visited = visits(values, limit) if abs(limit) > sensor.step else []
        longest = max((end - begin for begin, end in repeated if values[begin] == limit), default=0)
        # noise leaves a limit for some samples where the signal reaches it; a frozen sensor has one run
        in_noise = known and int(np.sum(values == limit)) > longest
        if longest > by_chance and any(in_noise or is_abrupt(values, *v, ABRUPT * usual) for v in visited):
            clipped |= values == limit
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
    """Tell whether a signal reaches and leaves a stretch of equal values by so much within a few samples.

    A stretch with which a record begins was not reached: as its drive changes, an even speed ends as abruptly.
    """
    sides = (values[max(begin - RUN_UP, 0) : begin], values[end : end + RUN_UP])
    away = [float(np.mean(np.abs(side - values[begin]))) for side in sides if side.size == RUN_UP]
    return begin >= RUN_UP and min(away) >= least


def runs(values: Array, shortest: int = REPEATED) -> list[tuple[int, int]]:
    """Return first row and end of the runs of equal values that are so long or longer."""
    return [(begin, end + 1) for begin, end in stretches(np.diff(values) == 0.0) if end + 1 - begin >= shortest]


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
    mask = np.zeros(true.size, dtype=np.bool_)
    for begin, end in stretches(true):
        mask[begin:end] = end - begin >= shortest
    return mask


def stretches(true: Mask) -> list[tuple[int, int]]:
    """Return first row and end of each run of a mask."""
    edges = np.flatnonzero(np.diff(true, prepend=False, append=False))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
