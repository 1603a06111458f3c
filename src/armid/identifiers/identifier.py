"""What an identifier is, and checks of options."""

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import partial
from typing import Any

import numpy as np
from pymoo.core.algorithm import Algorithm

from armid.errors import ArmidError, nearest
from armid.problem.fitness import Fitness

OF_PYMOO = (
    "termination", "output", "display", "callback", "archive", "return_least_infeasible", "save_history", "verbose",
    "seed", "evaluator",
)  # fmt: skip
OF_SETUP = (*OF_PYMOO, "progress")

# What a run decides and no option may: the budget, the seed, and all that pymoo is told when an algorithm is set up.
NOT_OPTIONS = (*OF_SETUP, "budget", "self")
# A share below the rounding of 1 changes nothing.
SMALLEST_SHARE = 1e-15
# Larger populations do not fit into memory, larger budgets and schedules into no lifetime.
LARGEST_POPULATION, LARGEST_COUNT = 10**6, 10**15


@dataclass(frozen=True)
class Identifier:
    """Declare a method that finds parameters.

    name: as studies spell it; build: budget in simulations -> a fresh algorithm of pymoo, options by name if it has
    any; note: what it is, in words.
    is_global: it searches the whole box; uses_gradient: it asks for derivatives; is_stochastic: a seed changes it;
    needs_residuals: it works on residual vectors, so the fitness has to be a sum of squares.
    package: what it needs beside armid's own dependencies, "" for nothing.
    """

    name: str
    build: Callable[..., Algorithm]
    note: str = ""
    is_global: bool = False
    uses_gradient: bool = False
    is_stochastic: bool = True
    needs_residuals: bool = False
    package: str = ""

    def __repr__(self) -> str:
        return f"<Identifier {self.name}: {self.note or 'no note'}>"

    def with_options(self, options: Mapping[str, Any]) -> "Identifier":
        """Return the identifier with options of its own, such as `velocity_limit` of the swarm.

        Raises ArmidError when it takes none, for a name that it cannot take, and for what is armid's or pymoo's to say
        (budget, seed, termination ...); any other unknown name or a bad value is refused when it is built.
        """
        kinds = [p.kind for p in inspect.signature(self.build).parameters.values()]
        if options and len(kinds) == 1 and inspect.Parameter.VAR_KEYWORD not in kinds:
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


def accepts(function: Callable[..., Any], *arguments: object, **named: object) -> bool:
    try:
        inspect.signature(function).bind(*arguments, **named)
    except (TypeError, ValueError):
        return False
    return True


def refuse_unknown(given: Iterable[str], known: Iterable[str], whose: str, unsaid: Iterable[str] = ()) -> None:
    """Refuse an unknown option with the nearest known one; unsaid: those that are named only where near."""
    names, further = list(known), list(unsaid)
    for name in given:
        if name not in (*names, *further):
            names += get_close_matches(name, further, n=1)
            raise ArmidError(f"{whose} has no option '{name}', {nearest(name, names)}")


def checked(name: str, value: Any, least: float = 0.0, expected: str = "a number of at least 0") -> float:
    """Return an option as a float; refuse with ArmidError what is no finite number or is below the least."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not least <= value < np.inf:
        raise ArmidError(f"{name} is {value!r}, expected {expected}")
    return float(value)


def checked_share(name: str, value: Any, most: float = 1.0) -> float:
    expected = f"a number above 0 and at most {most:g}"
    share = checked(name, value, SMALLEST_SHARE, expected)
    if share > most:
        raise ArmidError(f"{name} is {value!r}, expected {expected}")
    return share


def checked_count(name: str, value: Any, most: int = LARGEST_COUNT) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ArmidError(f"{name} is {value!r}, expected a whole number above 0")
    if value > most:
        raise ArmidError(f"{name} is {value:.6g}, expected a whole number of at most {most:,}")
    return int(value)


checked_population = partial(checked_count, most=LARGEST_POPULATION)


def checked_flag(name: str, value: Any) -> bool:
    if not isinstance(value, bool | np.bool_):
        raise ArmidError(f"{name} is {value!r}, expected true or false")
    return bool(value)


def checked_choice(name: str, value: Any, known: tuple[str, ...]) -> str:
    if value not in known:
        raise ArmidError(f"{name} is {value!r}, {nearest(str(value), known)}")
    return str(value)
