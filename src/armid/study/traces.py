"""One pass over the traces of a study: when each run first reached a target, and what it had found by then.

A trace has hundreds of improvements; of each run only first hits and values on a common grid are kept, so that the
memory does not grow with the length of the traces.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame

from armid.study.outcome import RunTrace
from armid.study.results import StudyResults

Array = NDArray[np.float64]
Small = NDArray[np.float32]
# 51 targets, as COCO takes, five a decade: largest relative errors of the parameters from 100 % to 1e-8 %, and shares
# of the way from a first candidate to the best fitness that anyone found.
TARGETS = 10.0 ** (-np.arange(51) / 5.0)
N_GRID = 61


@dataclass(frozen=True, eq=False)
class Histories:
    """Hold, for the runs in the order of the outcomes, what their traces say.

    grid: simulations, (n_grid,). error_hits: first hits of TARGETS by the largest relative error of the best candidate,
    value_hits: by the share of the way to the best known fitness, both (n_runs, n_targets), infinite for never. errors,
    values: of the best candidate so far, (n_runs, n_grid), infinite before the first.
    """

    grid: NDArray[np.int64]
    error_hits: Small
    value_hits: Small
    errors: Small
    values: Small


def histories(results: StudyResults, runs: DataFrame, truths: Mapping[str, Mapping[str, float]]) -> Histories:
    """Read the traces twice, one run at a time: for the first values, then for everything that depends on them.

    runs: outcomes; truths: case -> parameter -> truth, SI.
    """
    # from 1 to the most simulations of a run, evenly spread in the logarithm
    most = max(int(runs["used"].max()) if len(runs) else 1, 1)
    grid = np.unique(np.round(np.geomspace(1, most, N_GRID)).astype(np.int64))
    place = {run: i for i, run in enumerate(runs["run"])}
    firsts = np.full(len(place), np.nan)
    for trace in results.iter_traces():
        if trace.run in place and trace.values.size:
            firsts[place[trace.run]] = trace.values[0]
    # the way of a run starts at the median of the first values of all runs on the same case, setting and fitness, and
    # ends at the best fitness that any of them found with the same seed, that is on the same noise
    problem = ["case", "setting", "fitness"]
    starts = runs.assign(first=firsts).groupby(problem)["first"].transform("median").to_numpy()
    bests = runs.groupby([*problem, "seed"])["value"].transform("min").to_numpy()
    cases = runs["case"].to_numpy()
    kept = Histories(grid, *(np.full((len(place), n), np.inf, np.float32)
                             for n in (TARGETS.size, TARGETS.size, grid.size, grid.size)))  # fmt: skip
    for trace in results.iter_traces():
        i = place.get(trace.run)
        if i is None or not trace.evaluations.size:
            continue
        errors = trace_errors(trace, truths.get(str(cases[i]), {}))
        shares = remaining_share(trace.values, starts[i], bests[i])
        kept.error_hits[i] = first_hits(trace.evaluations, errors, TARGETS)
        kept.value_hits[i] = first_hits(trace.evaluations, shares, TARGETS)
        kept.errors[i] = held(trace.evaluations, errors, grid)
        kept.values[i] = held(trace.evaluations, trace.values, grid)
    return kept


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


def remaining_share(values: Array, first: float, best: float) -> Array:
    """Return how much of the way from a first value to the best known is left, 1 at the first and 0 at the best.

    s = (f - f_L)/(f_0 - f_L); a problem is solved to tau where s <= tau, More and Wild's test
    f <= f_L + tau (f_0 - f_L). values: fitness, (n,); first: f_0; best: f_L, of anyone within the budget.
    Source: More and Wild, SIAM J. Optim. 20 (2009) 172, Eq. 2.2.
    """
    if not first > best:
        return np.where(values <= best, 0.0, np.inf)
    return (values - best) / (first - best)


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
