"""What one more record would buy: the intervals to expect from each manoeuvre that could be made next."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armid.identifiability.information import Level, inverse
from armid.identifiability.manoeuvres import Feasible
from armid.identifiability.motions import Motions
from armid.identifiability.weighted import STEP
from armid.problem.space import Space

Array = NDArray[np.float64]
# Before any record the box is all that is known: variance range^2/12, so 12 of information in shares of the range.
BOX = 12.0
VOLUME, WORST, SHRINKAGE = "volume", "worst", "shrinkage"


@dataclass(frozen=True, eq=False)
class Offer:
    """Hold what one more record of a manoeuvre would give.

    before, after: standard deviations, SI, shape (n_free,), infinite where not determined. gain: what offers are ranked
    by, above 1 where the record helps: by "volume" the mean factor by which deviations shrink (D-optimality), by
    "worst" the factor of the worst parameter as a share of its range, by "shrinkage" the largest factor of all.
    """

    feasible: Feasible
    before: Array
    after: Array
    gain: float

    @property
    def best(self) -> int:
        """Place of the parameter whose deviation shrinks most."""
        with np.errstate(invalid="ignore"):
            factors = self.before / self.after
        return int(np.argmax(np.nan_to_num(factors, nan=1.0, posinf=np.inf)))


def offers(
    motions: Motions, grid: Iterable[Feasible], space: Space, x: Array, fisher: Array, level: Level, by: str = VOLUME
) -> tuple[Offer, ...]:
    """Return what each feasible manoeuvre would buy, the best first.

    F' = F + f J^T J / level^2 with J the sensitivities in the new record; deviations are those of F'^-1. Ranking counts
    the box as a first record, so that what is not determined yet has a finite deviation, too.
    motions: at the estimate. x: the estimate, SI, (n_free,). fisher: information of the records, in shares of the
    range, (n_free, n_free). level: expected of the new record. by: "volume", "worst" or "shrinkage".
    """
    span = space.high[space.free] - space.low[space.free]
    found = []
    for feasible, jacobian in jacobians(motions, grid, space, x):
        more = fisher + level.effective_fraction / level.rms**2 * jacobian.T @ jacobian
        found.append(Offer(feasible, deviations(fisher) * span, deviations(more) * span, gain(fisher, more, by)))
    return tuple(sorted(found, key=lambda offer: -offer.gain))


def jacobians(motions: Motions, grid: Iterable[Feasible], space: Space, x: Array) -> Iterable[tuple[Feasible, Array]]:
    """Yield d signal / d share of range of each feasible manoeuvre, shape (n_samples, n_free), central differences."""
    low, high = space.low[space.free], space.high[space.free]
    z = np.clip((x - low) / (high - low), STEP, 1.0 - STEP)
    moves = STEP * np.eye(len(z))
    candidates = space.complete(low + np.concatenate([z + moves, z - moves]) * (high - low))
    for feasible, signals in motions.signals(grid, candidates):
        yield feasible, (signals[: len(z)] - signals[len(z) :]).T / (2.0 * STEP)


def deviations(fisher: Array) -> Array:
    """Return the standard deviations, shares of the range, infinite where not determined."""
    return np.sqrt(np.diag(inverse(fisher)))


def gain(fisher: Array, more: Array, by: str) -> float:
    """Return by what factor deviations shrink from one information matrix to a larger one."""
    known = BOX * np.eye(len(fisher))
    if by == VOLUME:
        volumes = np.linalg.slogdet(more + known)[1] - np.linalg.slogdet(fisher + known)[1]
        return float(np.exp(0.5 * volumes / len(fisher)))
    before, after = (np.sqrt(np.diag(np.linalg.inv(m + known))) for m in (fisher, more))
    return float(before.max() / after.max() if by == WORST else np.max(before / after))


def expected_level(levels: Sequence[Level]) -> Level:
    """Return the level to expect of a new record: the mean square and the mean share of independent samples."""
    rms = float(np.sqrt(np.mean([level.rms**2 for level in levels])))
    share = float(np.mean([level.effective_fraction for level in levels]))
    return Level(rms, share, any(level.from_residual for level in levels), any(level.assumed for level in levels))
