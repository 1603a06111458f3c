"""Convergence bands: median and quartiles over runs against simulations."""

import numpy as np
from numpy.typing import NDArray

QUARTILES = (0.25, 0.5, 0.75)


def band(held_values: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return lower quartile, median and upper quartile at each count of simulations, (3, n_grid).

    held_values: of the best candidate so far, (n_runs, n_grid), infinite before the first. Each is a value that a run
    had (the smallest with at least that share of runs at or below), since no mean with infinity exists.
    """
    found: NDArray[np.float64] = np.quantile(held_values, QUARTILES, axis=0, method="inverted_cdf").astype(float)
    return found
