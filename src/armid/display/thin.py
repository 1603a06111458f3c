"""Fewer points that look the same."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MOST_POINTS = 1000


def thinned(values: Array, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Return which samples of a curve are to be drawn, rising: all, or the least and the largest of each interval.

    The samples are cut into most/2 - 1 intervals of equal number, so that no peak is lost; both ends are kept.
    values: (n_samples,). most: points, at least 4.
    """
    n = len(values)
    if n <= most:
        return np.arange(n)
    edges = np.linspace(0, n, most // 2).astype(np.intp)
    lows = np.minimum.reduceat(values, edges[:-1])
    highs = np.maximum.reduceat(values, edges[:-1])
    sizes = np.diff(edges)
    chosen = [0, n - 1]
    for extreme in (lows, highs):
        equal = np.flatnonzero(values == np.repeat(extreme, sizes))
        # the first sample of each interval that is its extreme
        chosen += list(equal[np.unique(np.searchsorted(edges, equal, side="right"), return_index=True)[1]])
    return np.unique(np.array(chosen, dtype=np.intp))
