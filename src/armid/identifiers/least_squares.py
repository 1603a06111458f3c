"""The trust region of scipy on the residual vector, and derivatives by differences inside the unit cube."""

from dataclasses import dataclass

import numpy as np

from armid.identifiers.identifier import RANGE, declared, option, share
from armid.identifiers.pymoo_adapter import SearchOptions
from armid.identifiers.search import NoFitnessError, SearchTask, local_search
from armid.model import Array

FORWARD, CENTRAL = "forward", "central"
KINDS = (FORWARD, CENTRAL)
# The budget ends a search, never this.
MOST_CALLS = 10**9


@dataclass(frozen=True)
class TrustRegion(SearchOptions):
    """Minimise sum r_i(x)^2 within the box by trust region reflective steps.

    The derivatives of r come from one batch of perturbed candidates a step. Source: Branch, Coleman, Li 1999,
    doi:10.1137/S1064827595289108, as scipy.optimize.least_squares has it.
    """

    differences: str = option(FORWARD, "forward or central", "", known=KINDS)
    step: float = share(1e-6, "how far a perturbed candidate is")
    tolerance: float = option(1e-12, "it ends when a step changes no parameter, nor the sum of squares, by more", RANGE,
                              least=1e-15, expected="a number of at least 1e-15")  # fmt: skip

    def search(self, task: SearchTask) -> None:
        """Descend from the task's start, or from random ones until one has a fitness."""
        local_search(task, lambda start: self.descend(task, start))

    def descend(self, task: SearchTask, start: Array) -> None:
        """Let scipy minimise from a start in the unit cube, (n,)."""
        from scipy.optimize import least_squares

        residual = Residual(task, self.step, self.differences)
        # no limit on the gradient: its size is not a share of the range
        least_squares(
            residual.at, start, residual.derivative, (0.0, 1.0), "trf", ftol=self.tolerance, xtol=self.tolerance,
            gtol=None, max_nfev=MOST_CALLS,
        )  # fmt: skip


LEAST_SQUARES = declared("least_squares", "trust region on the residual vector (scipy)", TrustRegion,
                         uses_gradient=True, needs_residuals=True)  # fmt: skip


class Residual:
    """Give scipy residuals and their derivatives; the latter at the point that it asked for last, which is accepted."""

    def __init__(self, task: SearchTask, step: float, differences: str) -> None:
        self.cube, self.ask, self.step, self.differences = task.cube, task.ask, step, differences
        self.here: Array | None = None

    def at(self, u: Array) -> Array:
        """Return the residual at a point of the unit cube, (n_total,); not finite where the simulation failed.

        scipy takes back a step that leads to such a point. Raises NoFitnessError when the first point is one.
        """
        told = self.ask(self.cube.candidates(u), residuals=True)
        assert told.residuals is not None
        failed = not np.isfinite(told.F[0])
        if failed and self.here is None:
            raise NoFitnessError
        self.here = np.asarray(np.full_like(told.residuals[0], np.nan) if failed else told.residuals[0])
        return self.here

    def derivative(self, u: Array) -> Array:
        assert self.here is not None
        beside = stencil(u, self.step, self.differences)
        told = self.ask(self.cube.candidates(beside.points), residuals=True)
        assert told.residuals is not None
        there = np.where(np.isfinite(told.F)[:, np.newaxis], told.residuals, np.nan)
        return np.asarray(slopes(beside, self.here, there).T)


@dataclass(frozen=True)
class Stencil:
    """The points beside u at which each parameter is perturbed alone, one side first, and how far each is from u."""

    points: Array
    offsets: Array


def stencil(u: Array, step: float, kind: str) -> Stencil:
    """Return the points at u + step and, when central, u - step; a point that would leave the cube turns inwards.

    A central one at a bound keeps its inner point and takes one twice as far inside beside it.
    """
    ahead = np.where(u + step <= 1.0, step, -step)
    behind = np.where((u - ahead >= 0.0) & (u - ahead <= 1.0), -ahead, 2.0 * ahead)
    offsets = ahead if kind == FORWARD else np.concatenate([ahead, behind])
    points = np.tile(u, (len(offsets), 1))
    row = np.arange(len(offsets))
    column = row % len(u)
    points[row, column] += offsets
    return Stencil(points, points[row, column] - u[column])


def slopes(stencil: Stencil, here: Array, there: Array) -> Array:
    """Return derivatives with respect to the parameters, (n, m); where a side failed the other serves, else 0.

    With offsets a, b: f' = (d_a b/a - d_b a/b)/(b - a), second order for any a, b; (f(u + a) - f(u))/a for one of them.
    """
    with np.errstate(invalid="ignore"):
        quotients = (there - here) / stencil.offsets[:, np.newaxis]
    good = np.asarray(np.isfinite(quotients).all(axis=1))
    n = stencil.points.shape[1]
    if len(quotients) == n:
        return np.where(good[:, np.newaxis], quotients, 0.0)
    a, b = stencil.offsets[:n, np.newaxis], stencil.offsets[n:, np.newaxis]
    first, second = quotients[:n], quotients[n:]
    with np.errstate(invalid="ignore"):
        both = (first * b - second * a) / (b - a)
    one = np.where(good[:n, np.newaxis], first, np.where(good[n:, np.newaxis], second, 0.0))
    return np.where((good[:n] & good[n:])[:, np.newaxis], both, one)
