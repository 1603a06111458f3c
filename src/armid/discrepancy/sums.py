"""Least squares from sums over samples: what a curve removes, also from samples that its fit has not seen."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Added to a scaled normal matrix: its diagonal, and the squared bends of the curve.
RIDGE, STRAIGHT = 1e-9, 1e-4


@dataclass(frozen=True, eq=False)
class Sums:
    """Hold what a least-squares fit needs of some samples: design^T design, design^T residual, |residual|^2."""

    gram: Array
    slope: Array
    square: float

    @staticmethod
    def of(design: Array, residual: Array) -> "Sums":
        """Return the sums over samples; design: (n_samples, n_columns), residual: (n_samples,)."""
        return Sums(design.T @ design, design.T @ residual, float(residual @ residual))

    @staticmethod
    def total(parts: Sequence["Sums"]) -> "Sums":
        """Return the sums over several sets of samples."""
        return Sums(sum((p.gram for p in parts), np.zeros(1)), sum((p.slope for p in parts), np.zeros(1)),
                    sum(p.square for p in parts))  # fmt: skip

    def first(self, n: int) -> "Sums":
        """Return the sums with the first columns of the design alone."""
        return Sums(self.gram[:n, :n], self.slope[:n], self.square)

    def rest(self, coefficients: Array) -> float:
        """Return |residual - design coefficients|^2."""
        fitted = float(coefficients @ self.gram @ coefficients)
        return self.square - 2.0 * float(coefficients @ self.slope) + fitted


def removed_share(sums: Sums, n_free: int) -> float:
    """Return the share of the squared residual that a fit removes, the free parameters fitted again on both sides."""
    before = sums.first(n_free).rest(solved(sums.first(n_free), n_free))
    return 1.0 - sums.rest(solved(sums, n_free)) / before if before > 0.0 else 0.0


def left_out_share(sums: Sequence[Sums], n_free: int) -> float:
    """Return the share of the squared residual that a fit to the other groups removes from each group.

    Both sides re-fit the free parameters; below 0 where the term makes the prediction worse.
    """
    before = after = 0.0
    for i, left_out in enumerate(sums):
        others = Sums.total([*sums[:i], *sums[i + 1 :]])
        before += left_out.first(n_free).rest(solved(others.first(n_free), n_free))
        after += left_out.rest(solved(others, n_free))
    return 1.0 - after / before if before > 0.0 else 0.0


def solved(sums: Sums, n_free: int) -> Array:
    """Return the coefficients of a least-squares fit whose curve is lightly held straight.

    Heights that the motion never visits then follow their neighbours instead of being free.
    """
    norms = np.sqrt(np.diag(sums.gram))
    scale = np.where(norms > 0.0, norms, 1.0)
    normal = sums.gram / np.outer(scale, scale) + RIDGE * np.eye(len(scale))
    heights = scale[n_free:].max(initial=0.0)
    if heights > 0.0:
        bends = np.diff(np.eye(len(scale) - n_free), 2, axis=0) * (heights / scale[n_free:])
        normal[n_free:, n_free:] += STRAIGHT * bends.T @ bends
    return np.asarray(np.linalg.solve(normal, sums.slope / scale) / scale)
