"""Intervals of an estimate that does not minimise a sum of squares: parametric bootstrap.

Records are simulated at the estimate, noise as it was measured is added, and the same fitness is minimised again near
the estimate: once for each draw of the noise. The scatter of the draws is that of the estimator.
Source: Efron, Tibshirani 1993, chapter 6.
All draws are refined side by side, each by a CMA-ES of its own (Hansen 2016, arXiv:1604.00772), so that one step of all
of them is one population of the engine. Parameters are whitened by the Cramer-Rao covariance at the estimate.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.stats import skew

from armid.estimation.information import NORMAL_95, Information, start_changes
from armid.estimation.least_squares import WeightedRecords
from armid.estimation.noise_model import coloured
from armid.model import Array
from armid.problem.fitness import Fitness
from armid.problem.problem import (
    LANES,
    MOST_AT_ONCE,
    Replay,
    by_record,
    fitness_of,
    output_sizes,
    signals_of,
    weights_of,
)
from armid.problem.space import Space

# Draws, enough for a standard deviation to 7 %; where the estimates are skewed so many, for quantiles.
FIRST_DRAWS, MANY_DRAWS = 100, 400
# Skewness above which a standard deviation says too little; of 100 normal draws it scatters by 0.24.
SKEWED = 0.5
# First step of a refinement, and the step at which it has converged, in standard deviations of the Cramer-Rao bound.
# A minimax scatters by six of them.
FIRST_STEP, LAST_STEP = 6.0, 0.02
# Generations after which a draw does not converge, and the share of such draws that leaves no interval.
MOST_GENERATIONS, MOST_LOST = 400, 0.05


@dataclass
class Refined:
    """How far a bootstrap has come, as a progress bar reads it."""

    budget: int
    used: int = 0
    what: str = "draws of the noise"


@dataclass(frozen=True)
class Scatter:
    """How the estimates of a bootstrap scatter.

    draws: estimates that converged, SI, (n_draws, n_free). low, high: ends of the 95 % interval, SI, (n_free,), about
    the minimum that a refinement of the estimate finds, since a search stops short of it: +- 1.96 standard deviations,
    and the quantiles of the draws where these are skewed. bias: mean of the draws less the estimate that they were
    simulated at, SI, (n_free,). moved: how far the refinement moves the estimate, in standard deviations. doubt: why
    there is no interval, "" where there is one. is_far: the minimum is farther away than that; low, high then lie about
    the estimate.
    """

    draws: Array
    low: Array
    high: Array
    bias: Array
    moved: Array
    doubt: str = ""
    is_far: bool = False


def bootstrap(
    fitness: Fitness, replays: tuple[Replay, ...], space: Space, x: Array, information: Information, seed: int = 1,
    progress: Callable[[Refined], bool] = lambda _: False,
) -> Scatter:  # fmt: skip
    """Return the scatter of an estimate over draws of the noise.

    Parameters
    ----------
    fitness, replays, space
        What was minimised, the records that it sees, ready to be simulated, and the box.
    x : array, SI, (n_free,)
        The estimate.
    information : Information
        Covariance at the estimate, which scales the steps, and the noise of each record.
    seed : int
        Of the noise that is drawn.
    progress : callable
        Called after each generation with the number of draws that have converged. If it returns True, the bootstrap
        ends.

    Returns
    -------
    Scatter
    """
    if any(level.rms == 0.0 for level in information.levels):
        return without(x, "a record holds no noise, from which the scatter would follow")
    unknown = [name for name, d in zip(information.names, information.deviation, strict=True) if not np.isfinite(d)]
    if unknown:
        return without(x, f"the records do not determine {', '.join(unknown)}")
    task = Task(fitness, replays, space, x, information)
    rng = np.random.default_rng(seed)
    scatter = refined(task, task.noises(rng, FIRST_DRAWS), rng, progress)
    if not scatter.doubt and np.abs(skew(scatter.draws)).max() > SKEWED:
        scatter = refined(task, task.noises(rng, MANY_DRAWS), rng, progress)
    return scatter


def without(x: Array, doubt: str) -> Scatter:
    """Return the scatter of a bootstrap that gives no interval."""
    unknown = np.full(len(x), np.nan)
    return Scatter(np.empty((0, len(x))), unknown, unknown, unknown, unknown, doubt)


class Task:
    """A fitness about an estimate: draws of the noise, and the value of candidates against each of them."""

    def __init__(
        self, fitness: Fitness, replays: tuple[Replay, ...], space: Space, x: Array, information: Information
    ) -> None:
        self.fitness, self.replays, self.space, self.x = fitness, replays, space, x
        self.levels = information.levels
        # in units of the deviations, as parameters differ by orders of magnitude
        values, vectors = np.linalg.eigh(information.correlation)
        self.white = information.deviation[:, np.newaxis] * vectors * np.sqrt(np.maximum(values, 0.0))
        self.weights, self.sizes = weights_of(fitness, replays), output_sizes(replays)
        self.ends = np.cumsum([r.record.n_samples for r in replays])[:-1]
        self.measured = np.concatenate([r.measured for r in replays])

    def noises(self, rng: np.random.Generator, n_draws: int) -> Array:
        """Return the measured signals and those of the draws, the records end to end, (1 + n_draws, n_samples)."""
        candidate = self.space.complete(self.x[np.newaxis])
        clean = np.concatenate(signals_of(self.replays, candidate), axis=1)
        drawn = [coloured(rng, (n_draws, r.record.n_samples), level)
                 for r, level in zip(self.replays, self.levels, strict=True)]  # fmt: skip
        noise = np.concatenate(drawn, axis=1)
        records = WeightedRecords(self.replays, self.space, (1.0,) * len(self.replays))
        # what one standard deviation of each measured start does to the signals
        for change in start_changes(records, records.shares(self.x)):
            noise += rng.standard_normal((n_draws, 1)) * change
        return np.concatenate([self.measured[np.newaxis], clean + self.beyond_starts(noise)])

    def beyond_starts(self, noise: Array) -> Array:
        """Return noise without the part that fitted starts take up."""
        parts = np.split(noise, self.ends, axis=1)
        left = [part.copy() for part in parts]
        first = [np.cumsum([0, *r.record.lengths]) for r in self.replays]
        for ready, outputs in by_record(self.replays).items():
            places = {r.place: self.replays.index(r) for r in outputs}
            for k, correction in enumerate(piece.correction for piece in ready.record.pieces):
                if correction is None or not places.keys() >= set(correction.places):
                    continue
                rows = {place: slice(first[i][k], first[i][k + 1]) for place, i in places.items()}
                seen = np.concatenate([parts[places[p]][:, rows[p]] for p in correction.places], axis=1)
                starts = seen @ correction.gain.T
                pairs = zip(correction.places, correction.slopes.swapaxes(0, 1), correction.samples, strict=True)
                for place, slopes, samples in pairs:
                    left[places[place]][:, rows[place]] -= starts @ slopes[:, samples]
        return np.concatenate(left, axis=1)

    def candidates(self, u: Array) -> Array:
        """Return free parameters, SI, of whitened ones, moved into the box, (..., n_free)."""
        low, high = self.space.low[self.space.free], self.space.high[self.space.free]
        return np.asarray(np.clip(self.x + u @ self.white.T, low, high))

    def values(self, U: Array, measured: Array) -> Array:
        """Return the fitness of the candidates of each draw, (n_draws, n_candidates), from U with a last axis more."""
        n_draws, n_candidates, n = U.shape
        size = max(MOST_AT_ONCE // (n_candidates * measured.shape[1]), LANES)
        values = np.empty((n_draws, n_candidates))
        for begin in range(0, n_draws, size):
            part = slice(begin, begin + size)
            whole = self.space.complete(self.candidates(U[part]).reshape(-1, n))
            signals = [s.reshape(-1, n_candidates, s.shape[1]) for s in signals_of(self.replays, whole)]
            for i, row in enumerate(measured[part]):
                values[begin + i] = fitness_of(self.fitness, self.replays, np.split(row, self.ends),
                                               [s[i] for s in signals], self.weights, self.sizes)  # fmt: skip
        return values


def refined(task: Task, measured: Array, rng: np.random.Generator, progress: Callable[[Refined], bool]) -> Scatter:
    """Minimise the fitness for each draw about the estimate; the first of them is the measurement itself."""
    # The minimum of some fitnesses is a plateau, on which a search ends anywhere: none starts at the estimate.
    start = FIRST_STEP * rng.standard_normal((len(measured), len(task.x)))
    searches, state = ParallelCmaes(start), Refined(len(measured) - 1)
    for _ in range(MOST_GENERATIONS):
        moving = searches.moving
        state.used = int(np.count_nonzero(~moving[1:]))
        if progress(state):
            return without(task.x, "the bootstrap was interrupted")
        if not moving.any():
            break
        searches.step(moving, rng, partial(task.values, measured=measured[moving]))
    lost, draws = searches.moving, task.candidates(searches.best)
    if not np.isfinite(searches.value).all() or lost[1:].mean() > MOST_LOST:
        n_lost = f"{lost[1:].sum()} of {state.budget}"
        return without(task.x, f"the fitness does not converge in {n_lost} draws of the noise")
    x, minimum, kept = task.x, draws[0], draws[1:][~lost[1:]]
    deviation = np.std(kept, axis=0, ddof=1)
    ends = np.array([-NORMAL_95 * deviation, NORMAL_95 * deviation])
    if len(kept) > FIRST_DRAWS:
        ends = np.where(np.abs(skew(kept)) > SKEWED, np.quantile(kept, (0.025, 0.975), axis=0) - x, ends)
    moved = (minimum - x) / np.maximum(deviation, 1e-300)
    is_far = bool(lost[0] or np.any((x - minimum < ends[0]) | (x - minimum > ends[1])))
    low, high = (x if is_far else minimum) + ends
    doubt = f"the search has not come to the minimum of {task.fitness.name}" if is_far else ""
    return Scatter(kept, low, high, kept.mean(axis=0) - x, moved, doubt, is_far)


class ParallelCmaes:
    """A CMA-ES for each draw, all of them arrays over the draws, (n_draws, n); the unit is a standard deviation."""

    def __init__(self, start: Array) -> None:
        n_draws, n = start.shape
        self.n, self.size = n, 4 + int(3 * np.log(n))
        parents = self.size // 2
        weights = np.log(parents + 0.5) - np.log(np.arange(1, parents + 1))
        self.weights = weights / weights.sum()
        self.mass = mass = 1.0 / float(np.sum(self.weights**2))
        self.c_step = (mass + 2.0) / (n + mass + 5.0)
        self.damping = 1.0 + 2.0 * max(0.0, np.sqrt((mass - 1.0) / (n + 1.0)) - 1.0) + self.c_step
        self.c_path = (4.0 + mass / n) / (n + 4.0 + 2.0 * mass / n)
        self.c_one = 2.0 / ((n + 1.3) ** 2 + mass)
        self.c_many = min(1.0 - self.c_one, 2.0 * (mass - 2.0 + 1.0 / mass) / ((n + 2.0) ** 2 + mass))
        self.expected = np.sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n**2))
        self.mean, self.best = start.copy(), start.copy()
        self.value = np.full(n_draws, np.inf)
        self.sigma = np.full(n_draws, FIRST_STEP)
        self.covariance = np.tile(np.eye(n), (n_draws, 1, 1))
        self.step_path, self.path = np.zeros((n_draws, n)), np.zeros((n_draws, n))

    @property
    def moving(self) -> NDArray[np.bool_]:
        widest = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2).max(axis=1))
        return np.asarray(self.sigma * widest > LAST_STEP)

    def step(self, moving: NDArray[np.bool_], rng: np.random.Generator, value: Callable[[Array], Array]) -> None:
        """Move the draws that have not converged by one generation."""
        values, vectors = np.linalg.eigh(self.covariance[moving])
        lengths = np.sqrt(np.maximum(values, 1e-20))[:, np.newaxis, :]
        axes = vectors * lengths
        steps = rng.standard_normal((len(axes), self.size, self.n)) @ axes.swapaxes(1, 2)
        sigma = self.sigma[moving]
        tried = self.mean[moving][:, np.newaxis] + sigma[:, np.newaxis, np.newaxis] * steps
        F = value(tried)
        order = np.argsort(F, axis=1, kind="stable")
        first = np.take_along_axis(tried, order[:, :1, np.newaxis], axis=1)[:, 0]
        least = np.take_along_axis(F, order[:, :1], axis=1)[:, 0]
        better = least < self.value[moving]
        self.best[moving] = np.where(better[:, np.newaxis], first, self.best[moving])
        self.value[moving] = np.where(better, least, self.value[moving])
        parents = np.take_along_axis(steps, order[:, : len(self.weights), np.newaxis], axis=1)
        mean = np.einsum("p,dpn->dn", self.weights, parents)
        self.mean[moving] += sigma[:, np.newaxis] * mean
        whitened = np.einsum("dij,dj->di", vectors / lengths, np.einsum("dji,dj->di", vectors, mean))
        gain = np.sqrt(self.c_step * (2.0 - self.c_step) * self.mass)
        self.step_path[moving] = (1.0 - self.c_step) * self.step_path[moving] + gain * whitened
        length = np.linalg.norm(self.step_path[moving], axis=1)
        slow = (length < (1.4 + 2.0 / (self.n + 1.0)) * self.expected)[:, np.newaxis]
        gain = np.sqrt(self.c_path * (2.0 - self.c_path) * self.mass)
        self.path[moving] = (1.0 - self.c_path) * self.path[moving] + slow * gain * mean
        path = self.path[moving]
        kept = 1.0 - self.c_one - self.c_many + (~slow[:, :, np.newaxis]) * self.c_one * self.c_path * (2 - self.c_path)
        self.covariance[moving] = (
            kept * self.covariance[moving] + self.c_one * path[:, :, np.newaxis] * path[:, np.newaxis]
            + self.c_many * np.einsum("p,dpi,dpj->dij", self.weights, parents, parents)
        )  # fmt: skip
        self.sigma[moving] = sigma * np.exp(self.c_step / self.damping * (length / self.expected - 1.0))
