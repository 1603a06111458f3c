"""What a search is: a generator that asks for candidates and is told what they are worth."""

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from pymoo.core.problem import Problem

from armid.identifiers.population import box

Array = NDArray[np.float64]


class Ask(NamedTuple):
    """Candidates to evaluate as one population, (n, n_parameters); residuals: whether their vectors are wanted."""

    X: Array
    residuals: bool = False


class Told(NamedTuple):
    """Fitness of what was asked for, (n,), +inf where a candidate failed; residual vectors, (n, n_total), if wanted."""

    F: Array
    residuals: Array | None = None


class Asker(Protocol):
    """What a routine calls for values."""

    def __call__(self, X: Array, residuals: bool = False) -> Told:
        """Return what the candidates X, (n, n_parameters), are worth."""


class Dropped(BaseException):
    """Unwind a routine: nobody wants its candidates any more. No error, so that nobody catches it by the way."""


@dataclass(frozen=True, eq=False)
class Task:
    """Hold what a search works on: the problem, everything random, and where to start (None: wherever it likes).

    ask: answers at once where whoever runs the search lets it, and raises Dropped at the end of the run; a routine
    that calls for values then needs no thread. None: a search has to yield what it asks for. It may do so in any case.
    """

    problem: Problem
    random: np.random.Generator
    start: Array | None = None
    ask: Asker | None = None

    def at(self, start: Array | None) -> "Task":
        """Return the task with another start, (n_parameters,)."""
        return replace(self, start=start)

    @property
    def cube(self) -> "Cube":
        """The unit cube in which local searches work."""
        return Cube(*box(self.problem))


@dataclass(frozen=True, eq=False)
class Cube:
    """Map the problem's box to the unit cube and back."""

    low: Array
    high: Array

    @property
    def n(self) -> int:
        """Number of parameters."""
        return len(self.low)

    def candidates(self, u: Array) -> Array:
        """Return points of the unit cube as candidates in the box, (n, n_parameters), also for a single point."""
        x = self.low + np.atleast_2d(u) * (self.high - self.low)
        return np.asarray(np.minimum(np.maximum(x, self.low), self.high))

    def point(self, x: Array) -> Array:
        """Return a candidate of the box as a point of the unit cube, (n_parameters,)."""
        span = self.high - self.low
        u = np.divide(x - self.low, span, out=np.full(len(span), 0.5), where=span > 0.0)
        return np.asarray(np.minimum(np.maximum(u, 0.0), 1.0))

    def drawn(self, random: np.random.Generator) -> Array:
        """Return a uniform random point of the unit cube."""
        return random.random(self.n)


Search = Generator[Ask, Told, bool]
Method = Callable[[Task], Search]
"""What makes a search of a task; the search returns whether it met any candidate that has a fitness."""


class Best:
    """Remember the best candidate of a search."""

    def __init__(self) -> None:
        self.x: Array | None = None
        self.f = np.inf

    def see(self, X: Array, F: Array) -> None:
        """Look at candidates (n, n_parameters) and their fitness (n,)."""
        i = int(np.argmin(F))
        if F[i] < self.f:
            self.x, self.f = X[i].copy(), float(F[i])
