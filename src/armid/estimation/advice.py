"""Which manoeuvre would tell rival models apart: the record to make next when the ones there are cannot.

All manoeuvres are predicted (linear in the parameters, see `chance`); for the best of them the whole is simulated: a
record from each rival in turn, as uncertain as it is known by now, and all rivals fitted again (see `simulate_refits`).
The best is the one whose record lets the entropy of the posterior over the rivals fall most, as expected before it is
made (Lindley 1956, doi:10.1214/aoms/1177728069; Box, Hill 1967, doi:10.1080/00401706.1967.10490441).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.linalg import cholesky
from scipy.special import ndtr, ndtri, softmax, xlogy

from armid.engine import probes, simulate
from armid.errors import ArmidError
from armid.estimation.design import BOX, Feasible, Key, Motions, fine_schedule
from armid.estimation.least_squares import LeastSquaresProblem, descend, side_by_side
from armid.model import Array

Whitening = Callable[[Array], Array]
Pair = tuple[int, int]
Powers = Mapping[Pair, tuple[float, float]]
# Difference of the criterion from which on the loop takes one model for better than another.
BETTER_BY = 6.0
# Draws of what the parameters may be: in the linear prediction, and of each rival whose record is simulated.
N_DRAWS, N_REFIT_DRAWS = 512, 4
# So many fits all simulations may take, each of so many samples; it decides how many manoeuvres are simulated, but not
# below the fewest.
MOST_FITS, OF_SAMPLES, FEWEST_SIMULATED = 160, 6000, 2
# Rivals that a manoeuvre tells apart no more often than this are not listed as separated by it.
OFTEN = 0.5
REFIT_TOLERANCE = 1e-3
# Draws of the noise of one record.
N_NOISES = 64
# Shares of a draw that are tried, and how many times the foretold rise of the sum of squares a share may bring.
SHORTER, MOST_RISE = 0.5 ** np.arange(8), 2.0


@dataclass(frozen=True)
class Advice:
    """A manoeuvre that is advised.

    words: its keys for people. gain: expected fall of the entropy of the posterior over the rivals, bit. separates:
    names of the rivals that its record is expected to tell apart. power: chance that the right one of any two of
    them wins by more than the threshold, the lowest of the pairs, whichever of the two is right. delta: distance of
    their predictions after both were fitted again, in standard deviations, of that pair.
    """

    manoeuvre: Mapping[str, Key]
    words: str
    gain: float
    separates: tuple[str, ...]
    power: float
    delta: float


@dataclass(frozen=True, eq=False)
class Rival:
    """A fitted model with rivals that the records cannot separate.

    z: its estimate, shares of the range, (n_free,). criterion: -2 times its log posterior, up to a constant. trust:
    what a sample counts, below 1 where more than noise is left. constants: by which share of its value each is off.
    """

    name: str
    records: LeastSquaresProblem
    z: Array
    criterion: float
    trust: float = 1.0
    constants: Mapping[str, float] = field(default_factory=dict)

    @property
    def candidate(self) -> Array:
        return np.asarray(self.records.whole(self.z[np.newaxis])[0])

    @cached_property
    def precision(self) -> Array:
        """Triangular factor L of the information L L^T of the records about z, the box counting as a first record."""
        _, slopes = self.records.residual_and_slopes(self.z)
        return np.asarray(cholesky(self.trust * slopes.T @ slopes + BOX * np.eye(len(self.z)), lower=True))

    @cached_property
    def root(self) -> Array:
        """Factor so that root root^T is the covariance of z: each column is a move of one standard deviation."""
        return np.asarray(np.linalg.inv(self.precision).T)

    def old(self, Z: Array) -> Array:
        """Return the whitened signals of the records and the candidates in units of the box, (n_candidates, n)."""
        return np.hstack([np.sqrt(self.trust) * self.records.signals(Z), np.sqrt(BOX) * Z])

    def drawn(self, draw: Array) -> Array:
        """Return a candidate that the records allow: so far along a draw as they rise by what is foretold of it.

        Where parameters make up for each other, the way on which they do bends, and a straight move leaves it.
        """
        move = self.root @ draw[: len(self.z)]
        both = np.array([move, -move])
        side = both[int(np.argmin(outside(self.z + both)))]
        tried = self.z + SHORTER[:, np.newaxis] * side
        rise = self.trust * (self.records.chi2(tried) - float(self.records.chi2(self.z)[0]))
        foretold = SHORTER**2 * float(draw[: len(self.z)] @ draw[: len(self.z)])
        allowed = np.flatnonzero(rise <= MOST_RISE * foretold + 1.0)
        return np.asarray(tried[allowed[0]] if allowed.size else self.z)


# Whitened signals of a new record that a rival gives at candidates in shares, (n_candidates, n).
NewSignals = Callable[[Rival, Array], Array]


def advise(
    rivals: Sequence[Rival],
    white: Whitening,
    grid: Sequence[Feasible],
    speed_limit: float | None = None,
    threads: int = 1,
) -> tuple[Advice, ...]:
    """Rank feasible manoeuvres by how well one record of each would tell the rivals apart, the best first.

    Only manoeuvres that were simulated are returned, ranked by their gain, then by the mean distance.
    rivals: two or more, fitted to the same records. white: turns signals of a new record, (n_outputs, n_signals,
    n_samples), into units of white noise, (n_signals, n). grid: with the constants as declared. speed_limit: of the
    gyro.
    """
    if len(rivals) < 2:
        raise ArmidError(f"{len(rivals)} model was given: at least two are expected")
    predictions = side_by_side(lambda rival: predictions_of(rival, grid, white, speed_limit), rivals, threads)
    draws = normal_draws(1 + sum(len(r.z) for r in rivals), N_DRAWS)
    possible = [f for f in grid if all(f in known for known in predictions)]
    powers = {f: predicted_powers(rivals, [p[f] for p in predictions], draws) for f in possible}
    fits = int(MOST_FITS * min(OF_SAMPLES / len(rivals[0].records.measured), 1.0))
    most = max(fits // (len(rivals) ** 2 * N_REFIT_DRAWS), FEWEST_SIMULATED)
    promising = sorted(possible, key=lambda f: rank(mean_of(powers[f], 0), powers[f]), reverse=True)[:most]
    draws = normal_draws(max(len(r.z) for r in rivals), N_REFIT_DRAWS)
    outcomes = side_by_side(lambda f: simulated(rivals, f, white, draws), promising, threads)
    ranking = [(f, *one) for f, one in zip(promising, outcomes, strict=True)]
    now = max(float(entropy(probabilities(rivals))), 1e-9)
    ranking.sort(key=lambda e: rank(e[1] / now, e[2]), reverse=True)
    return tuple(advice_of(rivals, *one) for one in ranking)


def rank(merit: float, powers: Powers) -> tuple[float, float]:
    """Return what manoeuvres are ranked by: a merit in steps of a hundredth, then the mean distance over pairs."""
    return round(merit, 2), mean_of(powers, 1)


def mean_of(powers: Powers, place: int) -> float:
    """Return the mean over pairs of the powers (place 0) or of the distances (1)."""
    return float(np.mean([p[place] for p in powers.values()]))


def advice_of(rivals: Sequence[Rival], feasible: Feasible, gain: float, powers: Powers) -> Advice:
    """Return the advice for one manoeuvre: the largest set of rivals that it often tells apart, or the best pair."""
    for size in range(len(rivals), 1, -1):
        weakest = {s: min(powers[pair] for pair in combinations(s, 2)) for s in combinations(range(len(rivals)), size)}
        best = max(weakest, key=lambda s: weakest[s])
        if weakest[best][0] >= OFTEN:
            break
    return Advice(dict(feasible.keys), feasible.name, gain, tuple(rivals[i].name for i in best), *weakest[best])


def normal_draws(n_dimensions: int, n_draws: int) -> Array:
    return np.asarray(ndtri(probes(np.zeros(n_dimensions), np.ones(n_dimensions), n_draws)))


def outside(Z: Array) -> Array:
    """Return how far candidates in shares of the range reach out of the box, (n_candidates,)."""
    return np.asarray(np.abs(Z - np.clip(Z, 0.0, 1.0)).max(axis=-1))


@dataclass(frozen=True, eq=False)
class Prediction:
    """What one rival predicts for one manoeuvre, whitened: the signal, (n_samples,), and spread, (n_samples, n_free).

    spread spread^T is the covariance of the prediction that the uncertainty of the fitted parameters makes.
    """

    signal: Array
    spread: Array


def predictions_of(
    rival: Rival, grid: Sequence[Feasible], white: Whitening, speed_limit: float | None
) -> Mapping[Feasible, Prediction]:
    """Return what a rival predicts for each manoeuvre that the machine could make if the rival were right.

    The spread comes from differences over a standard deviation to either side, not from derivatives: a switch that
    moves by many samples does not move in proportion. Of two sides the one that the box cuts off less counts alone: an
    effect at its null can only grow.
    """
    motions = Motions(rival.records.replays, rival.candidate, speed_limit, rival.constants)
    above, below = rival.z + rival.root.T, rival.z - rival.root.T
    points = rival.records.whole(np.concatenate([rival.z[np.newaxis], above, below]))
    n, predictions = len(rival.z), {}
    upward = np.where(outside(above) < outside(below), 1.0, np.where(outside(above) > outside(below), 0.0, 0.5))
    for feasible, signals in motions.signals(grid, points):
        seen = white(signals)
        predictions[feasible] = Prediction(seen[0], spread_of(seen[0], seen[1 : n + 1], seen[n + 1 :], upward))
    return predictions


def spread_of(here: Array, above: Array, below: Array, upward: Array) -> Array:
    """Return what moves of a standard deviation do, (n_samples, n_free); upward: the share of the upper side."""
    return np.asarray(((above - here).T * upward) + ((here - below).T * (1.0 - upward)))


def predicted_powers(rivals: Sequence[Rival], predictions: Sequence[Prediction], draws: Array) -> Powers:
    powers = {}
    for a, b in combinations(range(len(rivals)), 2):
        old = rivals[b].criterion - rivals[a].criterion
        one = chance(predictions[a], predictions[b], old, draws)
        other = chance(predictions[b], predictions[a], -old, draws)
        powers[a, b] = (0.5 * (one[0] + other[0]), float(np.sqrt(0.5 * (one[1] + other[1]))))
    return powers


def chance(right: Prediction, wrong: Prediction, old: float, draws: Array) -> tuple[float, float]:
    """Return the chance that the right model wins by more than the threshold, and the squared distance delta^2.

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
    return float(np.mean(old + gained > BETTER_BY)), float(d[:, 0] @ weight @ d[:, 0])


@dataclass(frozen=True, eq=False)
class OldAndNew(LeastSquaresProblem):
    """Pose the old records, as the rival predicts them, and one new record as one least-squares problem.

    The box counts as a first record. A parabola in place of the old records would be steep across a way on which
    parameters make up for each other, where that bends.
    """

    rival: Rival
    new: NewSignals
    seen: Array

    @cached_property
    def measured(self) -> Array:
        return np.concatenate([self.rival.old(self.rival.z[np.newaxis])[0], self.seen])

    def signals(self, Z: Array) -> Array:
        return np.concatenate([self.rival.old(Z), self.new(self.rival, Z)], axis=1)


def simulated(
    rivals: Sequence[Rival], feasible: Feasible, white: Whitening, draws: Array
) -> tuple[float, Powers]:  # fmt: skip
    """Return gain and powers of one manoeuvre."""

    def new(rival: Rival, Z: Array) -> Array:
        records = rival.records
        manoeuvre = feasible.of(records.model.plant, rival.constants)
        run = simulate(records.model, manoeuvre, records.whole(Z), fine_schedule(records.replays))
        places = sorted({r.place for r in records.replays})
        return np.asarray(white(run.outputs[places][..., feasible.window]))

    tried = [simulate_refits(rivals, i, new, draws) for i in range(len(rivals))]
    now = probabilities(rivals)
    after = sum(float(p) * left for p, (*_, left) in zip(now, tried, strict=True))
    chances, distances = (np.array([t[k] for t in tried]) for k in (0, 1))
    return float(entropy(now)) - after, {
        (a, b): (float(0.5 * (chances[a, b] + chances[b, a])), float(0.5 * (distances[a, b] + distances[b, a])))
        for a, b in combinations(range(len(rivals)), 2)
    }


def probabilities(rivals: Sequence[Rival]) -> Array:
    """Return the posterior over the rivals, (n_rivals,)."""
    return np.asarray(softmax([-0.5 * r.criterion for r in rivals]))


def entropy(shares: Array) -> Array:
    """Return the entropy of distributions along the first axis, bit."""
    return np.asarray(-np.sum(xlogy(shares, shares), axis=0) / np.log(2.0))


def simulate_refits(
    rivals: Sequence[Rival], right: int, new: NewSignals, draws: Array
) -> tuple[Array, Array, float]:  # fmt: skip
    """Return the chance that each other rival loses to the right one by more than the threshold, and its distance.

    Then the expected entropy of the posterior, bit. The record is simulated without noise from the right model as it is
    known by now, once for each draw, and every rival is fitted again to old and new. Noise then scatters the difference
    D of the criteria by twice the distance of the fitted predictions: the chance is Phi((D - THRESHOLD)/(2 distance)).
    draws: standard normal, (n_draws, at least n_free). A draw whose simulation diverges says nothing.
    """
    true = rivals[right]
    noises = normal_draws(len(rivals), N_NOISES).T
    chances, distances, left = [], [], [float(entropy(probabilities(rivals)))]
    for draw in draws:
        seen = new(true, true.drawn(draw)[np.newaxis])[0]
        if not np.isfinite(seen).all():
            continue
        values, signals = zip(*(fitted_again(r, new, seen) for r in rivals), strict=True)
        apart = np.array([np.linalg.norm(s - signals[right]) for s in signals])
        margin = np.array(values) - values[right] - BETTER_BY
        won = ndtr(margin / np.maximum(2.0 * apart, 1e-9))
        won[right] = 1.0
        chances.append(won)
        distances.append(apart)
        scattered = np.array(values)[:, np.newaxis] + 2.0 * apart[:, np.newaxis] * noises
        left.append(float(np.mean(entropy(softmax(-0.5 * scattered, axis=0)))))
    if not chances:
        return np.zeros(len(rivals)), np.zeros(len(rivals)), left[0]
    return np.mean(chances, axis=0), np.mean(distances, axis=0), float(np.mean(left[1:]))


def fitted_again(rival: Rival, new: NewSignals, seen: Array) -> tuple[float, Array]:
    """Return criterion and prediction of a rival after a fit to old and new; of one that diverges 0 throughout."""
    both = OldAndNew((), rival.records.space, rival, new, seen)
    start = np.clip(rival.z, 0.0, 1.0)
    if not np.isfinite(both.chi2(start)[0]):
        return rival.criterion + float(seen @ seen), np.zeros_like(seen)
    z = descend(both, [start], REFIT_TOLERANCE)
    return rival.criterion + float(both.chi2(z)[0]), new(rival, z[np.newaxis])[0]
