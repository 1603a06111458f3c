"""CMA-ES, started again with a larger population until the budget is used."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from armid.identifiers.identifier import checked, checked_population, checked_share
from armid.identifiers.search import Array, Ask, Method, Search, Task
from armid.problem.meter import PENALTY


@dataclass(frozen=True)
class CmaesOptions:
    """Hold the options of CMA-ES.

    initial_step: first standard deviation, as a share of each parameter's range; n_candidates: of the first
    population; growth: factor of the population at each restart.
    """

    initial_step: float = 0.25
    n_candidates: int = 8
    growth: float = 2.0

    def __post_init__(self) -> None:
        checked_share("initial_step", self.initial_step)
        checked_population("n_candidates", self.n_candidates)
        checked("growth", self.growth, 1.0, "a number of at least 1")


def cmaes_method(options: CmaesOptions) -> Method:
    """Return the search with covariance matrix adaptation (Hansen, arXiv:1604.00772; restarts: IPOP, Auger 2005).

    Each start is a random point of the box; the first is the task's, if it has one.
    """

    def method(task: Task) -> Search:
        cube, n_candidates = task.cube, float(options.n_candidates)
        start = cube.drawn(task.random) if task.start is None else cube.point(task.start)
        while True:
            yield from one_run(task, start, options.initial_step, max(4, round(n_candidates)))
            n_candidates *= options.growth
            start = cube.drawn(task.random)

    return method


def one_run(task: Task, start: Array, initial_step: float, n_candidates: int) -> Search:
    """Search until CMA-ES finds nothing more from this start."""
    from cma import CMAEvolutionStrategy

    strategy = CMAEvolutionStrategy(start, initial_step, settings(task, n_candidates))
    cube = task.cube
    while not strategy.stop():
        points = strategy.ask()
        told = yield Ask(cube.candidates(np.array(points)))
        strategy.tell(points, np.minimum(told.F, PENALTY))
    return True


def settings(task: Task, n_candidates: int) -> dict[str, Any]:
    """Return options of cma: quiet, writing no file, drawing from the task's generator and not from the global one."""

    def normal(*shape: int) -> Array:
        return task.random.standard_normal(shape)

    return {
        "bounds": [0.0, 1.0], "popsize": n_candidates, "randn": normal, "seed": np.nan, "verbose": -10, "verb_log": 0,
        "verb_disp": 0, "signals_filename": "",
    }  # fmt: skip


@dataclass(frozen=True)
class UniformOptions:
    """Hold the options of random search. n_candidates: drawn at a time."""

    n_candidates: int = 80

    def __post_init__(self) -> None:
        checked_population("n_candidates", self.n_candidates)


def uniform_method(options: UniformOptions) -> Method:
    """Return the search that draws candidates uniformly from the box and learns nothing."""

    def method(task: Task) -> Search:
        cube = task.cube
        while True:
            yield Ask(cube.candidates(task.random.random((options.n_candidates, cube.n))))

    return method
