"""The paper's similarity degree S of two series, its numerical part S1 and its shape part S2 (Eqs 10-14)."""

import numpy as np
from numpy.typing import ArrayLike

from armid.fitness.score import score, score_numerically
from armid.fitness.series import Array, as_series
from armid.model.errors import ArmidError


def similarity(
    measured: ArrayLike,
    simulated: ArrayLike,
    interval: float,
    epsilon: float = 0.03,
    xi: float = 0.030,
    slope_threshold: float = 0.2,
) -> tuple[Array, Array, Array]:
    """Compare a population with the measurement: S = sqrt(S1 S2), each in [0, 1].

    S1 = sum max(0, |x| - |x - x'|) / sum |x|; S2 = sum over similar intervals of (L_i + L'_i) / (L + L').
    Intervals lie between landmarks of the series normalised to [0, 1]. Adjacent extrema less than epsilon and less than
    xi apart are no landmarks. Intervals are paired by order, or by overlap when their numbers differ.

    measured: signal's unit, (n_samples,); simulated: signal's unit, (n_candidates, n_samples), C-contiguous is fastest.
    interval: sample interval [s]; epsilon: of the normalised series [1]; xi: [s]; slope_threshold: [1/s].
    Returns S, S1, S2, each (n_candidates,); all three are 0 for a candidate that holds a NaN or an infinity.
    Raises ArmidError for a measured series that is zero throughout or constant, and for thresholds out of range.
    Source: paper Eqs 10-14, section III.B; negative s_i are clipped to 0, points with x = 0 have no weight.

    >>> measured = np.sin(np.linspace(0.0, 6.0, 601))
    >>> S, S1, S2 = similarity(measured, np.array([measured, 0.9 * measured]), interval=0.01)
    >>> S1.round(6)
    array([1. , 0.9])
    """
    scores = scored(measured, simulated, interval, epsilon, xi, slope_threshold)
    return scores[0], scores[1], scores[2]


def numerical_similarity(measured: ArrayLike, simulated: ArrayLike, failed: float = 0.0) -> Array:
    """Return S1 = sum max(0, |x| - |x - x'|) / sum |x| alone, (n_candidates,).

    measured: signal's unit, (n_samples,); simulated: signal's unit, (n_candidates, n_samples).
    failed: what a candidate that holds a NaN or an infinity gets.
    Raises ArmidError for a measured series that is zero throughout. Source: paper Eqs 11-13.
    """
    x, rows = as_series(measured, simulated)
    scores, whole = score_numerically(x, rows, float(failed))
    refuse_zero(whole)
    return np.asarray(scores)


def scored(
    measured: ArrayLike,
    simulated: ArrayLike,
    interval: float,
    epsilon: float = 0.03,
    xi: float = 0.030,
    slope_threshold: float = 0.2,
    failed: float = 0.0,
) -> Array:
    """Return S, S1, S2 of `similarity` as rows, (3, n_candidates), with `failed` for candidates that are not finite."""
    x, rows = as_series(measured, simulated)
    if not (0.0 < interval < np.inf and 0.0 < slope_threshold < np.inf):
        raise ArmidError(f"interval is {interval} and slope_threshold {slope_threshold}, expected numbers above 0")
    if not (0.0 <= epsilon < np.inf and 0.0 <= xi < np.inf):
        raise ArmidError(f"epsilon is {epsilon} and xi {xi}, expected numbers of at least 0")
    scores, whole, n_intervals = score(
        x, rows, float(interval), float(epsilon), float(xi), float(slope_threshold), float(failed)
    )
    refuse_zero(whole)
    if n_intervals == 0:
        raise ArmidError(f"the measured series is constant ({x[0]:g}) and has no shape to compare")
    return np.asarray(scores)


def refuse_zero(whole: float) -> None:
    """Raise ArmidError for a measured series whose sum of |x| is zero: it has no size to compare with."""
    if whole == 0.0:
        raise ArmidError("the measured series is zero throughout, expected at least one value that is not")
