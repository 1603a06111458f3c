"""The paper's similarity degree S of two series with its parts S1 and S2 (Eqs 10-14); sums of squares."""

import numpy as np
from numpy.typing import ArrayLike

from armid.engine.compile import kept
from armid.errors import ArmidError
from armid.model import Array

# A lone extremum is noise nearer to an end than this share of the length, and lower than so many times the noise.
NEAR_END, LEAST_PEAK = 0.03, 3.0


def similarity(
    measured: ArrayLike, simulated: ArrayLike, interval: float, epsilon: float = 0.03, xi: float = 0.030,
    slope_threshold: float = 0.2, noise: float = 0.0, failed: float = 0.0,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Compare a population with the measurement: S = sqrt(S1 S2), each in [0, 1].

    S1 = sum max(0, |x| - |x - x'|) / sum |x|; S2 = sum over similar intervals of (L_i + L'_i) / (L + L').
    Intervals lie between landmarks of the series normalised to [0, 1]. Adjacent extrema less than epsilon and less than
    xi apart are no landmarks. Intervals are paired by order, or by overlap when their numbers differ.

    Parameters
    ----------
    measured : array_like
        x [signal's unit], (n_samples,).
    simulated : array_like
        x' [signal's unit], (n_candidates, n_samples); C-contiguous is fastest.
    interval : float
        Sample interval [s].
    epsilon, xi : float
        Of the normalised series: level [1], duration [s].
    slope_threshold : float
        Of the normalised series [1/s].
    noise : float
        Rms [signal's unit]. A lone extremum within 3 % of the series' length from its end is not a landmark when its
        height is below three times that; 0, as in the paper: every one is.
    failed : float
        What a candidate that holds a NaN or an infinity gets.

    Returns
    -------
    tuple of arrays
        S, S1, S2, each (n_candidates,).

    Raises
    ------
    ArmidError
        The measured series is zero throughout or constant, or a threshold is out of range.

    Source: paper Eqs 10-14, section III.B; negative s_i are clipped to 0, points with x = 0 have no weight.

    >>> measured = np.sin(np.linspace(0.0, 6.0, 601))
    >>> S, S1, S2 = similarity(measured, np.array([measured, 0.9 * measured]), interval=0.01)
    >>> S1.round(6)
    array([1. , 0.9])
    """
    x, rows = as_series(measured, simulated)
    if not (0.0 < interval < np.inf and 0.0 < slope_threshold < np.inf):
        raise ArmidError(f"interval is {interval} and slope_threshold {slope_threshold}, expected numbers above 0")
    if not (0.0 <= epsilon < np.inf and 0.0 <= xi < np.inf and 0.0 <= noise < np.inf):
        raise ArmidError(f"epsilon is {epsilon}, xi {xi} and noise {noise}, expected numbers of at least 0")
    scores, whole, n_intervals = score(
        x, rows, float(interval), float(epsilon), float(xi), float(slope_threshold), float(failed),
        LEAST_PEAK * noise,
    )  # fmt: skip
    refuse_zero(whole)
    if n_intervals == 0:
        raise ArmidError(f"the measured series is constant ({x[0]:g}) and has no shape to compare")
    return scores[0], scores[1], scores[2]


def numerical_similarity(measured: ArrayLike, simulated: ArrayLike, failed: float = 0.0) -> Array:
    """Return the numerical part of the similarity degree alone, S1 = sum max(0, |x| - |x - x'|) / sum |x| (Eq 13).

    Parameters
    ----------
    measured, simulated
        See `similarity`, for the errors as well.
    failed : float
        What a candidate that holds a NaN or an infinity gets.

    Returns
    -------
    array, (n_candidates,)
    """
    x, rows = as_series(measured, simulated)
    scores, whole = score_numerically(x, rows, float(failed))
    refuse_zero(whole)
    return np.asarray(scores)


def refuse_zero(whole: float) -> None:
    """Raise ArmidError for a measured series whose sum of |x| is zero: it has no size to compare with."""
    if whole == 0.0:
        raise ArmidError("the measured series is zero throughout, expected at least one value that is not")


def as_series(measured: ArrayLike, simulated: ArrayLike) -> tuple[Array, Array]:
    """Return both as contiguous float64; nothing is copied when they are so already."""
    x = np.ascontiguousarray(measured, dtype=np.float64)
    rows = np.ascontiguousarray(simulated, dtype=np.float64)
    if x.ndim != 1 or x.size == 0:
        raise ArmidError(f"the measured series has shape {x.shape}, expected (n_samples,) with at least one sample")
    if rows.ndim != 2 or rows.shape[1] != x.size:
        raise ArmidError(f"the simulated series have shape {rows.shape}, expected (n_candidates, {x.size})")
    if has_failed(x[np.newaxis])[0]:
        raise ArmidError(f"{np.count_nonzero(~np.isfinite(x))} of {x.size} measured values are no finite numbers")
    return x, rows


@kept(nogil=True)
def has_failed(simulated):  # type: ignore[no-untyped-def]
    """Say whether a candidate's series holds a NaN or an infinity: (n_candidates, n_samples) -> (n_candidates,)."""
    failed = np.empty(simulated.shape[0], np.bool_)
    for c in range(simulated.shape[0]):
        # 0 * y is 0 for every finite y and NaN otherwise; an "or" without a branch runs in packed instructions
        bad = 0
        for i in range(simulated.shape[1]):
            bad |= simulated[c, i] * 0.0 != 0.0
        failed[c] = bad != 0
    return failed


# Neither nnan nor ninf may be added: a NaN in y has to reach the sum.
@kept(nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _sum_of_squares(x, y):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(x.size):
        total += (x[i] - y[i]) ** 2
    return total


@kept(nogil=True)
def sums_of_squares(x, rows):  # type: ignore[no-untyped-def]
    """Return sum (x - y)^2 of every row, (n_candidates,), +inf where one is NaN."""
    sums = np.empty(rows.shape[0])
    for c in range(rows.shape[0]):
        total = _sum_of_squares(x, rows[c])
        sums[c] = np.inf if np.isnan(total) else total
    return sums


# The compiled loop over a population. All of it stands in this one file: numba's cache does not see that a function of
# another file has changed.


@kept(nogil=True, error_model="numpy")
def score(x, rows, interval, epsilon, xi, threshold, failed, height):  # type: ignore[no-untyped-def]
    """Return S, S1, S2 of every row, (3, n_candidates), `failed` where one is not finite; sum |x|; intervals of x."""
    scores = np.full((3, rows.shape[0]), failed)
    room = x.size + 1
    at, level, at2, level2 = np.empty(room, np.int64), np.empty(room), np.empty(room, np.int64), np.empty(room)
    n = _landmarks(x, interval, epsilon, xi, height, at, level)
    whole = _common(x, x)
    for c in range(rows.shape[0]):
        s1 = _common(x, rows[c]) / whole
        if np.isfinite(s1):
            n2 = _landmarks(rows[c], interval, epsilon, xi, height, at2, level2)
            s2 = _shape(at, level, n, at2, level2, n2, interval, threshold)
            scores[0, c], scores[1, c], scores[2, c] = np.sqrt(s1 * s2), s1, s2
    return scores, whole, n


@kept(nogil=True, error_model="numpy")
def score_numerically(x, rows, failed):  # type: ignore[no-untyped-def]
    """Return S1 of every row, (n_candidates,), `failed` for a row that is not finite; and sum |x|."""
    scores = np.full(rows.shape[0], failed)
    whole = _common(x, x)
    for c in range(rows.shape[0]):
        s1 = _common(x, rows[c]) / whole
        if np.isfinite(s1):
            scores[c] = s1
    return scores, whole


# Neither nnan nor ninf may be added: the sum of misses has to turn into NaN or infinity when y holds one.
@kept(nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _common(x, y):  # type: ignore[no-untyped-def]
    """Return sum max(0, |x| - |x - y|), the numerator of S1, or NaN when y holds a NaN or an infinity."""
    common, misses = 0.0, 0.0
    for i in range(x.size):
        miss = abs(x[i] - y[i])
        left = abs(x[i]) - miss
        common += left if left > 0.0 else 0.0
        misses += miss
    return common + 0.0 * misses


@kept(nogil=True)
def _extrema(x, at):  # type: ignore[no-untyped-def]
    """Write both ends and the inner extrema (of a plateau its first sample) into at; return their number."""
    at[0] = 0
    n = 1
    last = 0
    rising = True
    for i in range(1, x.size):
        if x[i] != x[i - 1]:
            if (x[i] > x[i - 1]) != rising:
                rising = not rising
                if last > 0:
                    at[n] = last
                    n += 1
            last = i
    at[n] = x.size - 1
    return n + 1


@kept(nogil=True)
def _landmarks(x, interval, epsilon, xi, height, at, level):  # type: ignore[no-untyped-def]
    """Write the ends of the intervals and their normalised levels; return how many there are, 0 for a constant series.

    Small close pairs leave smallest first. One pass with a stack does it: a pair no larger than its neighbours leaves
    before them whatever happens elsewhere, and the pair that its leaving joins is never smaller than it was.
    """
    n = _extrema(x, at)
    low = high = x[0]
    for k in range(1, n):
        low, high = min(low, x[at[k]]), max(high, x[at[k]])
    if low == high:
        return 0
    level[0], m = (x[0] - low) / (high - low), 1
    for k in range(1, n - 1):
        at[m], level[m] = at[k], (x[at[k]] - low) / (high - low)
        m += 1
        while m > 3 and _is_small(at, level, m - 3, interval, epsilon, xi):
            if _is_small(at, level, m - 2, interval, epsilon, xi) and _gain(level, m - 2) < _gain(level, m - 3):
                break
            at[m - 3], level[m - 3] = at[m - 1], level[m - 1]
            m -= 2
    while m > 2 and _is_small(at, level, m - 2, interval, epsilon, xi):
        m -= 2
    at[m], level[m] = x.size - 1, (x[-1] - low) / (high - low)
    near, least = NEAR_END * x.size, height / (high - low)
    if m > 1 and at[m] - at[m - 1] < near and _gain(level, m - 1) < least:
        at[m - 1], level[m - 1] = at[m], level[m]
        m -= 1
    if m > 1 and at[1] < near and _gain(level, 0) < least:
        for k in range(1, m):
            at[k], level[k] = at[k + 1], level[k + 1]
        m -= 1
    return m


@kept(nogil=True)
def _gain(level, k):  # type: ignore[no-untyped-def]
    return abs(level[k + 1] - level[k])


@kept(nogil=True)
def _is_small(at, level, k, interval, epsilon, xi):  # type: ignore[no-untyped-def]
    return _gain(level, k) < epsilon and (at[k + 1] - at[k]) * interval < xi


@kept(nogil=True)
def _shape(at, level, n, at2, level2, n2, interval, threshold):  # type: ignore[no-untyped-def]
    """Return S2 of Eq 14, in whole samples: exactly 1 for equal series, 0 for a constant candidate (n2 = 0)."""
    if n2 == 0:
        return 0.0
    first, second, pairs = _pairs(at, n, at2, n2)
    similar = 0
    for p in range(pairs):
        i, j = first[p], second[p]
        length, length2 = at[i + 1] - at[i], at2[j + 1] - at2[j]
        slope = (level[i + 1] - level[i]) / (length * interval)
        slope2 = (level2[j + 1] - level2[j]) / (length2 * interval)
        if abs(slope - slope2) < threshold:
            similar += length + length2
    return similar / (at[n] + at2[n2])


@kept(nogil=True)
def _pairs(at, n, at2, n2):  # type: ignore[no-untyped-def]
    """Pair intervals by order when their numbers agree, else one to one by overlap, largest (then earliest) first."""
    if n == n2:
        order = np.arange(n)
        return order, order, n
    first, second, overlap = np.empty(n + n2, np.int64), np.empty(n + n2, np.int64), np.empty(n + n2, np.int64)
    i = j = count = 0
    while i < n and j < n2:
        size = min(at[i + 1], at2[j + 1]) - max(at[i], at2[j])
        p = count
        while p > 0 and overlap[p - 1] < size:
            first[p], second[p], overlap[p] = first[p - 1], second[p - 1], overlap[p - 1]
            p -= 1
        first[p], second[p], overlap[p] = i, j, size
        count += 1
        ends, ends2 = at[i + 1] <= at2[j + 1], at[i + 1] >= at2[j + 1]
        i, j = i + ends, j + ends2
    free, free2 = np.ones(n, np.bool_), np.ones(n2, np.bool_)
    pairs = 0
    for p in range(count):
        if free[first[p]] and free2[second[p]]:
            free[first[p]] = free2[second[p]] = False
            first[pairs], second[pairs] = first[p], second[p]
            pairs += 1
    return first, second, pairs
