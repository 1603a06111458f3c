"""When a run first reaches a target."""

import numpy as np
from numpy.typing import NDArray

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
