"""Rehearse a record that nobody has made yet: simulate it from one rival and fit all of them again."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from armid.discrepancy.descend import descend
from armid.discrepancy.foresee import Rival, Whitening, outside
from armid.identifiability import WeightedRecords
from armid.identifiability.manoeuvres import Feasible
from armid.identifiability.motions import fine_schedule
from armid.simulation import simulate

Array = NDArray[np.float64]
TOLERANCE = 1e-5


@dataclass(frozen=True, eq=False)
class Joint(WeightedRecords):
    """Pose the old records, as a parabola about their estimate, and one new record as one least-squares problem.

    rival: fitted to the old records. feasible, white: the new record's manoeuvre and what makes its noise white.
    seen: the new record, whitened, (n_samples,).
    """

    rival: Rival = field(kw_only=True)
    feasible: Feasible = field(kw_only=True)
    white: Whitening = field(kw_only=True)
    seen: Array = field(kw_only=True)

    def predicted(self, Z: Array) -> Array:
        """Return the whitened signal in the new record of candidates in shares, (n_candidates, n_samples)."""
        return foreseen(self.rival, self.feasible, self.white, Z)

    @cached_property
    def measured(self) -> Array:
        """Zeros for the parabola, then the new record."""
        return np.concatenate([np.zeros(len(self.rival.z)), self.seen])

    def signals(self, Z: Array) -> Array:
        """Return how far candidates are from the old estimate, in standard deviations, then their new signals."""
        return np.concatenate([(Z - self.rival.z) @ self.rival.precision, self.predicted(Z)], axis=1)


def foreseen(rival: Rival, feasible: Feasible, white: Whitening, Z: Array) -> Array:
    """Return the whitened signal of candidates in shares of the range, (n_candidates, n_samples)."""
    replays = rival.records.replays
    run = simulate(replays[0].model, feasible.manoeuvre, rival.whole(Z), fine_schedule(replays))
    return np.asarray(white(run.output[:, feasible.window]))


def rehearse(
    rivals: Sequence[Rival], right: int, feasible: Feasible, white: Whitening, draws: Array, threshold: float
) -> tuple[Array, Array]:
    """Return the chance that each other rival loses to the right one by more than a threshold, and its distance.

    The record is simulated without noise from the right model as it is known by now, once for each draw, and every
    rival is fitted again to old and new. Noise then scatters the difference D of the criteria by twice the distance of
    the fitted predictions: the chance is Phi((D - threshold)/(2 distance)).
    draws: standard normal, (n_draws, at least n_free). Returns chances (n_rivals,), of the right one 1, and
    distances in standard deviations of the noise, (n_rivals,). A draw whose simulation diverges says nothing.
    """
    true = rivals[right]
    chances, distances = [], []
    for draw in draws:
        seen = foreseen(true, feasible, white, drawn(true, draw)[np.newaxis])[0]
        if not np.isfinite(seen).all():
            continue
        values, predictions = zip(*(fitted_again(r, feasible, white, seen) for r in rivals), strict=True)
        apart = np.array([np.linalg.norm(p - predictions[right]) for p in predictions])
        margin = np.array(values) - values[right] - threshold
        won = norm.cdf(margin / np.maximum(2.0 * apart, 1e-9))
        won[right] = 1.0
        chances.append(won)
        distances.append(apart)
    if not chances:
        return np.zeros(len(rivals)), np.zeros(len(rivals))
    return np.mean(chances, axis=0), np.mean(distances, axis=0)


def drawn(rival: Rival, draw: Array) -> Array:
    """Return what the parameters may be, shares of the range: a draw, or its mirror where that is less outside."""
    move = rival.root @ draw[: len(rival.z)]
    both = np.array([rival.z + move, rival.z - move])
    return np.asarray(both[int(np.argmin(outside(both)))])


def fitted_again(rival: Rival, feasible: Feasible, white: Whitening, seen: Array) -> tuple[float, Array]:
    """Return the criterion and the whitened prediction of a rival after a fit to old and new.

    A rival that diverges wherever it starts is as far off as a model can be: the record itself is its distance.
    """
    space = rival.records.space
    joint = Joint((), space, (), rival=rival, feasible=feasible, white=white, seen=seen)
    start = np.clip(rival.z, 0.0, 1.0)
    if not np.isfinite(joint.chi2(start)[0]):
        return rival.criterion + float(seen @ seen), np.zeros_like(seen)
    z = descend(joint, [start], TOLERANCE)
    return rival.criterion + float(joint.chi2(z)[0]), joint.predicted(z[np.newaxis])[0]
