"""pymoo's own swarm, genetic algorithm and differential evolution, their options checked and safe from NaN."""

import re
from collections.abc import Callable, Generator, Mapping
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
from armid.identifiers.pymoo_adapter import declared
from armid.identifiers.search import Ask, Method, Search, SearchTask, SwarmEvaluator
from armid.model import Array
from armid.problem.meter import PENALTY

Check = Callable[[str, Any], Any]
# Of each start of CMA-ES: candidates at a time, first standard deviation, most simulations; and what it has used.
Restarts = Generator[tuple[float, float, float], int, None]
VARIANT = re.compile(r"DE/(rand|best|target-to-best)/[12]/(bin|exp|hypercube|line)")


def checked_variant(name: str, value: Any) -> str:
    if not isinstance(value, str) or not VARIANT.fullmatch(value):
        raise ArmidError(f"{name} is {value!r}, expected DE/rand|best|target-to-best/1|2/bin|exp|hypercube|line")
    return value


@dataclass(frozen=True, eq=False)
class PymooAlgorithm:
    """An algorithm of pymoo, its default population, and its options with checks: it would swallow any other."""

    name: str
    note: str
    place: str
    pop_size: int
    options: Mapping[str, Check]

    def __call__(self, budget: int, **options: Any) -> Algorithm:
        """Return the algorithm; refuse options that pymoo would swallow, and bad values."""
        checked_count("the budget", budget)
        refuse_unknown(options, self.options, f"'{self.name}'")
        given = {"pop_size": self.pop_size} | options
        checked_values = {option: self.options[option](option, value) for option, value in given.items()}
        if self.name == "de" and checked_values.get("n_offsprings", 0) > checked_values["pop_size"]:
            most, found = checked_values["pop_size"], checked_values["n_offsprings"]
            raise ArmidError(f"option n_offsprings of 'de' is {found}, at most its pop_size of {most} is expected")
        return self.algorithm()(evaluator=SwarmEvaluator(finite=True), **checked_values)

    def algorithm(self) -> Any:
        module, kind = self.place.split(":")
        return getattr(import_module(f"pymoo.algorithms.soo.nonconvex.{module}"), kind)


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


def cmaes(initial_step: float = 0.25, n_candidates: int = 8, growth: float = 2.0) -> Method:
    """Covariance matrix adaptation (Hansen, arXiv:1604.00772) with restarts (IPOP, Auger 2005).

    Each start is a random point of the box; the first is the task's, if it has one.
    initial_step: first standard deviation, as a share of each parameter's range; n_candidates: of the first
    population; growth: factor of the population at each restart.
    """

    def restarts(random: np.random.Generator) -> Restarts:
        population = float(n_candidates)
        while True:
            yield population, initial_step, np.inf
            population *= growth

    return restarted(restarts, initial_step, n_candidates, growth)


def bipop_cmaes(initial_step: float = 0.25, n_candidates: int = 8, growth: float = 2.0) -> Method:
    """CMA-ES with two kinds of restarts that share the budget evenly (Hansen 2009, doi:10.1145/1570256.1570333).

    The large ones grow as in IPOP. A small one has lambda_0 (lambda / 2 lambda_0)^(U^2) candidates, lambda those of the
    last large one, a first step smaller by 10^(-2 U'), and at most half of what the last large one used.
    """

    def restarts(random: np.random.Generator) -> Restarts:
        first, n_large, large, small = float(n_candidates), float(n_candidates), 0, 0
        last = yield first, initial_step, np.inf
        while True:
            if small < large:
                n_small = first * max(0.5 * n_large / first, 1.0) ** (random.random() ** 2)
                small += yield n_small, initial_step * 10.0 ** (-2.0 * random.random()), 0.5 * last
            else:
                n_large *= growth
                last = yield n_large, initial_step, np.inf
                large += last

    return restarted(restarts, initial_step, n_candidates, growth)


def restarted(
    restarts: Callable[[np.random.Generator], Restarts], initial_step: float, n_candidates: int, growth: float
) -> Method:
    checked_share("initial_step", initial_step)
    checked_population("n_candidates", n_candidates)
    checked("growth", growth, 1.0, "a number of at least 1")

    def search(task: SearchTask) -> Search:
        from cma import CMAEvolutionStrategy

        def normal(*shape: int) -> Array:
            return task.random.standard_normal(shape)

        cube, starts = task.cube, restarts(task.random)
        start = cube.drawn(task.random) if task.start is None else cube.point(task.start)
        population, step, most = next(starts)
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
                told = yield Ask(cube.candidates(np.array(points)))
                strategy.tell(points, np.minimum(told.F, PENALTY))
                used += len(points)
            population, step, most = starts.send(used)
            start = cube.drawn(task.random)

    return search


def uniform(n_candidates: int = 80) -> Method:
    """Draw candidates uniformly from the box and learn nothing. n_candidates: drawn at a time."""
    checked_population("n_candidates", n_candidates)

    def search(task: SearchTask) -> Search:
        cube = task.cube
        while True:
            yield Ask(cube.candidates(task.random.random((n_candidates, cube.n))))

    return search


def sobol(n_candidates: int = 64) -> Method:
    """Draw scrambled Sobol points, a power of 2 at a time (Owen 1998, doi:10.1006/jcom.1998.0487)."""
    checked_population("n_candidates", n_candidates)

    def search(task: SearchTask) -> Search:
        from scipy.stats import qmc

        points = qmc.Sobol(task.cube.n, rng=task.random)
        while True:
            yield Ask(task.cube.candidates(points.random(n_candidates)))

    return search


EVOLUTIONARY = (
    *(Identifier(build.name, build, build.note, is_global=True) for build in PYMOO),
    declared("cmaes", "CMA-ES, restarted with larger populations (cma)", cmaes, is_global=True),
    declared("bipop_cmaes", "CMA-ES, restarted with large and small populations in turn, BIPOP (cma)", bipop_cmaes,
             is_global=True),
    declared("random", "uniform random search, to compare with", uniform, is_global=True),
    declared("sobol", "scrambled Sobol points (scipy), to compare with", sobol, is_global=True),
)  # fmt: skip
