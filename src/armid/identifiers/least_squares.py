"""The trust region of scipy on the residual vector."""

from dataclasses import dataclass

import numpy as np

from armid.identifiers.differences import FORWARD, KINDS, slopes, stencil
from armid.identifiers.local import Array, NoFitnessError, started
from armid.identifiers.options import checked, checked_choice, checked_share
from armid.identifiers.search import Asker, Cube, Method, Search, Task

# The budget ends a search, never this.
MOST_CALLS = 10**9


@dataclass(frozen=True)
class LeastSquaresOptions:
    """Hold the options of the trust region.

    differences: "forward" or "central"; step: how far a perturbed candidate is, as a share of the range;
    tolerance: it ends when a step changes parameters or sum of squares by less than this share.
    """

    differences: str = FORWARD
    step: float = 1e-6
    tolerance: float = 1e-12

    def __post_init__(self) -> None:
        checked_choice("differences", self.differences, KINDS)
        checked_share("step", self.step)
        checked("tolerance", self.tolerance, 1e-15, "a number of at least 1e-15")


def least_squares_method(options: LeastSquaresOptions) -> Method:
    """Return the search min sum r_i(x)^2 within the box by trust region reflective steps.

    The derivatives of r come from one batch of perturbed candidates a step. Source: Branch, Coleman, Li 1999,
    doi:10.1137/S1064827595289108, as scipy.optimize.least_squares has it.
    """

    def method(task: Task) -> Search:
        cube = task.cube
        return started(task, lambda ask, start: descend(options, cube, ask, start))

    return method


def descend(options: LeastSquaresOptions, cube: Cube, ask: Asker, start: Array) -> None:
    """Minimise in the unit cube from a start; the evaluated candidates are the result, so nothing is returned."""
    from scipy.optimize import least_squares  # noqa: PLC0415 - takes time to import

    residual = Residual(options, cube, ask)
    # no limit on the gradient: it is no share of anything
    least_squares(
        residual.at, start, residual.derivative, (0.0, 1.0), "trf", ftol=options.tolerance, xtol=options.tolerance,
        gtol=None, max_nfev=MOST_CALLS,
    )  # fmt: skip


class Residual:
    """Give scipy residuals and their derivatives; the latter at the point that it asked for last, which is accepted."""

    def __init__(self, options: LeastSquaresOptions, cube: Cube, ask: Asker) -> None:
        self.options, self.cube, self.ask = options, cube, ask
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
        """Return the derivatives of the residual at a point, (n_total, n_parameters)."""
        assert self.here is not None
        beside = stencil(u, self.options.step, self.options.differences)
        told = self.ask(self.cube.candidates(beside.points), residuals=True)
        assert told.residuals is not None
        there = np.where(np.isfinite(told.F)[:, np.newaxis], told.residuals, np.nan)
        return np.asarray(slopes(beside, self.here, there).T)
