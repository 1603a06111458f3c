"""Weighted residuals of records and their derivatives, from one population a call."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

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
