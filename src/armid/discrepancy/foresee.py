"""What rival models predict for manoeuvres that nobody has made yet, and how far apart they will be."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky

from armid.identifiability import WeightedRecords
from armid.identifiability.manoeuvres import Feasible
from armid.identifiability.motions import Motions
from armid.identifiability.purchase import BOX

Array = NDArray[np.float64]
Whitening = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Rival:
    """Hold a fitted model that others cannot be told from.

    records: the least-squares problem of the records there are. z: its estimate, shares of the range, (n_free,).
    criterion: what the loop judges it by, smaller is better; differences are those of chi2 plus what parameters cost.
    """

    name: str
    records: WeightedRecords
    z: Array
    criterion: float

    @property
    def candidate(self) -> Array:
        """The estimate as a whole candidate, SI."""
        return np.asarray(self.whole(self.z[np.newaxis])[0])

    def whole(self, Z: Array) -> Array:
        """Return whole candidates, SI, of shares that may lie outside the box, where they are put onto it."""
        return self.records.space.complete(self.records.values(Z))

    @cached_property
    def precision(self) -> Array:
        """Triangular factor L of the information L L^T of the records about z, the box counting as a first record."""
        _, slopes = self.records.residual_and_slopes(self.z)
        return np.asarray(cholesky(slopes.T @ slopes + BOX * np.eye(len(self.z)), lower=True))

    @cached_property
    def root(self) -> Array:
        """Factor so that root root^T is the covariance of z: each column is a move of one standard deviation."""
        return np.asarray(np.linalg.inv(self.precision).T)


@dataclass(frozen=True, eq=False)
class Forecast:
    """Hold what one rival predicts for one manoeuvre, whitened: the signal (n_samples,) and its spread.

    spread: (n_samples, n_free) so that spread spread^T is the covariance of the prediction that the uncertainty of the
    fitted parameters makes.
    """

    signal: Array
    spread: Array


def outside(Z: Array) -> Array:
    """Return how far candidates in shares of the range reach out of the box, (n_candidates,)."""
    return np.asarray(np.abs(Z - np.clip(Z, 0.0, 1.0)).max(axis=-1))


def forecasts_of(
    rival: Rival, grid: Sequence[Feasible], white: Whitening, speed_limit: float | None
) -> Mapping[Feasible, Forecast]:
    """Return what a rival predicts for each manoeuvre that the machine could make if the rival were right.

    The spread comes from differences over a standard deviation to either side, not from derivatives: a switch that
    moves by many samples does not move in proportion. Of two sides the one that the box cuts off less counts alone: an
    effect at its null can only grow.
    """
    motions = Motions(rival.records.replays, rival.candidate, speed_limit)
    above, below = rival.z + rival.root.T, rival.z - rival.root.T
    points = rival.whole(np.concatenate([rival.z[np.newaxis], above, below]))
    n, found = len(rival.z), {}
    upward = np.where(outside(above) < outside(below), 1.0, np.where(outside(above) > outside(below), 0.0, 0.5))
    for feasible, signals in motions.signals(grid, points):
        seen = white(signals)
        found[feasible] = Forecast(seen[0], spread_of(seen[0], seen[1 : n + 1], seen[n + 1 :], upward))
    return found


def spread_of(here: Array, above: Array, below: Array, upward: Array) -> Array:
    """Return what moves of a standard deviation do, (n_samples, n_free); upward: the share of the upper side."""
    return np.asarray(((above - here).T * upward) + ((here - below).T * (1.0 - upward)))


def chance(right: Forecast, wrong: Forecast, old: float, draws: Array, threshold: float) -> tuple[float, float]:
    """Return the chance that the right model wins by more than a threshold, and the squared distance delta^2.

    After both are fitted again, the criterion of the wrong one less that of the right one is
    D = old + r_B^T V_B^-1 r_B - r_A^T V_A^-1 r_A, r the new record less the prediction, V = 1 + spread spread^T its
    covariance; the record comes from A as it is known by now; delta^2 = d^T V_B^-1 d, d the difference of predictions.
    old: by how much the criterion favours A already. draws: standard normal, (n_draws, at least 1 + n_free of both).
    All that matters happens in the space of the difference and of both spreads, which has few dimensions.
    """
    difference = right.signal - wrong.signal
    reduced = np.linalg.qr(np.column_stack([difference, right.spread, wrong.spread]), mode="r")
    ends = np.cumsum([1, right.spread.shape[1]])
    d, of_right, of_wrong = np.split(reduced, ends, axis=1)
    one = np.eye(len(reduced))
    factor = cholesky(one + of_right @ of_right.T, lower=True)
    # small inverses: solving for many columns would start threads
    weight = np.linalg.inv(one + of_wrong @ of_wrong.T)
    normal = draws[:, : len(reduced)]
    missed = normal @ factor.T + d[:, 0]
    gained = np.sum(missed @ weight * missed, axis=1) - np.sum(normal**2, axis=1)
    return float(np.mean(old + gained > threshold)), float(d[:, 0] @ weight @ d[:, 0])
