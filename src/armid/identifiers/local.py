"""How a local search starts, and what it sees where simulations fail."""

from collections.abc import Callable
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from armid.identifiers.search import Asker, Search, Task
from armid.identifiers.thread import as_search

Array = NDArray[np.float64]
# A start on a bound stalls the simplex.
PULLED = 1e-3


class NoFitnessError(Exception):
    """Say that the start of a local search has no fitness."""


def started(task: Task, routine: Callable[[Asker, Array], None]) -> Search:
    """Run a routine from the task's start, or from points drawn in the box until one of them has a fitness.

    routine: takes what it asks and its start in the unit cube, (n_parameters,).
    """
    cube = task.cube
    start = cube.drawn(task.random) if task.start is None else cube.point(task.start)
    while not (yield from moved(task, attempt(routine, pulled(start)))):
        start = cube.drawn(task.random)
    return True


def moved(task: Task, routine: Callable[[Asker], bool]) -> Search:
    """Run a routine: at once where the task answers at once, else in a thread that yields what it asks for."""
    return (yield from as_search(routine)) if task.ask is None else routine(task.ask)


def attempt(routine: Callable[[Asker, Array], None], start: Array) -> Callable[[Asker], bool]:
    """Return a run of the routine from a start that says whether the start has a fitness."""

    def run(ask: Asker) -> bool:
        try:
            routine(ask, start)
        except NoFitnessError:
            return False
        return True

    return run


def pulled(u: Array) -> Array:
    """Return a point of the unit cube pulled inside by 0.1 % of the range where it sits on a bound."""
    return np.asarray(np.minimum(np.maximum(u, PULLED), 1.0 - PULLED))


class Height:
    """Turn fitness values into heights of about 1, and give what failed a height above all that was seen.

    Line searches expect a scale of 1, and a likelihood may be of any; more than a little above all that was seen would
    bend every model that is laid through it.
    """

    def __init__(self) -> None:
        self.scale = 0.0
        self.lowest, self.highest = inf, -inf

    def of(self, f: float) -> float:
        """Return the height of a fitness.

        Raises NoFitnessError while none has been finite: there is nothing to start from.
        """
        if isfinite(f):
            self.scale = self.scale or abs(f) or 1.0
            height = f / self.scale
            self.lowest, self.highest = min(self.lowest, height), max(self.highest, height)
            return height
        if not self.scale:
            raise NoFitnessError
        return 2.0 * self.highest - self.lowest
