"""CMA-ES, started again with a larger population until the budget is used, and uniform random search beside it."""

from dataclasses import dataclass

import numpy as np

from armid.identifiers.identifier import checked, checked_population, checked_share
from armid.identifiers.pymoo_adapter import DeclaredSearch
from armid.identifiers.search import Array, Ask, Search, SearchTask
from armid.problem.meter import PENALTY


@dataclass(frozen=True)
class Cmaes(DeclaredSearch):
    """Covariance matrix adaptation (Hansen, arXiv:1604.00772) with restarts (IPOP, Auger 2005).

    Each start is a random point of the box; the first is the task's, if it has one.
    initial_step: first standard deviation, as a share of each parameter's range; n_candidates: of the first
    population; growth: factor of the population at each restart.
    """

    name, note, is_global = "cmaes", "CMA-ES, restarted with larger populations (cma)", True
    initial_step: float = 0.25
    n_candidates: int = 8
    growth: float = 2.0

    def __post_init__(self) -> None:
        checked_share("initial_step", self.initial_step)
        checked_population("n_candidates", self.n_candidates)
        checked("growth", self.growth, 1.0, "a number of at least 1")

    def search(self, task: SearchTask) -> Search:
        """Search from start to start, each until CMA-ES finds nothing more from it."""
        from cma import CMAEvolutionStrategy

        def normal(*shape: int) -> Array:
            return task.random.standard_normal(shape)

        cube, n_candidates = task.cube, float(self.n_candidates)
        start = cube.drawn(task.random) if task.start is None else cube.point(task.start)
        while True:
            # quiet, writing no file, drawing from the task's generator and not from the global one
            settings = {
                "bounds": [0.0, 1.0], "popsize": max(4, round(n_candidates)), "randn": normal, "seed": np.nan,
                "verbose": -10, "verb_log": 0, "verb_disp": 0, "signals_filename": "",
            }  # fmt: skip
            strategy = CMAEvolutionStrategy(start, self.initial_step, settings)
            while not strategy.stop():
                points = strategy.ask()
                told = yield Ask(cube.candidates(np.array(points)))
                strategy.tell(points, np.minimum(told.F, PENALTY))
            n_candidates *= self.growth
            start = cube.drawn(task.random)


@dataclass(frozen=True)
class UniformSearch(DeclaredSearch):
    """Draw candidates uniformly from the box and learn nothing. n_candidates: drawn at a time."""

    name, note, is_global = "random", "uniform random search, to compare with", True
    n_candidates: int = 80

    def __post_init__(self) -> None:
        checked_population("n_candidates", self.n_candidates)

    def search(self, task: SearchTask) -> Search:
        """Draw for ever."""
        cube = task.cube
        while True:
            yield Ask(cube.candidates(task.random.random((self.n_candidates, cube.n))))
