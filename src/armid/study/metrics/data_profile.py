"""Data profiles: the share of problems that are solved within so many simplex gradients."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
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
