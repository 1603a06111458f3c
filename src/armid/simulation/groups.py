"""Candidates side by side in lanes, and the groups of lanes shared among threads."""

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.simulation.compile import Kernel
from armid.simulation.refusal import UNCOMPILABLE, refusal

Array = NDArray[np.float64]
# Parts of a population per thread: candidates that switch early take longer, so that halves would be uneven.
SHARES = 4


def arranged(candidates: Array, width: int, weights: Array | None) -> tuple[Array, NDArray[np.int64]]:
    """Return parameters as rows, one column for each lane, and the candidate of each lane (-1: padding)."""
    n = len(candidates)
    if n <= width:
        weights = None  # within one group the order saves nothing
    order = np.arange(n) if weights is None else np.argsort(candidates @ weights, kind="stable")
    places = np.full(n + -n % width, -1)
    places[:n] = order
    rows = np.empty((candidates.shape[1], len(places)))
    rows[:, :n] = candidates.T if weights is None else candidates[order].T
    rows[:, n:] = rows[:, n - 1 : n]
    return rows, places


@cache
def pool_of(threads: int) -> ThreadPoolExecutor:
    """Return the pool of so many threads; it stays, as starting threads takes as long as many simulations."""
    return ThreadPoolExecutor(threads, thread_name_prefix="armid")


def run(kernel: Kernel, given: tuple[Any, ...], results: tuple[Array, ...], n_groups: int, threads: int) -> None:
    """Fill the results group by group; threads take neighbouring groups.

    Raises ArmidError when an equation cannot be compiled, which shows at the first call.
    """
    try:
        if threads < 2 or n_groups < 2:
            kernel(*given, 0, n_groups, *results)
            return
        edges = np.linspace(0, n_groups, min(SHARES * threads, n_groups) + 1).astype(int)
        pool = pool_of(threads)
        parts = [pool.submit(kernel, *given, int(a), int(b), *results) for a, b in pairwise(edges)]
        for part in parts:
            part.result()
    except UNCOMPILABLE as error:
        raise refusal(error) from error
