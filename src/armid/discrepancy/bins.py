"""Columns that a residual is regressed on: indicators of bins of a variable, and of stretches of time."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
N_BINS = 12
# Products of columns whose share of the largest is below this are rounding.
DEPENDENT = 1e-11


def square_along(columns: Array, values: Array) -> tuple[float, int]:
    """Return the sum of squares of the part of some values along columns, and the rank of these.

    By the small matrix of their products: a decomposition of tall columns takes thirty times as long.
    """
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    sizes, directions = np.linalg.eigh(scaled.T @ scaled)
    good = sizes > DEPENDENT * sizes[-1]
    along = directions[:, good].T @ (scaled.T @ values)
    return float(np.sum(along**2 / sizes[good])), int(good.sum())


def binned(values: Array) -> Array:
    """Return indicators of bins that hold about equally many samples, (n_samples, n_bins)."""
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, N_BINS + 1)))
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, max(len(edges) - 2, 0))
    return indicators(place)


def stretched(edges: NDArray[np.int64]) -> Array:
    """Return indicators of twelve stretches of time of each record; edges: where the records begin, and the end."""
    parts = [np.arange(n) * N_BINS // max(n, 1) for n in np.diff(edges)]
    return indicators(np.concatenate([p + i * N_BINS for i, p in enumerate(parts)]))


def indicators(place: NDArray[np.int64]) -> Array:
    """Return a column for each value, 1 where it is taken."""
    return np.asarray(place[:, np.newaxis] == np.unique(place), dtype=np.float64)
