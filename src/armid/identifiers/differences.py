"""Derivatives from one batch of perturbed candidates in the unit cube."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FORWARD, CENTRAL = "forward", "central"
KINDS = (FORWARD, CENTRAL)


@dataclass(frozen=True)
class Stencil:
    """Hold the points beside u, (n,), at which each parameter is perturbed alone.

    points: (n or 2 n, n); offsets: how far each is from u along its parameter, (n or 2 n,); the first n are one side
    of each parameter, the next n the other.
    """

    points: Array
    offsets: Array

    @property
    def n(self) -> int:
        """Number of parameters."""
        return int(self.points.shape[1])


def stencil(u: Array, step: float, kind: str) -> Stencil:
    """Return the points at u + step and, when central, u - step; a point that would leave the cube turns inwards.

    A central one at a bound keeps its inner point and takes one twice as far inside beside it.
    """
    ahead = np.where(u + step <= 1.0, step, -step)
    offsets = ahead if kind == FORWARD else np.concatenate([ahead, behind(u, ahead)])
    points = np.tile(u, (len(offsets), 1))
    row = np.arange(len(offsets))
    column = row % len(u)
    points[row, column] += offsets
    return Stencil(points, points[row, column] - u[column])


def behind(u: Array, ahead: Array) -> Array:
    """Return the offsets of the other side: -ahead, or twice ahead where that would leave the cube."""
    there = u - ahead
    return np.where((there >= 0.0) & (there <= 1.0), -ahead, 2.0 * ahead)


def slopes(stencil: Stencil, here: Array, there: Array) -> Array:
    """Return derivatives with respect to the parameters, (n, m).

    here: m values at u, (m,); there: at the stencil's points, (n or 2 n, m), rows with no finite number where a
    simulation failed: the other side serves then, and where both failed the derivative is 0.
    With offsets a, b: f' = (d_a b/a - d_b a/b)/(b - a), second order for any a, b; (f(u + a) - f(u))/a for one of them.
    """
    with np.errstate(invalid="ignore"):
        quotients = (there - here) / stencil.offsets[:, np.newaxis]
    good = np.asarray(np.isfinite(quotients).all(axis=1))
    if len(quotients) == stencil.n:
        return np.where(good[:, np.newaxis], quotients, 0.0)
    n = stencil.n
    a, b = stencil.offsets[:n, np.newaxis], stencil.offsets[n:, np.newaxis]
    first, second = quotients[:n], quotients[n:]
    with np.errstate(invalid="ignore"):
        both = (first * b - second * a) / (b - a)
    one = np.where(good[:n, np.newaxis], first, np.where(good[n:, np.newaxis], second, 0.0))
    return np.where((good[:n] & good[n:])[:, np.newaxis], both, one)
