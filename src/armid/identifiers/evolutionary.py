"""Populations: pymoo's own algorithms, their options checked and safe from NaN; CMA-ES; points drawn at random."""

from collections.abc import Generator
from dataclasses import dataclass
from importlib import import_module
from itertools import product
from typing import ClassVar

import numpy as np
from pymoo.core.algorithm import Algorithm

from armid.errors import ArmidError
from armid.identifiers.identifier import SMALLEST_SHARE, Options, declared, option, options_in, population, share
from armid.identifiers.search import FiniteEvaluator, SearchOptions, SearchTask
from armid.model import Array
from armid.problem.meter import PENALTY

# Of each start of CMA-ES: candidates at a time, first standard deviation, most simulations; and what it has used.
Restarts = Generator[tuple[float, float, float], int, None]


class PymooOptions(Options):
    """Options of an algorithm of pymoo, which would swallow any other; place: its module and class."""

    place: ClassVar[str]

    def build(self, budget: int) -> Algorithm:
        """Return the algorithm; what is None is left to pymoo."""
        module, kind = self.place.split(":")
        given = {field.name: getattr(self, field.name) for field in options_in(type(self))}
        algorithm = getattr(import_module(f"pymoo.algorithms.soo.nonconvex.{module}"), kind)
        return algorithm(evaluator=FiniteEvaluator(), **{n: value for n, value in given.items() if value is not None})


@dataclass(frozen=True)
class PymooPSO(PymooOptions):
    """Particle swarm whose w, c1 and c2 adapt themselves (pymoo)."""

    place = "pso:PSO"
    pop_size: int = population(40, "individuals of the population", tune=(5, 100))
    c1: float = option(2.0, "pull towards a particle's own best", tune=(0.3, 2.5))
    c2: float = option(2.0, "pull towards the best of all", tune=(0.3, 2.5))
    w: float = option(0.9, "inertia", tune=(0.3, 1.0))
    adaptive: bool = option(True, "whether w, c1 and c2 adapt themselves", "")
    initial_velocity: str = option("random", "random or zero", "", known=("random", "zero"))
    max_velocity_rate: float = share(0.2, "largest step of a particle", tune=(0.02, 1.0))
    pertube_best: bool = option(True, "whether the best is disturbed at random", "")


@dataclass(frozen=True)
class GeneticAlgorithm(PymooOptions):
    """Genetic algorithm (pymoo)."""

    place = "ga:GA"
    pop_size: int = population(80, "individuals of the population", tune=(8, 160))
    n_offsprings: int | None = population(None, "offspring of a generation, by default as many as individuals")
    eliminate_duplicates: bool = option(True, "whether equal individuals are dropped", "")


@dataclass(frozen=True)
class DifferentialEvolution(PymooOptions):
    """Differential evolution (pymoo)."""

    place = "de:DE"
    pop_size: int = population(40, "individuals of the population", tune=(8, 120))
    n_offsprings: int | None = population(None, "offspring of a generation, by default as many as individuals")
    variant: str = option(
        "DE/best/1/bin", "scheme, DE/rand/1/bin", "", expected="DE/rand|best|target-to-best/1|2/bin|exp|hypercube|line",
        known=tuple(map("/".join, product(["DE"], ["rand", "best", "target-to-best"], "12",
                                          ["bin", "exp", "hypercube", "line"]))),
    )  # fmt: skip
    CR: float | None = option(None, "chance that a parameter is crossed over", least=SMALLEST_SHARE, most=1.0,
                                   tune=(0.1, 1.0))  # fmt: skip
    F: float | None = option(None, "weight of a difference", least=1e-6, expected="a number above 0", tune=(0.3, 1.0))
    jitter: bool | None = option(None, "whether the weight is disturbed for each parameter", "")

    def build(self, budget: int) -> Algorithm:
        """Return the algorithm; refuse more offspring than it has individuals."""
        if (self.n_offsprings or 0) > self.pop_size:
            raise ArmidError(f"option n_offsprings of 'de' is {self.n_offsprings}, at most its pop_size of "
                             f"{self.pop_size} is expected")  # fmt: skip
        return super().build(budget)


@dataclass(frozen=True)
class Cmaes(SearchOptions):
    """Covariance matrix adaptation (Hansen, arXiv:1604.00772) with restarts (IPOP, Auger 2005).

    Each start is a random point of the box; the first is the task's, if it has one.
    """

    initial_step: float = share(0.25, "first standard deviation", tune=(0.05, 0.5))
    n_candidates: int = population(8, "candidates at a time, those of the first population", tune=(4, 40))
    growth: float = option(2.0, "factor of the population at each restart", least=1.0, tune=(1.0, 4.0))

    def restarts(self, random: np.random.Generator) -> Restarts:
        """Yield what each start is; a larger population each time."""
        population = float(self.n_candidates)
        while True:
            yield population, self.initial_step, np.inf
            population *= self.growth

    def search(self, task: SearchTask) -> None:
        """Restart CMA-ES until the task drops it."""
        from cma import CMAEvolutionStrategy

        def normal(*shape: int) -> Array:
            return task.random.standard_normal(shape)

        cube, starts = task.cube, self.restarts(task.random)
        start, (population, step, most) = cube.first(task), next(starts)
        while True:
            # quiet, writing no file, drawing from the task's generator and not from the global one; in one dimension
            # cma fails where a standard deviation reaches its limit, so that there is none
            settings = {
                "bounds": [0.0, 1.0], "popsize": max(4, round(population)), "randn": normal, "seed": np.nan,
                "verbose": -10, "verb_log": 0, "verb_disp": 0, "signals_filename": "",
                "maxstd": np.inf if cube.n == 1 else None,
            }  # fmt: skip
            strategy, used = CMAEvolutionStrategy(start, step, settings), 0
            while not strategy.stop() and used < most:
                points = strategy.ask()
                strategy.tell(points, np.minimum(task.ask(cube.candidates(np.array(points))).F, PENALTY))
                used += len(points)
            population, step, most = starts.send(used)
            start = task.random.random(cube.n)


@dataclass(frozen=True)
class BipopCmaes(Cmaes):
    """CMA-ES with two kinds of restarts that share the budget evenly (Hansen 2009, doi:10.1145/1570256.1570333).

    The large ones grow as in IPOP. A small one has lambda_0 (lambda / 2 lambda_0)^(U^2) candidates, lambda those of the
    last large one, a first step smaller by 10^(-2 U'), and at most half of what the last large one used.
    """

    def restarts(self, random: np.random.Generator) -> Restarts:
        """Yield what each start is, in turn of the kind that has used less."""
        first, n_large, large, small = float(self.n_candidates), float(self.n_candidates), 0, 0
        last = yield first, self.initial_step, np.inf
        while True:
            if small < large:
                n_small = first * max(0.5 * n_large / first, 1.0) ** (random.random() ** 2)
                small += yield n_small, self.initial_step * 10.0 ** (-2.0 * random.random()), 0.5 * last
            else:
                n_large *= self.growth
                last = yield n_large, self.initial_step, np.inf
                large += last


@dataclass(frozen=True)
class Uniform(SearchOptions):
    """Draw candidates uniformly from the box and learn nothing."""

    n_candidates: int = population(80, "candidates at a time")

    def search(self, task: SearchTask) -> None:
        """Draw until the task drops it."""
        while True:
            task.ask(task.cube.candidates(task.random.random((self.n_candidates, task.cube.n))))


@dataclass(frozen=True)
class Sobol(SearchOptions):
    """Draw scrambled Sobol points, a power of 2 at a time (Owen 1998, doi:10.1006/jcom.1998.0487)."""

    n_candidates: int = population(64, "candidates at a time")

    def search(self, task: SearchTask) -> None:
        """Draw until the task drops it."""
        from scipy.stats import qmc

        points = qmc.Sobol(task.cube.n, rng=task.random)
        while True:
            task.ask(task.cube.candidates(points.random(self.n_candidates)))


EVOLUTIONARY = (
    declared("pymoo_pso", "adaptive particle swarm (pymoo)", PymooPSO, is_global=True),
    declared("ga", "genetic algorithm (pymoo)", GeneticAlgorithm, is_global=True),
    declared("de", "differential evolution (pymoo)", DifferentialEvolution, is_global=True),
    declared("cmaes", "CMA-ES, restarted with larger populations (cma)", Cmaes, is_global=True),
    declared("bipop_cmaes", "CMA-ES, restarted with large and small populations in turn, BIPOP (cma)", BipopCmaes,
             is_global=True),
    declared("random", "uniform random search, to compare with", Uniform, is_global=True),
    declared("sobol", "scrambled Sobol points (scipy), to compare with", Sobol, is_global=True),
)  # fmt: skip
