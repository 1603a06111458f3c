"""Expected running time: what one success costs when a method is started again until it has one."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def expected_running_time(hits: Array, used: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the expected running time to each target [simulations], (n_targets,), and the successes, (n_targets,).

    ERT(t) = (sum over runs of the simulations until t is hit, or of all that were used) / (number of runs that hit t);
    infinite where none does. hits: first hits, (n_runs, n_targets), infinite for never; used: simulations, (n_runs,).
    Source: Hansen et al., arXiv:1605.03560, section 4.
    """
    reached = np.isfinite(hits)
    spent = np.where(reached, hits, used[:, np.newaxis]).sum(axis=0, dtype=np.float64)
    successes = np.count_nonzero(reached, axis=0)
    ert = np.divide(spent, successes, out=np.full(spent.shape, np.inf), where=successes > 0)
    return ert, successes
