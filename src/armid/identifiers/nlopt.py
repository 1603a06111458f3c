"""The local searches of NLopt, with and without derivatives."""

from contextlib import suppress
from dataclasses import dataclass

import nlopt
import numpy as np

from armid.identifiers.identifier import RANGE, declared, option, share
from armid.identifiers.least_squares import CENTRAL, KINDS, Stencil, slopes, stencil
from armid.identifiers.pymoo_adapter import SEEDS, SearchOptions
from armid.identifiers.search import Calls, Height, SearchTask, local_search
from armid.model import Array

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

    def beside(self, here: Array) -> Stencil | None:
        """Return the points that derivatives are made of."""
        return None

    def search(self, task: SearchTask) -> None:
        """Descend from the task's start, or from random ones until one has a fitness."""
        seed = int(task.random.integers(1, SEEDS))
        local_search(task, lambda start: self.descend(task, seed, start))

    def descend(self, task: SearchTask, seed: int, start: Array) -> None:
        """Let NLopt minimise from a start in the unit cube, (n,)."""
        cube, height = task.cube, Height()

        def value(u: Array, gradient: Array) -> float:
            # the point is a buffer that NLopt uses again
            here = u.copy()
            beside = self.beside(here) if gradient.size else None
            F = task.ask(cube.candidates(here if beside is None else np.vstack([here, beside.points]))).F
            found = height.of(float(F[0]))
            if beside is not None:
                gradient[:] = slopes(beside, F[:1], F[1:, np.newaxis])[:, 0] / height.scale
            return found

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
            optimised(search, start, calls)
        finally:
            # the frames of the error hold NLopt's object and that holds the calls: a reference cycle through NLopt,
            # which the garbage collector cannot find
            calls.error = None


@dataclass(frozen=True)
class ByGradient(ByValues):
    """Minimise in the unit cube by one of NLopt's algorithms that ask for derivatives."""

    differences: str = option(CENTRAL, "forward or central", "", known=KINDS)
    step: float = share(1e-6, "how far a perturbed candidate is")

    def beside(self, here: Array) -> Stencil:
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
