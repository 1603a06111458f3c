"""When a run first reaches a target."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pandas import DataFrame

from armid.study.analyses.outcomes import Results
from armid.study.outcome import RunTrace

Array = NDArray[np.float64]
# 51 targets, as COCO takes, five a decade: largest relative error of the parameters, from 100 % to 1e-8 %.
ERROR_TARGETS = 10.0 ** (-np.arange(51) / 5.0)
# Shares of the way from a first candidate to the best that anyone found (More and Wild).
VALUE_TARGETS = ERROR_TARGETS


def first_hits(evaluations: NDArray[np.int64], distances: Array, targets: Array) -> Array:
    """Return the evaluation at which a trace is first at each target or below, infinite where it never is.

    h(t) = min { e_i : d_i <= t }. evaluations, distances: of the improvements, (n,); targets: falling, (n_targets,).
    The distance may rise again: an improvement of the fitness need not be one of the parameters.
    Source: Hansen et al., COCO: performance assessment, arXiv:1605.03560.
    """
    lowest = np.minimum.accumulate(np.where(np.isnan(distances), np.inf, distances))
    place = np.searchsorted(-lowest, -targets, side="left")
    return np.append(evaluations.astype(np.float64), np.inf)[place]


def held(evaluations: NDArray[np.int64], quantity: Array, grid: NDArray[np.int64]) -> Array:
    """Return a quantity of the best candidate so far on a grid of evaluations, infinite before the first.

    evaluations, quantity: of the improvements, (n,); grid: evaluation counts, (n_grid,).
    """
    place = np.searchsorted(evaluations, grid, side="right")
    return np.append(np.inf, quantity)[place]


# Parts of the way to the best known value that may be left.
SHARES_LEFT = (1e-1, 1e-3, 1e-5)


def remaining_share(values: Array, first: float, best: float) -> Array:
    """Return how much of the way from a first value to the best known is left, 1 at the first and 0 at the best.

    s = (f - f_L)/(f_0 - f_L); a problem is solved to tau where s <= tau, More and Wild's test
    f <= f_L + tau (f_0 - f_L). values: fitness, (n,); first: f_0; best: f_L, of anyone within the budget.
    Source: More and Wild, SIAM J. Optim. 20 (2009) 172, Eq. 2.2.
    """
    if not first > best:
        return np.where(values <= best, 0.0, np.inf)
    return (values - best) / (first - best)


def data_profile(hits: Array, n_parameters: NDArray[np.int64], grid: Array) -> Array:
    """Return the share of problems solved within each number of simplex gradients, (n_grid,).

    d(kappa) = #{p : h_p <= kappa (n_p + 1)} / n_problems. hits: first hits of one tolerance, (n_problems,);
    n_parameters: free ones of each problem, (n_problems,); grid: kappa, in units of n_p + 1 simulations, (n_grid,).
    Source: More and Wild, SIAM J. Optim. 20 (2009) 172, Eq. 2.5.
    """
    gradients = np.sort(hits / (n_parameters + 1))
    return np.searchsorted(gradients, grid, side="right") / gradients.size


RESAMPLES = 2000
# Numbers that a batch of resamples may hold at once.
BATCH_NUMBERS = 4_000_000


def median_interval(values: ArrayLike, confidence: float = 0.95, seed: int = 0) -> tuple[float, float]:
    """Return the percentile bootstrap interval of the median of a sample, 2000 resamples.

    values: (n,), infinite ones allowed; seed: of the resampling, so that the same sample gives the same interval.
    A sample of fewer than two gives NaN. Source: Efron and Tibshirani, An Introduction to the Bootstrap (1993), ch. 13.
    """
    sample = np.sort(np.asarray(values, np.float64))
    if sample.size < 2:
        return np.nan, np.nan
    if np.isfinite(sample).all():
        return interval(sample, confidence, seed)
    # Ranks instead of values: the bootstrap subtracts, and infinity minus infinity is no number.
    low, high = interval(np.arange(sample.size, dtype=np.float64), confidence, seed)
    return at_rank(sample, low), at_rank(sample, high)


def interval(sample: Array, confidence: float, seed: int) -> tuple[float, float]:
    """Return the interval of a finite sample."""
    from scipy.stats import bootstrap

    found = bootstrap(
        (sample,), np.median, n_resamples=RESAMPLES, batch=max(1, BATCH_NUMBERS // sample.size),
        confidence_level=confidence, method="percentile", rng=np.random.default_rng(seed),
    ).confidence_interval  # fmt: skip
    return float(found.low), float(found.high)


def at_rank(ordered: Array, rank: float) -> float:
    """Return the value at a rank of an ordered sample, between two values their mean."""
    return float((ordered[int(np.floor(rank))] + ordered[int(np.ceil(rank))]) / 2.0)


# One pass over the traces of a study: what the curves and the running times need, and no more.
#
# A trace has hundreds of improvements; of each run only first hits and values on a common grid are kept, so that the
# memory does not grow with the length of the traces.

Small = NDArray[np.float32]
N_GRID = 61


@dataclass(frozen=True, eq=False)
class Histories:
    """Hold, for the runs in the order of the outcomes, what their traces say.

    grid: simulations, (n_grid,). error_hits: first hits of ERROR_TARGETS by the largest relative error of the best
    candidate, value_hits: of VALUE_TARGETS by the share of the way to the best known fitness, both (n_runs, n_targets),
    infinite for never. errors, values: of the best candidate so far, (n_runs, n_grid), infinite before the first.
    """

    grid: NDArray[np.int64]
    error_hits: Small
    value_hits: Small
    errors: Small
    values: Small


def histories(results: Results, found: DataFrame, truths: Mapping[str, Mapping[str, float]]) -> Histories:
    """Read the traces twice, one run at a time: for the first values, then for everything that depends on them.

    found: outcomes of runs; truths: case -> parameter -> truth, SI.
    """
    grid = evaluation_grid(int(found["used"].max()) if len(found) else 1)
    place = {run: i for i, run in enumerate(found["run"])}
    firsts, bests = reference_values(found, first_values(results, place))
    cases = found["case"].to_numpy()
    n = len(place)
    kept = Histories(
        grid, never(n, ERROR_TARGETS.size), never(n, VALUE_TARGETS.size), never(n, grid.size), never(n, grid.size)
    )
    for trace in results.iter_traces():
        i = place.get(trace.run)
        if i is None or not trace.evaluations.size:
            continue
        errors = trace_errors(trace, truths.get(str(cases[i]), {}))
        shares = remaining_share(trace.values, firsts[i], bests[i])
        kept.error_hits[i] = first_hits(trace.evaluations, errors, ERROR_TARGETS)
        kept.value_hits[i] = first_hits(trace.evaluations, shares, VALUE_TARGETS)
        kept.errors[i] = held(trace.evaluations, errors, grid)
        kept.values[i] = held(trace.evaluations, trace.values, grid)
    return kept


def trace_errors(trace: RunTrace, truth: Mapping[str, float]) -> Array:
    """Return the largest relative error of each candidate of a trace, NaN where no truth is known.

    e = max of abs(x - truth)/abs(truth) over the parameters that the run searched and whose truth is known.
    """
    true = np.array([truth.get(name, np.nan) for name in trace.names])
    known = ~np.isnan(trace.X[-1]) & ~np.isnan(true)
    if not known.any():
        return np.full(trace.evaluations.size, np.nan)
    errors: Array = np.max(np.abs(trace.X[:, known] - true[known]) / np.abs(true[known]), axis=1)
    return errors


def first_values(results: Results, place: Mapping[str, int]) -> Array:
    """Return the first fitness that each run found, NaN without any, (n_runs,)."""
    found = np.full(len(place), np.nan)
    for trace in results.iter_traces():
        if trace.run in place and trace.values.size:
            found[place[trace.run]] = trace.values[0]
    return found


def reference_values(found: DataFrame, firsts: Array) -> tuple[Array, Array]:
    """Return where each run's way starts and where the best known ends, (n_runs,) each.

    The start is the median of the first values of all runs on the same case, setting and fitness; the end is the best
    fitness that any of them found with the same seed, that is on the same noise.
    """
    frame = found[["case", "setting", "fitness", "seed", "value"]].assign(first=firsts)
    problem = ["case", "setting", "fitness"]
    start = frame.groupby(problem)["first"].transform("median").to_numpy()
    best = frame.groupby([*problem, "seed"])["value"].transform("min").to_numpy()
    return start, best


def evaluation_grid(most: int) -> NDArray[np.int64]:
    """Return counts from 1 to the most, evenly spread in their logarithm."""
    return np.unique(np.round(np.geomspace(1, max(most, 1), N_GRID)).astype(np.int64))


def never(n: int, width: int) -> Small:
    """Return a table of infinities."""
    return np.full((n, width), np.inf, np.float32)
