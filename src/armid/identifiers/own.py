"""Identifiers of others: algorithms of other libraries, which call for values by themselves, and a user's own."""

import inspect
import random as python_random
import threading
import warnings
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from copy import deepcopy
from dataclasses import dataclass, make_dataclass
from functools import partial
from types import NoneType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pymoo.core.algorithm import Algorithm

from armid.errors import ArmidError, nearest
from armid.identifiers.identifier import Identifier, accepts, declared, option, options_in
from armid.identifiers.search import Asker, Calls, SearchOptions, SearchTask, seed_from
from armid.model import Array
from armid.problem.meter import PENALTY

SEARCH_ARGUMENTS = ("value", "low", "high", "budget", "random", "start")
# Kinds of options of a function, in words; true is a number, too, so that it comes first.
OPTION_KINDS: dict[Any, str] = {bool: "true or false", int | float | np.number: "a number", str: "a text"}
# A candidate that lies farther outside than this share of its range has left the box; closer is rounding.
OUT_OF_BOX = 1e-9


def as_identifier(name: str, obj: Any) -> Identifier:
    """Return an Identifier as it is, or make one of what a user has.

    Parameters
    ----------
    name : str
        Of the identifier.
    obj : Identifier, algorithm, class or function
        A subclass of pymoo's Algorithm, or an object of one that was not used yet; a function of the budget that
        returns an algorithm; or a function that searches by itself: `value` in its arguments is what it minimises, a
        function of a candidate, (n_parameters,), that returns a number, or of several at once, (n_candidates,
        n_parameters), that returns (n_candidates,). It may name `low` and `high`, the bounds, and `start`, the best so
        far in a chain, else a random point of the box, SI, each (n_parameters,); `budget`, the simulations after which
        it is ended; `random`, numpy's Generator. Further arguments are options: their default is a number, a text, true
        or false, or None; `Annotated[float, (0.05, 0.5), "first step"]` gives the range of `armid tune` and a meaning.

    Returns
    -------
    Identifier

    Raises
    ------
    ArmidError
        For anything else, and for an algorithm that was used already: it keeps the state of its run.

    >>> def halves(value, low, high):
    ...     value((low + high) / 2)
    >>> as_identifier("halves", halves).note
    'a search of the user'
    """
    if isinstance(obj, Identifier):
        return obj
    expected = (
        "expected a subclass of pymoo's Algorithm, a function of the budget that returns one, or a function that "
        "searches by itself, whose first argument is `value`; a fitness is a function of (measured, simulated)"
    )
    if isinstance(obj, Algorithm) and obj.problem is None:
        return Identifier(name, lambda budget: deepcopy(obj), "an algorithm of the user")
    if isinstance(obj, Algorithm):
        raise ArmidError(f"identifier '{name}' is a {type(obj).__name__} that was used already, {expected}")
    if isinstance(obj, type) and issubclass(obj, Algorithm) and accepts(obj):
        return Identifier(name, lambda budget: obj(), "a class of the user")
    arguments = {} if isinstance(obj, type) else arguments_of(obj)
    if callable(obj) and "value" in arguments:
        unknown = [a for a, p in arguments.items() if p.default is p.empty and a not in SEARCH_ARGUMENTS]
        for argument in unknown:
            raise ArmidError(f"identifier '{name}' has an argument '{argument}' without a default, which an option "
                             f"needs: {nearest(argument, SEARCH_ARGUMENTS)}")  # fmt: skip
        note = (inspect.getdoc(obj) or "a search of the user").partition("\n")[0]
        return declared(name, note, own_search(name, obj), is_global="start" not in arguments)
    if callable(obj) and not isinstance(obj, type) and accepts(obj, 1):
        return Identifier(name, partial(built, name, obj), "a function of the user")
    raise ArmidError(f"identifier '{name}' is {obj!r}, {expected}")


def built(name: str, factory: Callable[[int], Algorithm], budget: int) -> Algorithm:
    algorithm = factory(budget)
    if not isinstance(algorithm, Algorithm):
        raise ArmidError(f"identifier '{name}' returned a {type(algorithm).__name__}, expected an Algorithm of pymoo")
    return algorithm


def arguments_of(function: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    # annotations may be texts of names that stand nowhere
    for read in (True, False):
        with suppress(TypeError, ValueError, NameError):
            return dict(inspect.signature(function, eval_str=read).parameters)
    return {}


@dataclass(frozen=True)
class OwnSearch(SearchOptions):
    """Options of a function that searches; a value is of the kind of its default."""

    function: ClassVar[Callable[..., Any]]

    def __post_init__(self) -> None:
        for name, default in ((each.name, each.default) for each in options_in(type(self))):
            value = getattr(self, name)
            wanted, found = (next((words for kind, words in OPTION_KINDS.items() if isinstance(v, kind)), "")
                             for v in (default, value))  # fmt: skip
            if wanted and found != wanted:
                raise ArmidError(f"{name} is {value!r}, expected {wanted} as its default {default!r}")

    def search(self, task: SearchTask) -> None:
        """Call the function, and warn where it has left the box."""
        given = {each.name: getattr(self, each.name) for each in options_in(type(self))}
        value = Value(task.ask, task.problem.xl, task.problem.xu)
        try:
            search_by(type(self).function, given, task, value)
        finally:
            if value.n_outside:
                warnings.warn(f"'{type(self).__name__}' asked for {value.n_outside} candidates outside `low` to "
                              "`high`, each was moved into that box", OutsideWarning, stacklevel=2)  # fmt: skip


class OutsideWarning(UserWarning):
    """Say that a search has asked for candidates outside the box."""


def own_search(name: str, function: Callable[..., Any]) -> type[OwnSearch]:
    """Return the options of a function as a dataclass: its arguments with a default, and what annotations say."""
    made = []
    for argument in arguments_of(function).values():
        if argument.name not in SEARCH_ARGUMENTS and isinstance(argument.default, (*OPTION_KINDS, NoneType)):
            if hasattr(OwnSearch, argument.name):
                raise ArmidError(f"identifier '{name}': an option cannot be called '{argument.name}', another name is "
                                 "expected")  # fmt: skip
            notes = getattr(argument.annotation, "__metadata__", ())
            ends = next((note for note in notes if isinstance(note, tuple) and len(note) == 2), None)
            meaning = next((note for note in notes if isinstance(note, str)), "")
            made.append((argument.name, Any, option(argument.default, meaning, "", tune=ends)))
    namespace = {"function": staticmethod(function)}
    return make_dataclass(name, made, bases=(OwnSearch,), namespace=namespace, frozen=True)


def search_by(function: Callable[..., Any], options: Mapping[str, Any], task: SearchTask, value: "Value") -> None:
    """Let a function search that calls for values until they raise."""
    low, high, cube = task.problem.xl, task.problem.xu, task.cube
    start = cube.candidates(cube.first(task))[0] if task.start is None else task.start
    given = {"value": value, "low": low.copy(), "high": high.copy(), "budget": task.budget, "random": task.random,
             "start": start.copy()}  # fmt: skip
    with value.ask:
        function(**{key: given[key] for key in arguments_of(function) if key in given}, **options)


class Value:
    """Answer what a search asks; what failed gets a value above all that was seen, as few libraries take infinity.

    n_outside: candidates that were outside the box by more than rounding, and were moved into it.
    """

    def __init__(self, ask: Asker, low: Array, high: Array) -> None:
        self.low, self.high, self.n_outside = low, high, 0
        self.ask = Calls(lambda x: ask(self.inside(x)).F)
        self.least, self.most = np.inf, -np.inf

    def inside(self, x: Array) -> Array:
        if x.shape[-1:] != self.low.shape or x.ndim > 2:
            n = len(self.low)
            raise ArmidError(f"`value` was given an array of shape {x.shape}, one candidate ({n},) or several "
                             f"(n_candidates, {n}) are expected")  # fmt: skip
        X = np.atleast_2d(x)
        rounding = OUT_OF_BOX * (self.high - self.low)
        self.n_outside += int(((self.low - rounding > X) | (self.high + rounding < X)).any(axis=1).sum())
        return np.clip(X, self.low, self.high)

    def __call__(self, x: ArrayLike) -> float | Array:
        asked = np.asarray(x, dtype=np.float64)
        told = self.ask(asked)
        finite = told[told < PENALTY]
        self.least, self.most = min([self.least, *finite]), max([self.most, *finite])
        failed = 2.0 * self.most - self.least if self.most > -np.inf else PENALTY
        told = np.where(told < PENALTY, told, failed)
        return float(told[0]) if asked.ndim < 2 else told


class Foreign(SearchOptions):
    """Options of a search of another library."""

    def search(self, task: SearchTask) -> None:
        """Minimise until the task drops it."""
        search_by(self.minimise, {}, task, Value(task.ask, task.problem.xl, task.problem.xu))

    @abstractmethod
    def minimise(self, value: Value, low: Array, high: Array, budget: int, random: np.random.Generator) -> None:
        """Call for values within a box until they raise; random: draws its seed."""


@dataclass(frozen=True)
class Lshade(Foreign):
    """Differential evolution with success history and a population that shrinks linearly.

    Source: Tanabe and Fukunaga 2014, doi:10.1109/CEC.2014.6900380.
    """

    package = "minionpy"
    per_parameter: float = option(18.0, "candidates of the first population a parameter, at most a tenth of the budget",
                                  least=1e-15, most=1e4, tune=(2.0, 30.0))  # fmt: skip
    memory: int = option(6, "length of the history", least=1, most=1000, tune=(2, 30))

    def minimise(self, value: Value, low: Array, high: Array, budget: int, random: np.random.Generator) -> None:
        """Run minionpy's L-SHADE."""
        from minionpy import LSHADE

        n_candidates = max(4, min(round(self.per_parameter * low.size), budget // 10))
        options = {"population_size": n_candidates, "memory_size": self.memory, "x_tol": 0.0}
        box = list(zip(low.tolist(), high.tolist(), strict=True))
        LSHADE(value, box, None, budget, None, seed_from(random), options).optimize()


@dataclass(frozen=True)
class Ngopt(Foreign):
    """Choose among nevergrad's methods by dimension and budget: its wizard NGOpt10.

    Its newest one lets cma draw its seed from the clock, so that no run could be repeated.
    Source: Meunier et al. 2022, arXiv:2010.04542.
    """

    package = "nevergrad"

    def minimise(self, value: Value, low: Array, high: Array, budget: int, random: np.random.Generator) -> None:
        """Run nevergrad's wizard, and leave the global generators and threads as they were."""
        import nevergrad as ng
        from nevergrad.optimization import metamodel

        # nevergrad 1.0.12 makes a number of an array of one, which numpy 2.4 refuses
        vars(metamodel).setdefault("float", lambda number: float(np.asarray(number).item()))
        seed, point = seed_from(random), ng.p.Array(shape=low.shape, lower=0.0, upper=1.0)
        point.random_state, before = np.random.RandomState(seed), set(threading.enumerate())
        # some of its methods draw from the global generators all the same
        with global_generators(seed), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                optimizer = ng.optimizers.registry["NGOpt10"](point, budget=budget)
                for _ in range(budget):
                    asked = optimizer.ask()
                    optimizer.tell(asked, value(low + asked.value * (high - low)))
            finally:
                # some run in threads that wait for their next value
                for thread in set(threading.enumerate()) - before:
                    if hasattr(thread, "stop"):
                        thread.stop()
                        thread.join()


@contextmanager
def global_generators(seed: int) -> Iterator[None]:
    """Seed the global generators of Python and numpy, and leave them as they were."""
    kept, kept_by_numpy = python_random.getstate(), np.random.get_state()
    python_random.seed(seed)
    np.random.seed(seed)
    try:
        yield
    finally:
        python_random.setstate(kept)
        np.random.set_state(kept_by_numpy)


@dataclass(frozen=True)
class Tpe(Foreign):
    """Bayesian optimisation with Parzen estimators, for budgets of up to some hundreds.

    Source: Bergstra et al. 2011, NeurIPS 24.
    """

    package = "optuna"
    n_first: int = option(10, "candidates that are drawn before the model is asked", least=1, most=10**15, tune=(4, 40))

    def minimise(self, value: Value, low: Array, high: Array, budget: int, random: np.random.Generator) -> None:
        """Run Optuna's sampler."""
        import optuna
        from optuna.distributions import BaseDistribution, FloatDistribution

        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            seed = seed_from(random)
            sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True, n_startup_trials=self.n_first)
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        study = optuna.create_study(sampler=sampler)
        ends = enumerate(zip(low.tolist(), high.tolist(), strict=True))
        ranges: dict[str, BaseDistribution] = {f"u{i}": FloatDistribution(*pair) for i, pair in ends}
        for _ in range(budget):
            trial = study.ask(ranges)
            study.tell(trial, float(value([trial.params[name] for name in ranges])))


FOREIGN = (
    declared("lshade", "success-history differential evolution, L-SHADE (minionpy)", Lshade, is_global=True),
    declared("ngopt", "chooses by dimension and budget, NGOpt10 (nevergrad)", Ngopt, is_global=True),
    declared("tpe", "Bayesian, Parzen estimators (Optuna), for small budgets", Tpe, is_global=True),
)
