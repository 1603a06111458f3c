"""Noise of a sensor, from rest or from the motion itself."""

from collections.abc import Sequence
from math import comb, log1p

import numpy as np

from armid.model import Array
from armid.record.broken import REPEATED, in_runs
from armid.record.record import Noise
from armid.record.sensor import Mask, step_of

FEWEST_REST_SAMPLES = 50
# A rest of equal values is that of a sensor that does not show its noise there, where the motion holds noise of more
# than this share of its largest value.
SHOWN_IN_MOTION = 1e-4
# A rest between motions: a speed is this small against its largest value, and the mean moves by so many standard
# deviations of a mean at most from one half to the other. Of a longer pause the later parts are tried, as a machine
# runs down.
AT_REST, STANDS, HALVINGS = 0.01, 3.0, 3
ORDERS = range(3, 9)
# Neighbours may correlate as the noise of a filtered sensor does: up to the longest memory, from so many standard
# errors (about 2/sqrt(n)) on.
MEMORIES, DISTINCT, LONGEST_MEMORY = np.linspace(-0.5, 0.95, 146), 3.0, 0.8
# Independent samples of a rest that tell its noise.
FEWEST_INDEPENDENT = 12.0
# Values farther out than this many standard deviations are no noise.
OUTLYING = 4.0


def noise_of(rest: Array, motion: Array, interval: float, times: Array | None = None) -> Noise:
    """Return the noise of a record.

    rest: samples at rest; with fewer than 50 of them, or equal ones, the differences of `motion` are used. times: of
    the motion [s] where they are irregular. The noise is at least that of the sensor's step, step/sqrt(12), of a fine
    one that of the rounding of its largest value, so that it is never 0.
    """
    size = float(np.max(np.abs(motion), initial=0.0))
    floor = max(step_of(motion), float(np.spacing(size))) / np.sqrt(12.0)
    is_short = rest.size < FEWEST_REST_SAMPLES
    if is_short or np.ptp(rest) == 0.0:
        apart = difference_rms(motion, times)
        if is_short or apart > max(2.0 * floor, SHOWN_IN_MOTION * size):
            return Noise(max(apart, floor), None, 0.0, 1.0, motion.size, "differences")
    mean = float(np.mean(rest))
    # of equal values the mean can miss the value by its last digit, which would look like correlated noise
    deviations = rest - mean if np.ptp(rest) > 0 else np.zeros_like(rest)
    rms = float(np.sqrt(np.mean(deviations**2)))
    total = correlation_sum(deviations)
    # an exponential correlation rho_k = phi^k sums to phi/(1 - phi) = total, and phi = exp(-interval/time constant)
    time_constant = interval / log1p(1 / total) if total > 0 else 0.0
    return Noise(max(rms, floor), mean, time_constant, 1 / (1 + 2 * total), rest.size, "rest")


def rest_between(values: Array, still: Mask, is_speed: bool) -> Array:
    """Return the longest rest between motions, empty without one of 50 samples.

    A stick of friction under drive is not a rest: the inputs are still, too. values: (n_rows,). still: where no input
    changes, (n_rows,). is_speed: whether a value of 0 tells a standstill, else any that stays does.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    longest = np.empty(0)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        for part in range(HALVINGS):
            rest = values[end - (end - begin) // 2**part : end]
            if rest.size < max(FEWEST_REST_SAMPLES, longest.size + 1):
                break
            if stands_still(rest, float(np.max(np.abs(values))), is_speed):
                longest = rest
    return longest


def stands_still(rest: Array, size: float, is_speed: bool) -> bool:
    if is_speed and abs(float(np.mean(rest))) > AT_REST * size:
        return False
    deviations = rest - np.mean(rest)
    independent = rest.size / (1.0 + 2.0 * correlation_sum(deviations))
    half = rest.size // 2
    drift = abs(float(np.mean(rest[:half]) - np.mean(rest[half:])))
    return drift <= STANDS * 2.0 * float(np.std(rest)) / np.sqrt(rest.size) and independent >= FEWEST_INDEPENDENT


def correlation_sum(deviations: Array) -> float:
    """Return the sum of the autocorrelation over positive lags, at least 0.

    It ends before the first lag whose correlation is below 2/sqrt(n), what white noise shows by chance.
    """
    n = deviations.size
    power = np.abs(np.fft.rfft(deviations, 2 * n)) ** 2
    covariance = np.fft.irfft(power)[: max(n // 2, 1)]
    if covariance[0] <= 0:
        return 0.0
    correlation = covariance[1:] / covariance[0]
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
    """Return the rms of the noise in a motion [unit], from its differences of high order; the noise is taken as white.

    The k-th difference of white noise has the variance C(2k, k) sigma^2. The third is taken, which removes slow motion;
    where the next order gives less than a tenth of it, the motion was still in it (low-passed noise falls less fast)
    and the next is taken. The median of the absolute values keeps the transients of the motion out.
    Runs of equal samples are left out where the noise of the others is more than a step of the values: a sensor that
    is stuck tells nothing of its noise.
    times: [s], (n_rows,), where they are irregular; then divided differences take the place of plain ones.
    """
    moved = changing(motion)
    if FEWEST_REST_SAMPLES <= moved.sum() < motion.size:
        apart = difference_rms(motion[moved], None if times is None else times[moved])
        if apart > step_of(motion):
            return apart
    estimates = []
    for order in ORDERS:
        if times is None:
            differences = np.diff(motion, n=order) / np.sqrt(comb(2 * order, order))
        else:
            differences = divided_differences(motion, times, order)
        estimates.append(1.4826 * float(np.median(np.abs(differences))))
        if len(estimates) > 1 and estimates[-1] > 0.1 * estimates[-2]:
            return float(estimates[-2])
    return float(estimates[-1])


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
    for j in range(order + 1):
        weight = np.ones(n)
        for i in range(order + 1):
            if i != j:
                weight *= unit / (times[j : j + n] - times[i : i + n])
        total += weight * values[j : j + n]
        squares += weight**2
    return total / np.sqrt(squares)
