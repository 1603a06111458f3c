"""pymoo's own swarm, genetic algorithm and differential evolution, their options checked and safe from NaN."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np
from pymoo.core.algorithm import Algorithm

from armid.errors import ArmidError
from armid.identifiers.identifier import (
    Identifier,
    checked,
    checked_choice,
    checked_count,
    checked_flag,
    checked_population,
    checked_share,
    refuse_unknown,
)
from armid.identifiers.pymoo_adapter import DeclaredSearch
from armid.identifiers.search import Array, Ask, Search, SearchTask, SwarmEvaluator
from armid.problem.meter import PENALTY

Check = Callable[[str, Any], Any]
VARIANT = re.compile(r"DE/(rand|best|target-to-best)/[12]/(bin|exp|hypercube|line)")


def checked_variant(name: str, value: Any) -> str:
    """Return a scheme of differential evolution; refuse with ArmidError what is none."""
    if not isinstance(value, str) or not VARIANT.fullmatch(value):
        raise ArmidError(f"{name} is {value!r}, expected DE/rand|best|target-to-best/1|2/bin|exp|hypercube|line")
    return value


@dataclass(frozen=True, eq=False)
class PymooAlgorithm:
    """Declare an algorithm of pymoo: where it stands, how many individuals it has, and the options that it may get.

    options: option, as pymoo calls it -> check of its value; pymoo would swallow any other.
    """

    name: str
    note: str
    place: str
    pop_size: int
    options: Mapping[str, Check]

    def __call__(self, budget: int, **options: Any) -> Algorithm:
        """Return the algorithm; refuse with ArmidError options that pymoo would swallow, and bad values."""
        checked_count("the budget", budget)
        refuse_unknown(options, self.options, f"'{self.name}'")
        given = {"pop_size": self.pop_size} | options
        checked_values = {option: self.options[option](option, value) for option, value in given.items()}
        module, kind = self.place.split(":")
        algorithm = getattr(import_module(f"pymoo.algorithms.soo.nonconvex.{module}"), kind)
        return algorithm(evaluator=SwarmEvaluator(finite=True), **checked_values)

    def identifier(self) -> Identifier:
        return Identifier(self.name, self, self.note, is_global=True)


PYMOO = (
    PymooAlgorithm("pymoo_pso", "adaptive particle swarm (pymoo)", "pso:PSO", 40, {
        "pop_size": checked_population, "w": checked, "c1": checked, "c2": checked, "adaptive": checked_flag,
        "initial_velocity": partial(checked_choice, known=("random", "zero")), "max_velocity_rate": checked_share,
        "pertube_best": checked_flag,
    }),
    PymooAlgorithm("ga", "genetic algorithm (pymoo)", "ga:GA", 80, {
        "pop_size": checked_population, "n_offsprings": checked_population, "eliminate_duplicates": checked_flag,
    }),
    PymooAlgorithm("de", "differential evolution (pymoo)", "de:DE", 40, {
        "pop_size": checked_population, "n_offsprings": checked_population, "variant": checked_variant,
        "CR": checked_share, "F": partial(checked, least=1e-6, expected="a number above 0"), "jitter": checked_flag,
    }),
)  # fmt: skip


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
            # quiet, writing no file, drawing from the task's generator and not from the global one; in one dimension
            # cma fails where a standard deviation reaches its limit, so that there is none
            settings = {
                "bounds": [0.0, 1.0], "popsize": max(4, round(n_candidates)), "randn": normal, "seed": np.nan,
                "verbose": -10, "verb_log": 0, "verb_disp": 0, "signals_filename": "",
                "maxstd": np.inf if cube.n == 1 else None,
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
