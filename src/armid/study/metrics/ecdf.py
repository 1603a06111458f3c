"""Empirical cumulative distribution of the first hits over runs and targets."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def share_hit(hits: Array, grid: NDArray[np.int64]) -> Array:
    """Return the share of (run, target) pairs that are hit within each number of simulations, (n_grid,).

    F(e) = #{(r, t) : h_rt <= e} / (n_runs n_targets). hits: (n_runs, n_targets), infinite for never;
    grid: simulations, (n_grid,). Runs are not restarted in thought: what ends early stays where it ended.
    Source: Hansen et al., arXiv:1605.03560, section 5.
    """
    ordered = np.sort(hits, axis=None)
    return np.searchsorted(ordered, grid, side="right") / ordered.size
