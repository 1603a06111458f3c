"""pymoo's own swarm, genetic algorithm and differential evolution, their options checked and safe from NaN."""

import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from pymoo.core.algorithm import Algorithm

from armid.errors import ArmidError
from armid.identifiers.identifier import (
    checked,
    checked_choice,
    checked_count,
    checked_flag,
    checked_population,
    checked_share,
    refuse_unknown,
)
from armid.identifiers.search import SwarmEvaluator

Check = Callable[[str, Any], Any]
VARIANT = re.compile(r"DE/(rand|best|target-to-best)/[12]/(bin|exp|hypercube|line)")


def checked_variant(name: str, value: Any) -> str:
    """Return a scheme of differential evolution; refuse with ArmidError what is none."""
    if not isinstance(value, str) or not VARIANT.fullmatch(value):
        raise ArmidError(f"{name} is {value!r}, expected DE/rand|best|target-to-best/1|2/bin|exp|hypercube|line")
    return value


def checked_velocity(name: str, value: Any) -> str:
    """Return how the first velocities are made."""
    return checked_choice(name, value, ("random", "zero"))


# Option, as pymoo calls it, and what it may be; pymoo would swallow any other.
SWARM: Mapping[str, Check] = {
    "pop_size": checked_population, "w": checked, "c1": checked, "c2": checked, "adaptive": checked_flag,
    "initial_velocity": checked_velocity, "max_velocity_rate": checked_share, "pertube_best": checked_flag,
}  # fmt: skip
GENETIC: Mapping[str, Check] = {
    "pop_size": checked_population, "n_offsprings": checked_population, "eliminate_duplicates": checked_flag,
}  # fmt: skip
DIFFERENTIAL: Mapping[str, Check] = {
    "pop_size": checked_population, "n_offsprings": checked_population, "variant": checked_variant,
    "CR": checked_share, "F": partial(checked, least=1e-6, expected="a number above 0"), "jitter": checked_flag,
}  # fmt: skip


def pymoo_swarm(budget: int, **options: Any) -> Algorithm:
    """Return pymoo's adaptive swarm, 40 particles unless `pop_size` says otherwise."""
    from pymoo.algorithms.soo.nonconvex.pso import PSO

    return checked_algorithm(PSO, "pymoo_pso", budget, 40, SWARM, options)


def genetic(budget: int, **options: Any) -> Algorithm:
    """Return pymoo's genetic algorithm, 80 individuals unless `pop_size` says otherwise."""
    from pymoo.algorithms.soo.nonconvex.ga import GA

    return checked_algorithm(GA, "ga", budget, 80, GENETIC, options)


def differential(budget: int, **options: Any) -> Algorithm:
    """Return pymoo's differential evolution, 40 individuals unless `pop_size` says otherwise."""
    from pymoo.algorithms.soo.nonconvex.de import DE

    return checked_algorithm(DE, "de", budget, 40, DIFFERENTIAL, options)


def checked_algorithm(
    kind: type[Algorithm], name: str, budget: int, pop_size: int, known: Mapping[str, Check],
    options: dict[str, Any],
) -> Algorithm:  # fmt: skip
    """Return an algorithm of pymoo; refuse with ArmidError options that it would swallow, and bad values."""
    checked_count("the budget", budget)
    refuse_unknown(options, known, f"'{name}'")
    wanted = {option: known[option](option, value) for option, value in ({"pop_size": pop_size} | options).items()}
    return kind(evaluator=SwarmEvaluator(finite=True), **wanted)
