"""What an identifier is, and what an option of it is: a typed field with its meaning, limits and range for tuning."""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from functools import partial
from importlib.util import find_spec
from sys import float_info
from typing import Any, ClassVar, get_args

import numpy as np
from pymoo.core.algorithm import Algorithm

from armid.errors import ArmidError, nearest
from armid.problem.fitness import Fitness

OF_PYMOO = (
    "termination", "output", "display", "callback", "archive", "return_least_infeasible", "save_history", "verbose",
    "seed", "evaluator",
)  # fmt: skip
OF_SETUP = (*OF_PYMOO, "progress")

# What a run decides and no option may: the budget, the seed, and all that pymoo gets when an algorithm is set up.
NOT_OPTIONS = (*OF_SETUP, "budget", "self")
# A share below the rounding of 1 changes nothing.
SMALLEST_SHARE = 1e-15
# Larger populations do not fit into memory, larger budgets and schedules into no lifetime.
LARGEST_POPULATION, LARGEST_WHOLE = 10**6, 10**15
RANGE = "share of the range"


@dataclass(frozen=True)
class Option:
    """Declare what an option means, its unit, and which values it can have.

    least, most: limits of a number. known: words that it may be. expected: values in words, where the limits do not
    say it. tune: range in which `armid tune` looks, None where it leaves the option alone.
    """

    meaning: str
    unit: str = "1"
    least: float = 0.0
    most: float = float_info.max
    known: tuple[str, ...] = ()
    expected: str = ""
    tune: tuple[float, float] | None = None


def option(default: Any, meaning: str, unit: str = "1", **limits: Any) -> Any:
    """Return the field of an option; limits: those of `Option`. A default of None is the algorithm's own choice."""
    return field(default=default, metadata={"option": Option(meaning, unit, **limits)})


def share(default: float, meaning: str, most: float = 1.0, **limits: Any) -> Any:
    """Return the field of an option that is a share of each parameter's range."""
    return option(default, meaning, RANGE, least=SMALLEST_SHARE, most=most, **limits)


def population(default: int | None, meaning: str, **limits: Any) -> Any:
    """Return the field of an option that is a number of candidates."""
    return option(default, meaning, least=1, most=LARGEST_POPULATION, **limits)


class Options(ABC):
    """Check the options of an algorithm, a frozen dataclass of fields made by `option`, and build it.

    package: what it needs in addition to armid's own dependencies, "" for nothing.
    """

    package: ClassVar[str] = ""

    def __post_init__(self) -> None:
        for option in options_in(type(self)):
            name, value = option.name, getattr(self, option.name)
            if value is not None or option.default is not None:
                object.__setattr__(self, name, checked(name, value, kind_of(option), option.metadata["option"]))

    @abstractmethod
    def build(self, budget: int) -> Algorithm:
        """Return a fresh algorithm of pymoo for a budget in simulations."""


def options_in(algorithm: Any) -> list[Any]:
    return [option for option in fields(algorithm) if "option" in option.metadata]


def kind_of(option: Any) -> type:
    """Return the type of the values of an option that may also be None or a word."""
    kinds = get_args(option.type) or (option.type,)
    return next(kind for kind in (bool, int, float, str) if kind in kinds)


def checked(name: str, value: Any, kind: type, about: Option) -> Any:
    """Return a value as its kind; refuse with ArmidError another kind, or a number outside the limits."""
    if isinstance(value, str) and value in about.known:
        return value
    kinds = {bool: bool | np.bool_, int: int | np.integer, float: int | float | np.number, str: ()}[kind]
    fits = isinstance(value, kinds) and isinstance(value, bool | np.bool_) == (kind is bool)
    if fits and (kind is bool or about.least <= value <= about.most):
        return kind(value)
    if fits and kind is int and value > about.most:
        raise ArmidError(f"{name} is {value:.6g}, expected a whole number of at most {about.most:,}")
    if about.known and not about.expected:
        raise ArmidError(f"{name} is {value!r}, {nearest(str(value), about.known)}")
    number = "a number above 0" if about.least == SMALLEST_SHARE else f"a number of at least {about.least:g}"
    number += f" and at most {about.most:g}" if about.most < float_info.max else ""
    expected = {bool: "true or false", int: "a whole number above 0"}.get(kind, number)
    raise ArmidError(f"{name} is {value!r}, expected {about.expected or expected}")


def checked_count(name: str, value: Any) -> int:
    return int(checked(name, value, int, Option("", least=1, most=LARGEST_WHOLE)))


# What an identifier can do and needs; a composed one as any of its parts.
TRAITS = ("is_global", "uses_gradient", "is_stochastic", "needs_residuals")


@dataclass(frozen=True)
class Identifier:
    """Declare a method that finds parameters.

    name: as studies spell it; build: budget in simulations -> a fresh algorithm of pymoo, options by name if it has
    any; note: what it is, in words.
    is_global: it searches the whole box; uses_gradient: it asks for derivatives; is_stochastic: a seed changes it;
    needs_residuals: it works on residual vectors, so the fitness has to be a sum of squares.
    package: what it needs in addition to armid's own dependencies, "" for nothing. algorithm: the dataclass of its
    options.
    """

    name: str
    build: Callable[..., Algorithm]
    note: str = ""
    is_global: bool = False
    uses_gradient: bool = False
    is_stochastic: bool = True
    needs_residuals: bool = False
    package: str = ""
    algorithm: Any = None

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


def declared(name: str, note: str, algorithm: Any, *fixed: Any, **flags: Any) -> Identifier:
    """Return the identifier of a dataclass of options; fixed: values of its first fields, which are not options."""
    build = partial(built, algorithm, fixed, name)
    return Identifier(name, build, note, package=algorithm.package, algorithm=algorithm, **flags)


def built(algorithm: Any, fixed: tuple[Any, ...], name: str, budget: int, **options: Any) -> Algorithm:
    """Return the algorithm of a dataclass; refuse a missing package, unknown options and bad values."""
    if algorithm.package and find_spec(algorithm.package) is None:
        raise ArmidError(f"identifier '{name}' needs the package {algorithm.package}, which is not installed: "
                         "pip install 'armid[suite]' is expected")  # fmt: skip
    checked_count("the budget", budget)
    refuse_unknown(options, [option.name for option in options_in(algorithm)], f"'{name}'")
    return algorithm(*fixed, **options).build(budget)


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
