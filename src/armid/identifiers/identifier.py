"""What an identifier is, and how a user's own becomes one."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from pymoo.core.algorithm import Algorithm

from armid.fitness import Fitness
from armid.identifiers.options import OF_SETUP
from armid.model.errors import ArmidError

# What a run decides and no option may: the budget, the seed, and all that pymoo is told when an algorithm is set up.
NOT_OPTIONS = (*OF_SETUP, "budget", "self")


@dataclass(frozen=True)
class Identifier:
    """Declare a method that finds parameters.

    name: as studies spell it; build: budget in simulations -> a fresh algorithm of pymoo, options by name if it has
    any; note: what it is, in words.
    is_global: it searches the whole box; uses_gradient: it asks for derivatives; is_stochastic: a seed changes it;
    needs_residuals: it works on residual vectors, so the fitness has to be a sum of squares.
    """

    name: str
    build: Callable[..., Algorithm]
    note: str = ""
    is_global: bool = False
    uses_gradient: bool = False
    is_stochastic: bool = True
    needs_residuals: bool = False

    def with_options(self, options: Mapping[str, Any]) -> "Identifier":
        """Return the identifier with options of its own, such as `velocity_limit` of the swarm.

        Raises ArmidError when it takes none, for a name that it cannot take, and for what is armid's or pymoo's to say
        (budget, seed, termination ...); any other unknown name or a bad value is refused when it is built.
        """
        if options and not takes_options(self.build):
            raise ArmidError(f"identifier '{self.name}' takes no options, '{next(iter(options))}' was given")
        for option in options:
            if option.rpartition(".")[2] in NOT_OPTIONS or not accepts(partial(self.build, 1), **{option: 0}):
                raise ArmidError(f"identifier '{self.name}' has no option '{option}' that could be set here")
        return replace(self, build=partial(self.build, **options)) if options else self

    def refuse(self, fitness: Fitness) -> None:
        """Raise ArmidError for a fitness that it cannot minimise."""
        if self.needs_residuals and fitness.weigh is None:
            raise ArmidError(
                f"identifier '{self.name}' needs residual vectors, fitness '{fitness.name}' has none: "
                "rmse or likelihood is expected"
            )


def takes_options(build: Callable[..., Algorithm]) -> bool:
    """Tell whether a factory takes keywords beside the budget."""
    kinds = [p.kind for p in inspect.signature(build).parameters.values()]
    return inspect.Parameter.VAR_KEYWORD in kinds or len(kinds) > 1


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


def accepts(function: Callable[..., Any], *arguments: object, **named: object) -> bool:
    """Say whether a function can be called with such arguments."""
    try:
        inspect.signature(function).bind(*arguments, **named)
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
