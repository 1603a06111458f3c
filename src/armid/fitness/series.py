"""The measured series and the candidates' series that every measure compares."""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from armid.model.errors import ArmidError

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
