"""Noise that a few columns add to white noise: what a signal without a form does, or the zero of an encoder."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh

from armid.model import Array

# Sum of squares, in units of the noise, from which on samples see a signal.
SMALLEST_SEEN = 0.1


@dataclass(frozen=True, eq=False)
class Cover:
    """Hold the covariance B B' that some columns add to whitened noise: 1 + B B' = 1 + Q L Q'.

    basis: Q, orthonormal, (n_samples, rank). sizes: L, (rank,). elsewhere: orthogonal columns of signals that may act
    instead, whitened, (n_samples, n): intervals count them, and no fit; None for none.
    """

    basis: Array
    sizes: Array
    elsewhere: Array | None = None

    @classmethod
    def of(cls, columns: Array) -> "Cover":
        """Return the cover of columns B, each a signal of one standard deviation, (n_samples, n)."""
        left, values, _ = np.linalg.svd(columns, full_matrices=False)
        return cls(left, values**2)

    def white(self, signals: Array) -> Array:
        """Return signals divided by the root of the covariance, (..., n_samples)."""
        shares = 1.0 - 1.0 / np.sqrt(1.0 + self.sizes)
        return np.asarray(signals - ((signals @ self.basis) * shares) @ self.basis.T)

    @classmethod
    def seen(cls, columns: Array) -> "Cover":
        """Return the cover of many columns without what the samples do not see."""
        sizes, vectors = eigh(columns.T @ columns, subset_by_value=[SMALLEST_SEEN, np.inf])
        return cls(columns @ vectors / np.sqrt(sizes), sizes)

    @property
    def columns(self) -> Array:
        """Orthogonal columns B, (n_samples, rank)."""
        return self.basis * np.sqrt(self.sizes)

    def with_elsewhere(self, columns: Array) -> "Cover":
        """Return the cover with columns of signals that may act instead, each of one standard deviation."""
        white = self.white(columns.T).T
        squares, vectors = np.linalg.eigh(white.T @ white)
        return replace(self, elsewhere=white @ vectors[:, np.searchsorted(squares, SMALLEST_SEEN) :])

    def taken(self, unknowns: Array, weight: float) -> Array:
        """Return the information on unknowns, (n_samples, n), that signals elsewhere take away, (n, n).

        weight: of each square.
        """
        if self.elsewhere is None:
            return np.zeros((unknowns.shape[1],) * 2)
        cross, squares = unknowns.T @ self.elsewhere, np.sum(self.elsewhere**2, axis=0)
        return np.asarray(weight**2 * (cross / (1.0 + weight * squares)) @ cross.T)
