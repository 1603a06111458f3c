"""pymoo's own swarm, genetic algorithm and differential evolution, their options checked and safe from NaN."""

from typing import Any

from pymoo.core.algorithm import Algorithm

from armid.identifiers.options import checked_count, refuse_unknown
from armid.identifiers.population import SwarmEvaluator

# What pymoo calls them; it would swallow any other.
SWARM = ("pop_size", "w", "c1", "c2", "adaptive", "initial_velocity", "max_velocity_rate", "pertube_best")
GENETIC = ("pop_size", "n_offsprings", "eliminate_duplicates")
DIFFERENTIAL = ("pop_size", "n_offsprings", "variant", "CR", "F", "dither", "jitter")


def pymoo_swarm(budget: int, **options: Any) -> Algorithm:
    """Return pymoo's adaptive swarm, 40 particles unless `pop_size` says otherwise."""
    from pymoo.algorithms.soo.nonconvex.pso import PSO  # noqa: PLC0415 - takes time to import

    return checked_algorithm(PSO, "pymoo_pso", budget, 40, SWARM, options)


def genetic(budget: int, **options: Any) -> Algorithm:
    """Return pymoo's genetic algorithm, 80 individuals unless `pop_size` says otherwise."""
    from pymoo.algorithms.soo.nonconvex.ga import GA  # noqa: PLC0415 - takes time to import

    return checked_algorithm(GA, "ga", budget, 80, GENETIC, options)


def differential(budget: int, **options: Any) -> Algorithm:
    """Return pymoo's differential evolution, 40 individuals unless `pop_size` says otherwise."""
    from pymoo.algorithms.soo.nonconvex.de import DE  # noqa: PLC0415 - takes time to import

    return checked_algorithm(DE, "de", budget, 40, DIFFERENTIAL, options)


def checked_algorithm(
    kind: type[Algorithm], name: str, budget: int, pop_size: int, known: tuple[str, ...], options: dict[str, Any]
) -> Algorithm:
    """Return an algorithm of pymoo; refuse with ArmidError options that it would swallow."""
    checked_count("the budget", budget)
    refuse_unknown(options, known, f"'{name}'")
    size = checked_count("pop_size", options.pop("pop_size", pop_size))
    return kind(pop_size=size, evaluator=SwarmEvaluator(finite=True), **options)
