"""The local searches of NLopt, with and without derivatives: all run by `by_gradient`."""

from contextlib import suppress
from functools import partial

import nlopt
import numpy as np

from armid.identifiers.identifier import checked, checked_choice, checked_share
from armid.identifiers.least_squares import CENTRAL, KINDS, slopes, stencil
from armid.identifiers.pymoo_adapter import SEEDS, declared
from armid.identifiers.search import Asker, Calls, Height, Method, Search, SearchTask, local_search
from armid.model import Array

# A model of BOBYQA that reached beyond both bounds would be refused.
LONGEST_STEP = 0.5
# NLopt's words for "no further progress": steps below the rounding of the fitness, a line search without descent.
# Before NLopt 2.8 the latter was Python's own RuntimeError.
NO_PROGRESS = (nlopt.RoundoffLimited, getattr(nlopt, "runtime_error", RuntimeError))


def by_values(algorithm: str, initial_step: float = 0.05, tolerance: float = 1e-10) -> Method:
    """Minimise in the unit cube by one of NLopt's algorithms that ask for values alone; options as of `by_gradient`."""
    return by_gradient(algorithm, initial_step, tolerance)


def by_gradient(
    algorithm: str, initial_step: float = 0.05, tolerance: float = 1e-10, differences: str = CENTRAL, step: float = 1e-6
) -> Method:
    """Minimise in the unit cube by one of NLopt's algorithms, with derivatives where it asks for them.

    initial_step: first step, as a share of each parameter's range, at most 0.5; tolerance: it ends when a step changes
    no parameter by more than this share of its range. differences: "central" or "forward"; step: how far a perturbed
    candidate is, as a share of the range.
    """
    checked_share("initial_step", initial_step, LONGEST_STEP)
    checked("tolerance", tolerance)
    checked_choice("differences", differences, KINDS)
    checked_share("step", step)

    def search(task: SearchTask) -> Search:
        cube, seed = task.cube, int(task.random.integers(1, SEEDS))

        def descend(ask: Asker, start: Array) -> None:
            height = Height()

            def value(u: Array, gradient: Array) -> float:
                # the point is a buffer that NLopt uses again
                here = u.copy()
                if not gradient.size:
                    return height.of(float(ask(cube.candidates(here)).F[0]))
                beside = stencil(here, step, differences)
                F = ask(cube.candidates(np.vstack([here, beside.points]))).F
                found = height.of(float(F[0]))
                gradient[:] = slopes(beside, F[:1], F[1:, np.newaxis])[:, 0] / height.scale
                return found

            # NLopt's generator belongs to the thread and would be seeded by the clock
            nlopt.srand(seed)
            search = nlopt.opt(getattr(nlopt, algorithm), cube.n)
            search.set_lower_bounds(np.zeros(cube.n))
            search.set_upper_bounds(np.ones(cube.n))
            search.set_initial_step(initial_step)
            search.set_xtol_abs(tolerance)
            calls = Calls(value)
            search.set_min_objective(calls)
            try:
                optimised(search, start, calls)
            finally:
                # the frames of the error hold NLopt's object and that holds the calls: a reference cycle through NLopt,
                # which the garbage collector cannot find
                calls.error = None

        return local_search(task, descend)

    return search


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
    declared(name, note, partial(by_gradient, algorithm), uses_gradient=True) if algorithm.startswith("LD_")
    else declared(name, note, partial(by_values, algorithm))
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
