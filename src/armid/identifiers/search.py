"""What a search is: a function of a task, which asks for the fitness of candidates until the budget ends it.

Also: the starts of local searches, and what protects the routines of other libraries.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, NamedTuple, Protocol

import numpy as np
from pymoo.core.problem import Problem

from armid.errors import ArmidError
from armid.model import Array

# A start on a bound stalls the simplex.
PULLED = 1e-3


class Told(NamedTuple):
    """Fitness of what was asked for, (n,), +inf where a candidate failed; residual vectors, (n, n_total), if wanted."""

    F: Array
    residuals: Array | None = None


class Asker(Protocol):
    def __call__(self, X: Array, residuals: bool = False) -> Told:
        """Return what the candidates X, (n, n_parameters), are worth; raise Dropped at the end of the run."""


class Dropped(BaseException):
    """Unwind a search whose run has ended. It is not an Exception, so that `except Exception` does not catch it."""


class NoFitnessError(Exception):
    """Say that the start of a local search has no fitness."""


@dataclass(frozen=True, eq=False)
class SearchTask:
    """What a search works on: the problem, everything random, whom it asks, its budget in simulations.

    start: where to start, (n_parameters,); None: wherever the search likes.
    """

    problem: Problem
    random: np.random.Generator
    ask: Asker
    budget: int
    start: Array | None = None

    @property
    def cube(self) -> "Cube":
        return Cube(*bounds_of(self.problem))


Search = Callable[[SearchTask], None]


@dataclass(frozen=True, eq=False)
class Cube:
    """Map the problem's box to the unit cube and back."""

    low: Array
    high: Array

    @property
    def n(self) -> int:
        return len(self.low)

    def candidates(self, u: Array) -> Array:
        """Return points of the unit cube as candidates in the box, (n, n_parameters), also for a single point."""
        x = self.low + np.atleast_2d(u) * (self.high - self.low)
        return np.asarray(np.minimum(np.maximum(x, self.low), self.high))

    def point(self, x: Array) -> Array:
        span = self.high - self.low
        u = np.divide(x - self.low, span, out=np.full(len(span), 0.5), where=span > 0.0)
        return np.asarray(np.minimum(np.maximum(u, 0.0), 1.0))

    def first(self, task: SearchTask) -> Array:
        """Return where a search begins: at the task's start, else at a random point, (n,)."""
        return task.random.random(self.n) if task.start is None else self.point(task.start)


def local_search(task: SearchTask, routine: Callable[[Array], None]) -> None:
    """Run a routine from the task's start, or from points drawn in the box until one of them has a fitness."""
    start = task.cube.first(task)
    while True:
        try:
            return routine(np.clip(start, PULLED, 1.0 - PULLED))
        except NoFitnessError:
            start = task.random.random(len(start))


class Calls:
    """Call a function until it raises, then never again: a library may go on calling, or lose the error."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.error: BaseException | None = None

    def __call__(self, *given: Any) -> Any:
        if self.error is not None:
            raise self.error
        try:
            return self.function(*given)
        except BaseException as error:
            self.error = error
            raise


class Height:
    """Scale fitness values to a size of about 1, and give failed candidates a larger value than all others.

    Line searches expect a scale of 1. A failure that is much higher than everything else would distort every model that
    a search fits through it.
    """

    def __init__(self) -> None:
        self.scale = 0.0
        self.lowest, self.highest = inf, -inf

    def of(self, f: float) -> float:
        """Return the height of a fitness; NoFitnessError while none has been finite."""
        if isfinite(f):
            self.scale = self.scale or abs(f) or 1.0
            height = f / self.scale
            self.lowest, self.highest = min(self.lowest, height), max(self.highest, height)
            return height
        if not self.scale:
            raise NoFitnessError
        return 2.0 * self.highest - self.lowest


def bounds_of(problem: Problem) -> tuple[Array, Array]:
    """Return the bounds of a problem; refuse with ArmidError one that our algorithms cannot search."""
    if problem.n_obj != 1 or problem.has_constraints():
        raise ArmidError(
            f"the problem has {problem.n_obj} objectives and {problem.n_constr} constraints, expected 1 and 0"
        )
    if not problem.has_bounds() or not np.isfinite([problem.xl, problem.xu]).all() or (problem.xl > problem.xu).any():
        raise ArmidError(f"the problem's bounds are {problem.xl} and {problem.xu}, expected a finite box")
    return problem.xl, problem.xu
