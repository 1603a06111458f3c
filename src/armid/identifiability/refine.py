"""Least squares inside the box, from a start that is near: what a search or a neighbouring fit has found."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from armid.identifiability.weighted import WeightedRecords, noise_weights
from armid.model import ArmidError
from armid.problem.replay import Replay
from armid.problem.space import Space
from armid.simulation import probes

Array = NDArray[np.float64]
MOST_EVALUATIONS = 60
# What holds a parameter that the records do not see where it is, as a share of the slopes: below any rounding of chi2.
ANCHOR = 1e-8
# An estimate this close to the box, as a share of the range, is tried on the box itself.
NEAR = 1e-3
# How many candidates are spread over the box, and from how many of the best a fit starts.
N_SPREAD, N_STARTS = 400, 4


def refine(
    replays: tuple[Replay, ...],
    space: Space,
    x0: Array,
    weights: Sequence[float] | None = None,
    tolerance: float = 1e-9,
) -> Array:
    """Return the candidate near x0 that minimises sum over records of weight^2 |measured - simulated|^2 in the box.

    A reusable local re-fit: scipy's trust-region reflective least squares on the residuals of all records, residual and
    Jacobian from one population of 2 n_free + 1 candidates. A step into a region that diverges is shortened; an
    estimate that the box holds ends on the box exactly.
    x0: free parameters, SI, shape (n_free,), moved into the box. weights: one for each record [1/unit], None: 1/noise
    rms, or 1 for all where a record has no noise. tolerance: relative change of cost and of step at which to stop.
    Returns free parameters, SI, shape (n_free,).

    Raises ArmidError when the start diverges.
    Source: Branch, Coleman, Li 1999, doi:10.1137/S1064827595289108.
    """
    told = noise_weights(replays) if weights is None else tuple(float(w) for w in weights)
    records = WeightedRecords(replays, space, told)
    if not space.free.any():
        return np.empty(0)
    return records.values(fit(records, records.shares(np.asarray(x0, dtype=np.float64)), tolerance))


def fit(records: WeightedRecords, z0: Array, tolerance: float = 1e-9) -> Array:
    """Return the local least-squares estimate from a start, both as shares of the range."""
    start = np.clip(z0, 0.0, 1.0)
    known: dict[bytes, tuple[Array, Array]] = {}

    def both(z: Array) -> tuple[Array, Array]:
        if z.tobytes() not in known:
            known.clear()
            known[z.tobytes()] = records.residual_and_slopes(z)
        return known[z.tobytes()]

    if not np.isfinite(both(start)[0]).all():
        raise ArmidError("a fit cannot start where the simulation diverges: another start is expected")
    anchor = ANCHOR * (float(np.linalg.norm(both(start)[1])) or 1.0)

    def residual(z: Array) -> Array:
        return np.concatenate([both(z)[0], anchor * (z - start)])

    def slopes(z: Array) -> Array:
        return np.concatenate([both(z)[1], anchor * np.eye(len(z))])

    found = least_squares(
        residual, start, slopes, bounds=(0.0, 1.0), method="trf", x_scale="jac",
        ftol=tolerance, xtol=tolerance, gtol=None, max_nfev=MOST_EVALUATIONS,
    )  # fmt: skip
    best = np.asarray(found.x, dtype=np.float64)
    return start if records.chi2(start)[0] < 2.0 * found.cost else onto_the_box(records, best, 2.0 * float(found.cost))


def onto_the_box(records: WeightedRecords, z: Array, chi2: float) -> Array:
    """Return the estimate with shares near 0 or 1 put there, one by one, where that does not raise the sum of squares.

    The search keeps strictly inside, so that an estimate that the box holds stops short of it.
    """
    best = z
    for i in np.flatnonzero((z < NEAR) | (z > 1.0 - NEAR)):
        tried = best.copy()
        tried[i] = np.round(best[i])
        value = float(records.chi2(tried)[0])
        if value <= chi2:
            best, chi2 = tried, value
    return best


def estimate(replays: tuple[Replay, ...], space: Space, weights: Sequence[float] | None = None) -> Array:
    """Return the least-squares estimate without a start: the best of fits from the best of candidates over the box.

    Deterministic: 400 candidates of a Kronecker sequence, fits from the 4 best of them. Free parameters, SI, (n_free,).

    Raises ArmidError when every candidate diverges.
    """
    told = noise_weights(replays) if weights is None else tuple(float(w) for w in weights)
    records = WeightedRecords(replays, space, told)
    n = int(space.free.sum())
    if n == 0:
        return np.empty(0)
    spread = probes(np.zeros(n), np.ones(n), N_SPREAD)
    values = records.chi2(spread)
    order = np.argsort(values, kind="stable")[:N_STARTS]
    starts = [spread[i] for i in order if np.isfinite(values[i])]
    if not starts:
        raise ArmidError(f"each of {N_SPREAD} candidates spread over the box diverged: other bounds are expected")
    fits = [fit(records, start) for start in starts]
    return records.values(fits[int(np.argmin([records.chi2(z)[0] for z in fits]))])
