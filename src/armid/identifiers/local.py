"""Local searches: the trust region of scipy on the residual vector, and those of NLopt; derivatives by differences."""

from contextlib import suppress
from dataclasses import dataclass

import nlopt
import numpy as np

from armid.identifiers.identifier import RANGE, declared, option, share
from armid.identifiers.search import Calls, Height, NoFitnessError, SearchOptions, SearchTask, local_search, seed_from
from armid.model import Array

FORWARD, CENTRAL = "forward", "central"
DIFFERENCES = (FORWARD, CENTRAL)
# The budget ends a search, never this.
MOST_CALLS = 10**9


@dataclass(frozen=True)
class TrustRegion(SearchOptions):
    """Minimise sum r_i(x)^2 within the box by trust region reflective steps.

    The derivatives of r come from one batch of perturbed candidates a step. Source: Branch, Coleman, Li 1999,
    doi:10.1137/S1064827595289108, as scipy.optimize.least_squares has it.
    """

    differences: str = option(FORWARD, "forward or central", "", known=DIFFERENCES)
    step: float = share(1e-6, "how far a perturbed candidate is")
    tolerance: float = option(1e-12, "it ends when a step changes no parameter, nor the sum of squares, by more", RANGE,
                              least=1e-15, expected="a number of at least 1e-15")  # fmt: skip

    def search(self, task: SearchTask) -> None:
        """Descend from the task's start, or from random ones until one has a fitness."""
        local_search(task, lambda start: self.descend(task, start))

    def descend(self, task: SearchTask, start: Array) -> None:
        """Let scipy minimise from a start in the unit cube, (n,)."""
        from scipy.optimize import least_squares

        here: Array | None = None

        def residual(u: Array) -> Array:
            # not finite where the simulation failed: scipy takes back a step that leads there
            nonlocal here
            answer = task.ask(task.cube.candidates(u), residuals=True)
            assert answer.residuals is not None
            failed = not np.isfinite(answer.F[0])
            if failed and here is None:
                raise NoFitnessError
            here = np.asarray(np.full_like(answer.residuals[0], np.nan) if failed else answer.residuals[0])
            return here

        def derivative(u: Array) -> Array:
            # scipy asks at the point whose residual it asked for last, which is accepted
            points, offsets = stencil(u, self.step, self.differences)
            answer = task.ask(task.cube.candidates(points), residuals=True)
            assert answer.residuals is not None
            assert here is not None
            there = np.where(np.isfinite(answer.F)[:, np.newaxis], answer.residuals, np.nan)
            return np.asarray(slopes(points, offsets, here, there).T)

        # no limit on the gradient: its size is not a share of the range
        least_squares(
            residual, start, derivative, (0.0, 1.0), "trf", ftol=self.tolerance, xtol=self.tolerance,
            gtol=None, max_nfev=MOST_CALLS,
        )  # fmt: skip


LEAST_SQUARES = declared("least_squares", "trust region on the residual vector (scipy)", TrustRegion,
                         uses_gradient=True, needs_residuals=True)  # fmt: skip


def stencil(u: Array, step: float, kind: str) -> tuple[Array, Array]:
    """Return the points near u at which each parameter is perturbed alone, one side first, and how far each is from u.

    They are at u + step and, when central, u - step; a point that would leave the cube turns inwards. A central one at
    a bound keeps its inner point and adds one twice as far inside.
    """
    ahead = np.where(u + step <= 1.0, step, -step)
    behind = np.where((u - ahead >= 0.0) & (u - ahead <= 1.0), -ahead, 2.0 * ahead)
    offsets = ahead if kind == FORWARD else np.concatenate([ahead, behind])
    points = np.tile(u, (len(offsets), 1))
    row = np.arange(len(offsets))
    column = row % len(u)
    points[row, column] += offsets
    return points, points[row, column] - u[column]


def slopes(points: Array, offsets: Array, here: Array, there: Array) -> Array:
    """Return derivatives with respect to the parameters, (n, m); where a side failed the other serves, else 0.

    With offsets a, b: f' = (d_a b/a - d_b a/b)/(b - a), second order for any a, b; (f(u + a) - f(u))/a for one of them.
    """
    with np.errstate(invalid="ignore"):
        quotients = (there - here) / offsets[:, np.newaxis]
    good = np.asarray(np.isfinite(quotients).all(axis=1))
    n = points.shape[1]
    if len(quotients) == n:
        return np.where(good[:, np.newaxis], quotients, 0.0)
    a, b = offsets[:n, np.newaxis], offsets[n:, np.newaxis]
    first, second = quotients[:n], quotients[n:]
    with np.errstate(invalid="ignore"):
        both = (first * b - second * a) / (b - a)
    one = np.where(good[:n, np.newaxis], first, np.where(good[n:, np.newaxis], second, 0.0))
    return np.where((good[:n] & good[n:])[:, np.newaxis], both, one)


# NLopt's words for "no further progress": steps below the rounding of the fitness, a line search without descent.
# Before NLopt 2.8 the latter was Python's own RuntimeError.
NO_PROGRESS = (nlopt.RoundoffLimited, getattr(nlopt, "runtime_error", RuntimeError))


@dataclass(frozen=True)
class ByValues(SearchOptions):
    """Minimise in the unit cube by one of NLopt's algorithms that ask for values alone; algorithm: NLopt's name."""

    algorithm: str
    # a model of BOBYQA that reached beyond both bounds would be refused
    initial_step: float = share(0.05, "first step", most=0.5, tune=(0.005, 0.5))
    tolerance: float = option(1e-10, "it ends when a step changes no parameter by more", RANGE)

    def perturbed(self, here: Array) -> tuple[Array, Array] | None:
        """Return the points that derivatives are made of, see `stencil`."""
        return None

    def search(self, task: SearchTask) -> None:
        """Descend from the task's start, or from random ones until one has a fitness."""
        seed = seed_from(task.random)
        local_search(task, lambda start: self.descend(task, seed, start))

    def descend(self, task: SearchTask, seed: int, start: Array) -> None:
        """Let NLopt minimise from a start in the unit cube, (n,)."""
        cube, height = task.cube, Height()

        def value(u: Array, gradient: Array) -> float:
            # the point is a buffer that NLopt uses again
            here = u.copy()
            perturbed = self.perturbed(here) if gradient.size else None
            F = task.ask(cube.candidates(here if perturbed is None else np.vstack([here, perturbed[0]]))).F
            scaled = height.of(float(F[0]))
            if perturbed is not None:
                gradient[:] = slopes(*perturbed, F[:1], F[1:, np.newaxis])[:, 0] / height.scale
            return scaled

        # NLopt's generator belongs to the thread and would be seeded by the clock
        nlopt.srand(seed)
        search = nlopt.opt(getattr(nlopt, self.algorithm), cube.n)
        search.set_lower_bounds(np.zeros(cube.n))
        search.set_upper_bounds(np.ones(cube.n))
        search.set_initial_step(self.initial_step)
        search.set_xtol_abs(self.tolerance)
        calls = Calls(value)
        search.set_min_objective(calls)
        try:
            with calls, suppress(*NO_PROGRESS):
                search.optimize(start)
        finally:
            # the frames of the error hold NLopt's object and that holds the calls: a reference cycle through NLopt,
            # which the garbage collector cannot find
            calls.error = None


@dataclass(frozen=True)
class ByGradient(ByValues):
    """Minimise in the unit cube by one of NLopt's algorithms that ask for derivatives."""

    differences: str = option(CENTRAL, "forward or central", "", known=DIFFERENCES)
    step: float = share(1e-6, "how far a perturbed candidate is")

    def perturbed(self, here: Array) -> tuple[Array, Array]:
        """Return the perturbed points."""
        return stencil(here, self.step, self.differences)


# Name -> what it is, NLopt's name for it. Nelder, Mead 1965 and Box 1965; Powell 2009; Rowan 1990; Powell 1994; Nocedal
# 1980; Kraft 1994.
ALGORITHMS = {
    "nelder_mead": ("simplex of Nelder and Mead (NLopt)", "LN_NELDERMEAD"),
    "bobyqa": ("quadratic models, BOBYQA (NLopt)", "LN_BOBYQA"),
    "sbplx": ("Nelder-Mead on subspaces, Subplex (NLopt)", "LN_SBPLX"),
    "cobyla": ("linear models, COBYLA (NLopt)", "LN_COBYLA"),
    "lbfgs": ("quasi-Newton steps, L-BFGS (NLopt)", "LD_LBFGS"),
    "slsqp": ("sequential quadratic programmes, SLSQP (NLopt)", "LD_SLSQP"),
}
NLOPT = tuple(
    declared(name, note, ByGradient if algorithm.startswith("LD_") else ByValues, algorithm,
             uses_gradient=algorithm.startswith("LD_"))
    for name, (note, algorithm) in ALGORITHMS.items()
)  # fmt: skip
