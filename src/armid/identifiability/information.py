"""How well records pin down parameters: sensitivities, Fisher information, intervals, correlations."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armid.problem.replay import Replay
from armid.problem.space import Space

Array = NDArray[np.float64]
# Step of the central differences, as a share of the range: above rounding, below curvature.
STEP = 1e-4
NORMAL_95 = 1.959963984540054
# Directions whose information is below this share of the strongest cannot be told from nothing.
SINGULAR = 1e-13


@dataclass(frozen=True)
class Information:
    """Hold what the records say about the free parameters at one candidate.

    deviation: standard deviation of each, SI, infinite where the records do not determine it, shape (n_free,).
    correlation: of the estimates, shape (n_free, n_free), NaN where not determined.
    """

    names: tuple[str, ...]
    deviation: Array
    correlation: Array

    @property
    def half_width(self) -> Array:
        """Half of the 95 % interval, SI."""
        return NORMAL_95 * self.deviation


def sensitivities(replay: Replay, space: Space, x: Array) -> Array:
    """Return d signal / d parameter x range in the windows of a record, shape (n_samples, n_free).

    Central differences with steps of 1e-4 of the range, moved inside the box where they would leave it; all perturbed
    candidates run as one population.
    """
    low, high = space.low[space.free], space.high[space.free]
    step = STEP * (high - low)
    centre = np.clip(x, low + step, high - step)
    moves = np.diag(step)
    signal = replay.signal(space.complete(np.concatenate([centre + moves, centre - moves])))
    n = len(x)
    return (signal[:n] - signal[n:]).T / (2.0 * STEP)


def information_at(replays: tuple[Replay, ...], space: Space, x: Array) -> Information:
    """Return intervals and correlations at a candidate, from the sensitivities and the measured noise.

    Fisher information F = sum over records of f J^T J / noise^2 with f the share of samples that are independent;
    covariance = F^-1 (the Cramer-Rao bound of an unbiased estimate). A noise-free record gives no interval but 0.
    x: free parameters, SI, shape (n_free,).
    """
    span = space.high[space.free] - space.low[space.free]
    noise_free = any(r.record.noise.rms == 0.0 for r in replays)
    total = np.zeros((len(x), len(x)))
    for replay in replays:
        noise = replay.record.noise
        jacobian = sensitivities(replay, space, x)
        weight = 1.0 if noise_free else noise.effective_fraction / noise.rms**2
        total += weight * jacobian.T @ jacobian
    covariance = inverse(total)
    deviation = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(deviation, deviation)
    correlation[~np.isfinite(correlation)] = np.nan
    known = np.isfinite(deviation)
    return Information(space.free_names, np.where(known & noise_free, 0.0, deviation * span), correlation)


def inverse(matrix: Array) -> Array:
    """Return the inverse of an information matrix, infinite variance for what it does not determine."""
    scale = np.sqrt(np.diag(matrix))
    seen = np.isfinite(scale) & (scale > 0.0)
    result = np.full(matrix.shape, np.nan)
    np.fill_diagonal(result, np.inf)
    if not seen.any():
        return result
    scaled = matrix[np.ix_(seen, seen)] / np.outer(scale[seen], scale[seen])
    values, vectors = np.linalg.eigh(scaled)
    good = values > SINGULAR * values.max()
    part = (vectors[:, good] / values[good]) @ vectors[:, good].T
    lost = (vectors[:, ~good] ** 2).sum(axis=1) > 1e-6
    part /= np.outer(scale[seen], scale[seen])
    part[lost, :], part[:, lost] = np.nan, np.nan
    part[lost, lost] = np.inf
    result[np.ix_(seen, seen)] = part
    return result


def collinear(information: Information, above: float = 0.95) -> list[tuple[str, str, float]]:
    """Return the pairs of parameters that cannot be told apart well, strongest first: names and correlation."""
    names, correlation = information.names, information.correlation
    pairs = [
        (names[i], names[j], float(correlation[i, j]))
        for i in range(len(names)) for j in range(i) if abs(correlation[i, j]) > above
    ]  # fmt: skip
    return sorted(pairs, key=lambda pair: -abs(pair[2]))
