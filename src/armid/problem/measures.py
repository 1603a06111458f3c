"""Distances between the measured series and a population's series, one number per candidate.

No temporary of the population's size is made. A candidate that holds a NaN or an infinity gets +inf.
"""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from armid.errors import ArmidError

Array = NDArray[np.float64]


def as_series(measured: ArrayLike, simulated: ArrayLike) -> tuple[Array, Array]:
    """Return both as contiguous float64; nothing is copied when they are so already.

    measured: signal's unit, (n_samples,); simulated: signal's unit, (n_candidates, n_samples).
    Raises ArmidError for shapes that do not match and for a measured value that is no finite number.
    """
    x = np.ascontiguousarray(measured, dtype=np.float64)
    rows = np.ascontiguousarray(simulated, dtype=np.float64)
    if x.ndim != 1 or x.size == 0:
        raise ArmidError(f"the measured series has shape {x.shape}, expected (n_samples,) with at least one sample")
    if rows.ndim != 2 or rows.shape[1] != x.size:
        raise ArmidError(f"the simulated series have shape {rows.shape}, expected (n_candidates, {x.size})")
    if has_failed(x[np.newaxis])[0]:
        raise ArmidError(f"{np.count_nonzero(~np.isfinite(x))} of {x.size} measured values are no finite numbers")
    return x, rows


@njit(cache=True, nogil=True)
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


def mean_square(measured: ArrayLike, simulated: ArrayLike) -> Array:
    """Return the mean of (x - x')^2 [signal's unit squared], (n_candidates,).

    measured: signal's unit, (n_samples,); simulated: signal's unit, (n_candidates, n_samples).
    """
    x, rows = as_series(measured, simulated)
    return np.asarray(_sums_of_squares(x, rows)) / x.size


def rmse(measured: ArrayLike, simulated: ArrayLike) -> Array:
    """Return the root of the mean of (x - x')^2 [signal's unit], (n_candidates,).

    >>> rmse([3.0, 4.0], [[0.0, 0.0], [3.0, 3.0]]).round(6)
    array([3.535534, 0.707107])
    """
    return np.sqrt(mean_square(measured, simulated))


def relative_mean_square(measured: ArrayLike, simulated: ArrayLike) -> Array:
    """Return the mean of (x - x')^2 over the mean of x^2 [1], (n_candidates,).

    Raises ArmidError for a measured series that is zero throughout.
    """
    x, rows = as_series(measured, simulated)
    whole = float(np.square(x).sum())
    if whole == 0.0:
        raise ArmidError("the measured series is zero throughout, expected an rms above 0 to divide by")
    return np.asarray(_sums_of_squares(x, rows)) / whole


def nrmse(measured: ArrayLike, simulated: ArrayLike) -> Array:
    """Return the rmse over the rms of the measured series [1], (n_candidates,); errors as `relative_mean_square`."""
    return np.sqrt(relative_mean_square(measured, simulated))


def chi_square(measured: ArrayLike, simulated: ArrayLike, noise: float) -> Array:
    """Return the sum of (x - x')^2 / noise^2 [1], (n_candidates,): -2 log likelihood for white noise, up to a constant.

    noise: rms of the measuring noise [signal's unit]. Raises ArmidError unless it is a number above 0.
    """
    weight = inverse_noise(noise)
    x, rows = as_series(measured, simulated)
    return weight**2 * np.asarray(_sums_of_squares(x, rows))


def inverse_noise(noise: float) -> float:
    """Return 1/noise, the weight of a residual whose noise has this rms [signal's unit]; errors as `chi_square`."""
    if not 0.0 < noise < np.inf:
        raise ArmidError(f"the noise of the record is {noise}, expected an rms above 0 in the signal's unit")
    return 1.0 / noise


def unity(noise: float) -> float:
    """Return 1, the weight of a residual in the rmse, whatever the noise."""
    return 1.0


# Neither nnan nor ninf may be added: a NaN in y has to reach the sum.
@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _sum_of_squares(x, y):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(x.size):
        total += (x[i] - y[i]) ** 2
    return total


@njit(cache=True, nogil=True)
def _sums_of_squares(x, rows):  # type: ignore[no-untyped-def]
    sums = np.empty(rows.shape[0])
    for c in range(rows.shape[0]):
        total = _sum_of_squares(x, rows[c])
        sums[c] = np.inf if np.isnan(total) else total
    return sums
