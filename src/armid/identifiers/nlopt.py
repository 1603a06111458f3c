"""The local searches of NLopt, with and without derivatives, asked and told."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import nlopt
import numpy as np

from armid.identifiers.identifier import checked, checked_choice, checked_share
from armid.identifiers.least_squares import CENTRAL, KINDS, slopes, stencil
from armid.identifiers.search import Array, Asker, Cube, Height, Method, Search, Task, started

ALGORITHMS = {
    "nelder_mead": "LN_NELDERMEAD", "bobyqa": "LN_BOBYQA", "sbplx": "LN_SBPLX", "cobyla": "LN_COBYLA",
    "lbfgs": "LD_LBFGS", "slsqp": "LD_SLSQP",
}  # fmt: skip
SEEDS = 2**31 - 1
# A model of BOBYQA that reached beyond both bounds would be refused.
LONGEST_STEP = 0.5
Objective = Callable[[Array, Array], float]
# Its words for "no further progress": steps below the rounding of the fitness, a line search without descent. Before
# NLopt 2.8 the latter was Python's own RuntimeError.
NO_PROGRESS = (nlopt.RoundoffLimited, getattr(nlopt, "runtime_error", RuntimeError))


@dataclass(frozen=True)
class LocalOptions:
    """Hold the options of a search without derivatives.

    initial_step: first step, as a share of each parameter's range, at most 0.5; tolerance: it ends when a step changes
    no parameter by more than this share of its range.
    """

    initial_step: float = 0.05
    tolerance: float = 1e-10

    def __post_init__(self) -> None:
        checked_share("initial_step", self.initial_step, LONGEST_STEP)
        checked("tolerance", self.tolerance)


@dataclass(frozen=True)
class GradientOptions(LocalOptions):
    """Hold the options of a search with derivatives.

    differences: "central" or "forward"; step: how far a perturbed candidate is, as a share of the range.
    """

    differences: str = CENTRAL
    step: float = 1e-6

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_choice("differences", self.differences, KINDS)
        checked_share("step", self.step)


def nlopt_method(name: str, options: LocalOptions) -> Method:
    """Return the search of one of the `ALGORITHMS`."""

    def method(task: Task) -> Search:
        cube, seed = task.cube, int(task.random.integers(1, SEEDS))
        return started(task, lambda ask, start: descend(name, options, cube, seed, ask, start))

    return method


def descend(name: str, options: LocalOptions, cube: Cube, seed: int, ask: Asker, start: Array) -> None:
    """Minimise in the unit cube from a start; the evaluated candidates are the result, so nothing is returned."""
    # NLopt's generator belongs to the thread and would be seeded by the clock
    nlopt.srand(seed)
    search = nlopt.opt(getattr(nlopt, ALGORITHMS[name]), cube.n)
    search.set_lower_bounds(np.zeros(cube.n))
    search.set_upper_bounds(np.ones(cube.n))
    search.set_initial_step(options.initial_step)
    search.set_xtol_abs(options.tolerance)
    calls = Calls(objective(options, cube, ask))
    search.set_min_objective(calls)
    try:
        optimised(search, start, calls)
    finally:
        # its frames hold NLopt's object and that the calls, a circle that no garbage collector sees
        calls.error = None


def optimised(search: nlopt.opt, start: Array, calls: "Calls") -> None:
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


def objective(options: LocalOptions, cube: Cube, ask: Asker) -> Objective:
    """Return what NLopt calls: (point, gradient to be filled or empty) -> fitness."""
    height = Height()

    def value(u: Array, gradient: Array) -> float:
        # the point is a buffer that NLopt uses again
        here = u.copy()
        if not gradient.size:
            return height.of(float(ask(cube.candidates(here)).F[0]))
        assert isinstance(options, GradientOptions)
        beside = stencil(here, options.step, options.differences)
        F = ask(cube.candidates(np.vstack([here, beside.points]))).F
        found = height.of(float(F[0]))
        gradient[:] = slopes(beside, F[:1], F[1:, np.newaxis])[:, 0] / height.scale
        return found

    return value
