"""A search as an algorithm of pymoo, an algorithm of pymoo as a search, and a search run without pymoo's loop."""

from collections.abc import Callable
from functools import partial
from inspect import signature
from typing import Any, TypeGuard

import numpy as np
from pymoo.algorithms.base.local import LocalSearch
from pymoo.core.algorithm import Algorithm
from pymoo.core.individual import Individual
from pymoo.core.initialization import Initialization
from pymoo.core.population import Population
from pymoo.core.problem import Problem
from pymoo.core.termination import NoTermination

from armid.errors import ArmidError
from armid.identifiers.identifier import OF_PYMOO, OF_SETUP, Identifier, checked_count, refuse_unknown
from armid.identifiers.search import (
    Ask,
    Dropped,
    Method,
    Search,
    SearchTask,
    SwarmEvaluator,
    Told,
    as_population,
    bounds_of,
)
from armid.model import Array
from armid.problem.meter import PENALTY, RESIDUALS, Metered

SEEDS = 2**31 - 1
PLAIN = ["F", "G", "H"]


class SearchAlgorithm(Algorithm):  # type: ignore[misc]
    """Ask and tell a search as pymoo expects it of an algorithm; what the search asks for at once is one generation.

    method: makes the search; budget: simulations after which the run ends when no termination is given. of_pymoo:
    options of pymoo's Algorithm, such as termination, callback, seed. All that is random comes from `random_state`.
    `opt` is the best candidate so far. A search that comes to its own end ends the run. It is closed when the run ends,
    fails or is dropped.
    """

    def __init__(self, method: Method, budget: int, **of_pymoo: Any) -> None:
        refuse_unknown(of_pymoo, OF_PYMOO, "the search")
        super().__init__(**({"evaluator": SwarmEvaluator()} | of_pymoo))
        self.method = method
        self.budget = checked_count("the budget", budget)
        self.is_bare = not of_pymoo
        self._search: Search | None = None
        self._asked: Ask | None = None

    def setup(self, problem: Problem, **options: Any) -> Algorithm:
        """Make ready for a problem; options are pymoo's, and the unknown ones that pymoo would swallow are refused."""
        refuse_unknown(options, OF_SETUP, "the search")
        bounds_of(problem)
        if options.get("termination", self.termination) is None:
            options["termination"] = ("n_eval", self.budget)
        return super().setup(problem, **options)

    def next(self) -> None:
        """Make one generation; close the search when it fails, so that no thread of it is left."""
        try:
            super().next()
        except BaseException:
            self._finalize()
            raise

    def infill(self) -> Population:
        if self.problem is None:
            raise ArmidError("the search has no problem yet, expected a call of setup(problem) first")
        if not self.is_initialized:
            self._initialize()
            self._search = self.method(SearchTask(self.problem, self.random_state))
            self._asked = next(self._search)
        if self._asked is None or self._search is None:
            raise ArmidError("the search has ended or is a copy of a running one: it cannot go on, set up a new one")
        self.evaluator.evaluate_values_of = [*PLAIN, RESIDUALS] if self._asked.residuals else PLAIN
        return as_population(self._asked.X, self.n_iter)

    def _initialize_advance(self, infills: Population, **_: Any) -> None:
        self._best = np.inf
        self.opt = Population.empty()
        self._advance(infills)

    def _advance(self, infills: Population, **_: Any) -> None:
        assert self._search is not None
        self.pop = infills
        told = self._told(infills)
        leader = int(np.argmin(told.F))
        if told.F[leader] < self._best:
            self._best = float(told.F[leader])
            self.opt = infills[leader : leader + 1]
        try:
            self._asked = self._search.send(told)
        except StopIteration:
            self._asked = None
            self.termination.terminate()

    def _set_optimum(self) -> None:
        """Leave `opt` as `_advance` has set it."""

    def _told(self, infills: Population | None) -> Told:
        """Read what was evaluated; a failed candidate gets +inf. Kept residual vectors would fill the memory."""
        n = 0 if infills is None else len(infills)
        assert self._asked is not None
        if n != len(self._asked.X) or infills is None:
            raise ArmidError(f"{n} candidates were told to the search, expected {len(self._asked.X)} as it asked for")
        f = np.array([individual.F[0] for individual in infills], dtype=np.float64)
        f[~(f < PENALTY)] = np.inf
        if not self._asked.residuals:
            return Told(f)
        rows = [individual.data.pop(RESIDUALS, None) for individual in infills]
        if any(row is None or np.ndim(row) != 1 for row in rows):
            raise ArmidError("the problem gives no residual vectors, least_squares expects one that does")
        return Told(f, np.array(rows, dtype=np.float64))

    def _finalize(self) -> None:
        if self._search is not None:
            self._search.close()

    def __getstate__(self) -> dict[str, Any]:
        """Leave the running search behind: a copy, such as pymoo's history keeps, is to look at and not to go on."""
        return self.__dict__ | {"_search": None}


def declared(
    name: str, note: str, factory: Callable[..., Method], *, is_global: bool = False, uses_gradient: bool = False,
    needs_residuals: bool = False,
) -> Identifier:  # fmt: skip
    """Return the identifier of a search of ours; factory: makes its method of its options, which it checks."""
    return Identifier(name, partial(built_search, factory, name), note, is_global=is_global,
                      uses_gradient=uses_gradient, needs_residuals=needs_residuals)  # fmt: skip


def built_search(factory: Callable[..., Method], name: str, budget: int, **options: Any) -> SearchAlgorithm:
    refuse_unknown(options, signature(factory).parameters, f"'{name}'")
    return SearchAlgorithm(factory(**options), budget)


def search_of(algorithm: Algorithm, task: SearchTask) -> Search:
    """Return the search that a fresh algorithm makes of a task; refuse a start that it does not take."""
    if isinstance(algorithm, SearchAlgorithm):
        return algorithm.method(task)
    if task.start is not None:
        if not takes_start(algorithm):
            raise ArmidError(f"{type(algorithm).__name__} takes no start x0, so a chain may begin with it and no more")
        if isinstance(algorithm, LocalSearch):
            algorithm.initialization = Initialization(task.start[np.newaxis])
        else:
            algorithm.x0 = task.start.copy()
    return stepped(algorithm, task)


def takes_start(algorithm: Algorithm) -> bool:
    return isinstance(algorithm, SearchAlgorithm | LocalSearch) or hasattr(algorithm, "x0")


def stepped(algorithm: Algorithm, task: SearchTask) -> Search:
    """Ask and tell an algorithm until it ends by itself; the evaluations are counted in its own evaluator."""
    seed = int(task.random.integers(1, SEEDS))
    algorithm.setup(task.problem, termination=NoTermination(), seed=seed)
    while algorithm.has_next():
        asked = algorithm.ask()
        infills = Population.create(asked) if isinstance(asked, Individual) else asked
        if infills is None or len(infills) == 0:
            algorithm.tell(infills=asked)
            continue
        told = yield Ask(np.array([individual.X for individual in infills], dtype=np.float64))
        for individual, value in zip(infills, np.minimum(told.F, PENALTY), strict=True):
            individual.F = np.array([value])
            individual.evaluated = {"F", "G", "H"}
        algorithm.evaluator.n_eval += len(infills)
        algorithm.tell(infills=asked)
    return True


def can_run_directly(algorithm: Algorithm) -> TypeGuard[SearchAlgorithm]:
    """Tell whether an algorithm is a search of ours that was given nothing for pymoo's loop to see to."""
    return type(algorithm) is SearchAlgorithm and algorithm.is_bare


def run_directly(algorithm: SearchAlgorithm, problem: Metered, seed: int, is_over: Callable[[], bool]) -> None:
    """Run a search to its end, or until it is over; the problem's meter keeps what it found.

    Asks for the same candidates in the same order as pymoo's `minimize` with this seed, bit for bit. is_over: called
    after each evaluation of what was asked for at once, which is a generation of pymoo.
    """
    bounds_of(problem)

    def ask(X: Array, residuals: bool = False) -> Told:
        values, vectors = problem.answered(X, residuals)
        if is_over():
            raise Dropped
        return Told(np.where(values < PENALTY, values, np.inf), vectors)

    search = algorithm.method(SearchTask(problem, np.random.default_rng(seed), ask=ask))
    told: Told | None = None
    try:
        while True:
            try:
                asked = search.send(told)  # type: ignore[arg-type]
            except StopIteration:
                return
            told = ask(*asked)
    except Dropped:
        return
    finally:
        search.close()
