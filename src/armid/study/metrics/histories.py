"""One pass over the traces of a study: what the curves and the running times need, and no more.

A trace has hundreds of improvements; of each run only first hits and values on a common grid are kept, so that the
memory does not grow with the length of the traces.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame

from armid.study.metrics.data_profile import remaining_share
from armid.study.metrics.first_hit import ERROR_TARGETS, VALUE_TARGETS, first_hits, held
from armid.study.metrics.results import Results
from armid.study.trace import RunTrace

Array = NDArray[np.float64]
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
