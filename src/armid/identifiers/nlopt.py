"""The local searches of NLopt, with and without derivatives: each a small declaration, all run by `NloptSearch`."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar

import nlopt
import numpy as np

from armid.identifiers.identifier import checked, checked_choice, checked_share
from armid.identifiers.least_squares import CENTRAL, KINDS, slopes, stencil
from armid.identifiers.pymoo_adapter import SEEDS, DeclaredSearch
from armid.identifiers.search import Array, Asker, Cube, Height, Search, SearchTask, local_search

# A model of BOBYQA that reached beyond both bounds would be refused.
LONGEST_STEP = 0.5
# NLopt's words for "no further progress": steps below the rounding of the fitness, a line search without descent.
# Before NLopt 2.8 the latter was Python's own RuntimeError.
NO_PROGRESS = (nlopt.RoundoffLimited, getattr(nlopt, "runtime_error", RuntimeError))


@dataclass(frozen=True)
class NloptSearch(DeclaredSearch):
    """Minimise in the unit cube by one of NLopt's algorithms.

    initial_step: first step, as a share of each parameter's range, at most 0.5; tolerance: it ends when a step changes
    no parameter by more than this share of its range.
    """

    algorithm: ClassVar[str]
    initial_step: float = 0.05
    tolerance: float = 1e-10

    def __post_init__(self) -> None:
        checked_share("initial_step", self.initial_step, LONGEST_STEP)
        checked("tolerance", self.tolerance)

    def search(self, task: SearchTask) -> Search:
        cube, seed = task.cube, int(task.random.integers(1, SEEDS))
        return local_search(task, lambda ask, start: self.descend(cube, seed, ask, start))

    def descend(self, cube: Cube, seed: int, ask: Asker, start: Array) -> None:
        # NLopt's generator belongs to the thread and would be seeded by the clock
        nlopt.srand(seed)
        search = nlopt.opt(getattr(nlopt, self.algorithm), cube.n)
        search.set_lower_bounds(np.zeros(cube.n))
        search.set_upper_bounds(np.ones(cube.n))
        search.set_initial_step(self.initial_step)
        search.set_xtol_abs(self.tolerance)
        calls = Calls(self.objective(cube, ask))
        search.set_min_objective(calls)
        try:
            optimised(search, start, calls)
        finally:
            # the frames of the error hold NLopt's object and that holds the calls: a reference cycle through NLopt,
            # which the garbage collector cannot find
            calls.error = None

    def objective(self, cube: Cube, ask: Asker) -> "Objective":
        height = Height()

        def value(u: Array, gradient: Array) -> float:
            # the point is a buffer that NLopt uses again
            here = u.copy()
            if not gradient.size:
                return height.of(float(ask(cube.candidates(here)).F[0]))
            found, gradient[:] = self.with_gradient(here, cube, ask, height)
            return found

        return value

    def with_gradient(self, u: Array, cube: Cube, ask: Asker, height: Height) -> tuple[float, Array]:
        raise NotImplementedError


@dataclass(frozen=True)
class NloptGradientSearch(NloptSearch):
    """Minimise by one of NLopt's algorithms that ask for derivatives.

    differences: "central" or "forward"; step: how far a perturbed candidate is, as a share of the range.
    """

    uses_gradient = True
    differences: str = CENTRAL
    step: float = 1e-6

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_choice("differences", self.differences, KINDS)
        checked_share("step", self.step)

    def with_gradient(self, u: Array, cube: Cube, ask: Asker, height: Height) -> tuple[float, Array]:
        beside = stencil(u, self.step, self.differences)
        F = ask(cube.candidates(np.vstack([u, beside.points]))).F
        found = height.of(float(F[0]))
        return found, slopes(beside, F[:1], F[1:, np.newaxis])[:, 0] / height.scale


class NelderMead(NloptSearch):
    """Simplex in the box (Nelder, Mead 1965; Box 1965)."""

    name, note, algorithm = "nelder_mead", "simplex of Nelder and Mead (NLopt)", "LN_NELDERMEAD"


class Bobyqa(NloptSearch):
    """Quadratic models in a trust region (Powell 2009)."""

    name, note, algorithm = "bobyqa", "quadratic models, BOBYQA (NLopt)", "LN_BOBYQA"


class Sbplx(NloptSearch):
    """Nelder-Mead on a sequence of subspaces (Rowan 1990)."""

    name, note, algorithm = "sbplx", "Nelder-Mead on subspaces, Subplex (NLopt)", "LN_SBPLX"


class Cobyla(NloptSearch):
    """Linear models in a trust region (Powell 1994)."""

    name, note, algorithm = "cobyla", "linear models, COBYLA (NLopt)", "LN_COBYLA"


class Lbfgs(NloptGradientSearch):
    """Limited-memory quasi-Newton steps (Nocedal 1980)."""

    name, note, algorithm = "lbfgs", "quasi-Newton steps, L-BFGS (NLopt)", "LD_LBFGS"


class Slsqp(NloptGradientSearch):
    """Sequential least-squares quadratic programmes (Kraft 1994)."""

    name, note, algorithm = "slsqp", "sequential quadratic programmes, SLSQP (NLopt)", "LD_SLSQP"


NLOPT = (NelderMead, Bobyqa, Sbplx, Cobyla, Lbfgs, Slsqp)
Objective = Callable[[Array, Array], float]


class Calls:
    """Call an objective until it raises, then never again: L-BFGS goes on calling, and NLopt may lose the error."""

    def __init__(self, value: Objective) -> None:
        self.value = value
        self.error: BaseException | None = None

    def __call__(self, u: Array, gradient: Array) -> float:
        """Return the objective at u, the gradient filled in where it is not empty."""
        if self.error is not None:
            raise self.error
        try:
            return self.value(u, gradient)
        except BaseException as error:
            self.error = error
            raise


def optimised(search: nlopt.opt, start: Array, calls: Calls) -> None:
    """Let NLopt run, and raise what a call raised, however NLopt took it."""
    try:
        with suppress(*NO_PROGRESS):
            search.optimize(start)
    except SystemError:
        # BOBYQA, told to stop in a step that it tries once more, returns a result all the same; Python, which finds a
        # result and an error, raises this in place of the error
        if calls.error is None:
            raise
    if calls.error is not None:
        raise calls.error
