"""Least squares inside the box, from a start that is near: what a search or a neighbouring fit has found."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from armid.engine import probes
from armid.errors import ArmidError
from armid.problem.replay import Replay
from armid.problem.space import Space

Array = NDArray[np.float64]
# Step of the central differences, as a share of the range: above rounding, below curvature.
STEP = 1e-4


@dataclass(frozen=True, eq=False)
class WeightedRecords:
    """Hold records, the space, and the weight of each record: chi2(x) = sum over records of weight^2 |residual|^2.

    weights: [1/unit of the record], shape (n_records,); free parameters stand as shares z of their range, in 0 to 1.
    """

    replays: tuple[Replay, ...]
    space: Space
    weights: tuple[float, ...]

    @property
    def span(self) -> Array:
        """Range of the free parameters, SI, shape (n_free,)."""
        return self.space.high[self.space.free] - self.space.low[self.space.free]

    def shares(self, x: Array) -> Array:
        """Return free parameters (SI) as shares of their range, shape (n_free,)."""
        return np.asarray((x - self.space.low[self.space.free]) / self.span)

    def values(self, z: Array) -> Array:
        """Return shares of the range as free parameters, SI, never outside the box by rounding."""
        low, high = self.space.low[self.space.free], self.space.high[self.space.free]
        return np.clip(low + z * self.span, low, high)

    @cached_property
    def measured(self) -> Array:
        """Weighted measured signals of all records, end to end, shape (n_samples,)."""
        return np.concatenate([w * r.measured for w, r in zip(self.weights, self.replays, strict=True)])

    def signals(self, Z: Array) -> Array:
        """Return weighted simulated signals of candidates in shares, shape (n_candidates, n_samples)."""
        whole = self.space.complete(self.values(Z))
        parts = [w * r.signal(whole) for w, r in zip(self.weights, self.replays, strict=True)]
        return np.concatenate(parts, axis=1)

    def residual(self, z: Array) -> Array:
        """Return simulated minus measured at one candidate, weighted, (n_samples,); NaN where it diverges."""
        return np.asarray(self.signals(z[np.newaxis])[0] - self.measured)

    def chi2(self, Z: Array) -> Array:
        """Return the weighted sum of squares of candidates, (n_candidates,), infinite where one diverges."""
        total = np.sum((self.signals(np.atleast_2d(Z)) - self.measured) ** 2, axis=1)
        return np.where(np.isfinite(total), total, np.inf)

    def residual_and_slopes(self, z: Array) -> tuple[Array, Array]:
        """Return the residual (n_samples,) and d residual / d z (n_samples, n_free), all in one population.

        Central differences, their steps moved inside the box; where one side diverges the other stands alone, where
        both do the slope is 0.
        """
        n, moves = len(z), STEP * np.eye(len(z))
        centre = np.clip(z, STEP, 1.0 - STEP)
        points = np.concatenate([z[np.newaxis], centre + moves, centre - moves])
        signals = self.signals(points)
        above, below = signals[1 : n + 1], signals[n + 1 :]
        slopes = (above - below) / (2.0 * STEP)
        for i in np.flatnonzero(~np.isfinite(slopes).all(axis=1)):
            slopes[i] = self.one_sided(signals[0], above[i], below[i], float(centre[i] - z[i]))
        return np.asarray(signals[0] - self.measured), np.ascontiguousarray(slopes.T)

    @staticmethod
    def one_sided(here: Array, above: Array, below: Array, shift: float) -> Array:
        """Return the slope from the side that holds, 0 where neither does; shift: of the centre from the candidate."""
        for signal, step in ((above, STEP + shift), (below, shift - STEP)):
            if step != 0.0 and np.isfinite(signal).all() and np.isfinite(here).all():
                return np.asarray((signal - here) / step)
        return np.zeros_like(here)


def noise_weights(replays: Sequence[Replay]) -> tuple[float, ...]:
    """Return 1/noise rms of each record; 1 for all where one record has no noise (the noise-free cannot be weighed)."""
    levels = [r.record.noise.rms for r in replays]
    return tuple(1.0 if min(levels) == 0.0 else 1.0 / level for level in levels)


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
