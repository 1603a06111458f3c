"""The identifiers by name, and how a user's own becomes one."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from pymoo.core.algorithm import Algorithm

from armid.identifiers.pso import PaperPSO, checked_count
from armid.model.errors import ArmidError


@dataclass(frozen=True)
class Identifier:
    """Declare a method that finds parameters.

    name: as studies spell it; build: budget in simulations -> a fresh algorithm of pymoo; note: what it is, in words.
    is_global: it searches the whole box; uses_gradient: it asks for derivatives; is_stochastic: a seed changes it.
    """

    name: str
    build: Callable[[int], Algorithm]
    note: str = ""
    is_global: bool = False
    uses_gradient: bool = False
    is_stochastic: bool = True


def swarm(budget: int) -> PaperPSO:
    """Return the paper's swarm with its inertia schedule stretched over the budget.

    budget: number of simulations; below 80 the swarm has that many particles. Raises ArmidError unless it is above 0.
    """
    budget = checked_count("the budget", budget)
    n_particles = min(80, budget)
    return PaperPSO(n_particles=n_particles, n_iterations=-(-budget // n_particles))


def as_identifier(name: str, obj: Any) -> Identifier:
    """Return an Identifier as it is, or make one of a subclass of pymoo's Algorithm or of a function of the budget.

    Raises ArmidError for anything else, and for an algorithm that was built already: it keeps the state of its run.
    """
    if isinstance(obj, Identifier):
        return obj
    expected = "expected a subclass of pymoo's Algorithm or a function of the budget that returns one"
    if isinstance(obj, Algorithm):
        raise ArmidError(f"identifier '{name}' is a {type(obj).__name__} built already, {expected}")
    if isinstance(obj, type) and issubclass(obj, Algorithm) and accepts(obj):
        return Identifier(name, partial(without_budget, obj), "a class of the user")
    if callable(obj) and not isinstance(obj, type) and accepts(obj, 1):
        return Identifier(name, partial(built, name, obj), "a function of the user")
    raise ArmidError(f"identifier '{name}' is {obj!r}, {expected}")


def accepts(function: Callable[..., Any], *arguments: object) -> bool:
    """Say whether a function can be called with such arguments."""
    try:
        inspect.signature(function).bind(*arguments)
    except (TypeError, ValueError):
        return False
    return True


def without_budget(algorithm: type[Algorithm], budget: int) -> Algorithm:
    """Return a fresh algorithm that does not want to know its budget."""
    return algorithm()


def built(name: str, factory: Callable[[int], Algorithm], budget: int) -> Algorithm:
    """Return what a user's function makes; refuse with ArmidError anything but an algorithm."""
    algorithm = factory(budget)
    if not isinstance(algorithm, Algorithm):
        raise ArmidError(f"identifier '{name}' returned a {type(algorithm).__name__}, expected an Algorithm of pymoo")
    return algorithm


IDENTIFIERS: dict[str, Identifier] = {
    identifier.name: identifier
    for identifier in (
        Identifier("pso", swarm, "the paper's particle swarm (Eqs 8-9)", is_global=True),
    )
}  # fmt: skip
