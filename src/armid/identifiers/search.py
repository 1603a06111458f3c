"""What a search is: a function of a task that asks for the fitness of candidates; and how pymoo runs it.

Also: the starts of local searches, and what protects the routines of other libraries.
"""

from abc import abstractmethod
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from pymoo.algorithms.base.local import LocalSearch
from pymoo.core.algorithm import Algorithm
from pymoo.core.evaluator import Evaluator
from pymoo.core.individual import Individual
from pymoo.core.initialization import Initialization
from pymoo.core.population import Population
from pymoo.core.problem import Problem
from pymoo.core.result import Result
from pymoo.core.termination import NoTermination

from armid.errors import ArmidError
from armid.identifiers.identifier import OF_PYMOO, OF_SETUP, Options, checked_count, refuse_unknown
from armid.model import Array
from armid.problem.meter import PENALTY, RESIDUALS, Metered

# A start on a bound stalls the simplex.
PULLED = 1e-3


class Told(NamedTuple):
    """Fitness of what was asked for, (n,), +inf where a candidate failed; residual vectors, (n, n_total), if wanted."""

    F: Array
    residuals: Array | None = None


class Asker(Protocol):
    def __call__(self, X: Array, residuals: bool = False) -> Told:
        """Return what the candidates X, (n, n_parameters), are worth; raise Dropped at the end of the run."""


class Dropped(BaseException):
    """Unwind a search whose run has ended. It is not an Exception, so that `except Exception` does not catch it."""


class NoFitnessError(Exception):
    """Say that the start of a local search has no fitness."""


@dataclass(frozen=True, eq=False)
class SearchTask:
    """What a search works on: the problem, everything random, whom it asks, its budget in simulations.

    start: where to start, (n_parameters,); None: wherever the search likes.
    """

    problem: Problem
    random: np.random.Generator
    ask: Asker
    budget: int
    start: Array | None = None

    @property
    def cube(self) -> "Cube":
        return Cube(*bounds_of(self.problem))


Search = Callable[[SearchTask], None]


@dataclass(frozen=True, eq=False)
class Cube:
    """Map the problem's box to the unit cube and back."""

    low: Array
    high: Array

    @property
    def n(self) -> int:
        return len(self.low)

    def candidates(self, u: Array) -> Array:
        """Return points of the unit cube as candidates in the box, (n, n_parameters), also for a single point."""
        x = self.low + np.atleast_2d(u) * (self.high - self.low)
        return np.asarray(np.minimum(np.maximum(x, self.low), self.high))

    def point(self, x: Array) -> Array:
        span = self.high - self.low
        u = np.divide(x - self.low, span, out=np.full(len(span), 0.5), where=span > 0.0)
        return np.asarray(np.minimum(np.maximum(u, 0.0), 1.0))

    def first(self, task: SearchTask) -> Array:
        """Return where a search begins: at the task's start, else at a random point, (n,)."""
        return task.random.random(self.n) if task.start is None else self.point(task.start)


def seed_from(random: np.random.Generator) -> int:
    """Return a seed for a generator of another library, which takes 31 bits."""
    return int(random.integers(1, 2**31 - 1))


def local_search(task: SearchTask, routine: Callable[[Array], None]) -> None:
    """Run a routine from the task's start, or from points drawn in the box until one of them has a fitness."""
    start = task.cube.first(task)
    while True:
        try:
            return routine(np.clip(start, PULLED, 1.0 - PULLED))
        except NoFitnessError:
            start = task.random.random(len(start))


class Calls:
    """Call a function until it raises, then never again: a library may go on calling, or lose the error."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.error: BaseException | None = None

    def __call__(self, *given: Any) -> Any:
        if self.error is not None:
            raise self.error
        try:
            return self.function(*given)
        except BaseException as error:
            self.error = error
            raise

    def __enter__(self) -> None:
        """Let a library call."""

    def __exit__(self, kind: object, error: BaseException | None, _: object) -> None:
        """Raise what a call raised, however the library took it."""
        # compiled libraries turn an error of a call into one of their own; where one returns a result all the same, as
        # BOBYQA stopped in a step that it tries once more, Python raises a SystemError in place of the error
        if self.error is not None and (error is None or isinstance(error, Exception)):
            raise self.error


class Height:
    """Scale fitness values to a size of about 1, and give failed candidates a larger value than all others.

    Line searches expect a scale of 1. A failure that is much higher than everything else would distort every model that
    a search fits through it.
    """

    def __init__(self) -> None:
        self.scale = 0.0
        self.lowest, self.highest = inf, -inf

    def of(self, f: float) -> float:
        """Return the height of a fitness; NoFitnessError while none has been finite."""
        if isfinite(f):
            self.scale = self.scale or abs(f) or 1.0
            height = f / self.scale
            self.lowest, self.highest = min(self.lowest, height), max(self.highest, height)
            return height
        if not self.scale:
            raise NoFitnessError
        return 2.0 * self.highest - self.lowest


def bounds_of(problem: Problem) -> tuple[Array, Array]:
    """Return the bounds of a problem; refuse with ArmidError one that our algorithms cannot search."""
    if problem.n_obj != 1 or problem.has_constraints():
        raise ArmidError(
            f"the problem has {problem.n_obj} objectives and {problem.n_constr} constraints, expected 1 and 0"
        )
    if not problem.has_bounds() or not np.isfinite([problem.xl, problem.xu]).all() or (problem.xl > problem.xu).any():
        raise ArmidError(f"the problem's bounds are {problem.xl} and {problem.xu}, expected a finite box")
    return problem.xl, problem.xu


PLAIN = ["F", "G", "H"]


class SearchAlgorithm(Algorithm):  # type: ignore[misc]
    """Run a search where pymoo expects an algorithm; what the search asks for at once is one generation.

    search: the search; budget: simulations after which the run ends when no termination is given. is_seeded: in a chain
    it draws from a generator of its own, as pymoo's algorithms do. of_pymoo: options of pymoo's Algorithm, such as
    termination, callback, seed. All that is random comes from `random_state`.
    `opt` is the best candidate so far. The run ends when the search returns. A search runs as a whole, by pymoo's
    `minimize` or by `run`; it refuses `ask` and `next`.
    """

    def __init__(self, search: Search, budget: int, is_seeded: bool = False, **of_pymoo: Any) -> None:
        refuse_unknown(of_pymoo, OF_PYMOO, "the search")
        super().__init__(**of_pymoo)
        self.search, self.is_seeded, self.is_bare = search, is_seeded, not of_pymoo
        self.budget = checked_count("the budget", budget)

    def setup(self, problem: Problem, **options: Any) -> Algorithm:
        """Make ready for a problem; options are pymoo's, and the unknown ones that pymoo would swallow are refused."""
        refuse_unknown(options, OF_SETUP, "the search")
        bounds_of(problem)
        if options.get("termination", self.termination) is None:
            options["termination"] = ("n_eval", self.budget)
        return super().setup(problem, **options)

    def run(self, is_over: Callable[[], bool] = lambda: False) -> Result:
        """Search to the end; is_over: called after each generation, as the termination is."""
        if self.problem is None or self.is_initialized:
            raise ArmidError("the search has no problem, or has run before: setup(problem) of a new one is expected")
        self._initialize()

        def ask(X: Array, residuals: bool = False) -> Told:
            infills = Population.new(X=X, **dict.fromkeys(("n_gen", "n_iter"), [self.n_iter] * len(X)))
            self.evaluator.evaluate_values_of = [*PLAIN, RESIDUALS] if residuals else PLAIN
            self.evaluator.eval(self.problem, infills, algorithm=self)
            told = told_of(infills, residuals)
            self.advance(infills=infills)
            if not self.has_next() or is_over():
                raise Dropped
            return told

        with suppress(Dropped):
            self.search(SearchTask(self.problem, self.random_state, ask, self.budget))
            self.termination.terminate()
            self.finalize()
        return self.result()

    def infill(self) -> Population:
        """Refuse to be asked for a generation."""
        raise ArmidError("a search of armid has no ask() and tell(): minimize() or run() is expected")

    next = infill

    def _initialize_advance(self, infills: Population, **_: Any) -> None:
        self.opt = Population.empty()
        self._advance(infills)

    def _advance(self, infills: Population, **_: Any) -> None:
        self.pop = infills
        values = told_of(infills, False).F
        leader = int(np.argmin(values))
        if values[leader] < (self.opt[0].F[0] if len(self.opt) else np.inf):
            self.opt = infills[leader : leader + 1]

    def _set_optimum(self) -> None:
        """Leave `opt` as `_advance` has set it."""


def told_of(infills: Population, residuals: bool) -> Told:
    """Read what was evaluated; a failed candidate gets +inf. Kept residual vectors would fill the memory."""
    f = np.array([individual.F[0] for individual in infills], dtype=np.float64)
    f[~(f < PENALTY)] = np.inf
    if not residuals:
        return Told(f)
    rows = [individual.data.pop(RESIDUALS, None) for individual in infills]
    if any(row is None or np.ndim(row) != 1 for row in rows):
        raise ArmidError("the problem gives no residual vectors, least_squares expects one that does")
    return Told(f, np.array(rows, dtype=np.float64))


class SearchOptions(Options):
    """Options of a search of ours; is_seeded: see `SearchAlgorithm`."""

    is_seeded: ClassVar[bool] = False

    @abstractmethod
    def search(self, task: SearchTask) -> None:
        """Request candidates until the search converges or the task ends it."""

    def build(self, budget: int) -> SearchAlgorithm:
        """Return the search as an algorithm of pymoo."""
        return SearchAlgorithm(self.search, budget, self.is_seeded)


class FiniteEvaluator(Evaluator):  # type: ignore[misc]
    """Replace fitness values that are not finite by PENALTY, for algorithms that cannot handle NaN."""

    def eval(self, problem: Problem, pop: Population, *args: Any, **kwargs: Any) -> Population:
        """Evaluate as pymoo does, then replace what is not finite."""
        pop = super().eval(problem, pop, *args, **kwargs)
        for individual in [pop] if isinstance(pop, Individual) else pop:
            if not np.isfinite(individual.F).all():
                individual.F = np.where(np.isfinite(individual.F), individual.F, PENALTY)
        return pop


def run(algorithm: Algorithm, problem: Metered, seed: int, is_over: Callable[[], bool]) -> None:
    """Run an algorithm to its end, or until it is over; the problem's meter keeps what it found.

    Asks for the same candidates in the same order as pymoo's `minimize` with this seed, bit for bit. is_over: called
    after each evaluation of what was asked for at once, which is a generation of pymoo.
    """
    if isinstance(algorithm, SearchAlgorithm) and not algorithm.is_bare:
        algorithm.setup(problem, termination=NoTermination(), seed=seed).run(is_over)
        return
    bounds_of(problem)

    def ask(X: Array, residuals: bool = False) -> Told:
        values, vectors = problem.answered(X, residuals)
        if is_over():
            raise Dropped
        return Told(np.where(values < PENALTY, values, np.inf), vectors)

    with suppress(Dropped):
        carry_out(algorithm, SearchTask(problem, np.random.default_rng(seed), ask, 1), seed)


def carry_out(algorithm: Algorithm, task: SearchTask, seed: int | None = None) -> None:
    """Search as a fresh algorithm does, from the task's start if it has one; seed: of the run, None in a part of it."""
    if isinstance(algorithm, SearchAlgorithm):
        is_own = algorithm.is_seeded and seed is None
        random = np.random.default_rng(seed_from(task.random)) if is_own else task.random
        algorithm.search(replace(task, random=random, budget=algorithm.budget))
        return
    if isinstance(algorithm, LocalSearch) and task.start is not None:
        algorithm.initialization = Initialization(task.start[np.newaxis])
    elif task.start is not None:
        algorithm.x0 = task.start.copy()
    seed = seed_from(task.random) if seed is None else seed
    algorithm.setup(task.problem, termination=NoTermination(), seed=seed)
    while algorithm.has_next():
        asked = algorithm.ask()
        infills = [] if asked is None else [asked] if isinstance(asked, Individual) else asked
        fresh = [individual for individual in infills if "F" not in individual.evaluated]
        # one that evaluates by itself asks for nothing here, and may be at its end all the same
        X = np.array([individual.X for individual in fresh], dtype=np.float64)
        told = task.ask(X.reshape(len(fresh), task.problem.n_var))
        for individual, value in zip(fresh, np.minimum(told.F, PENALTY), strict=True):
            individual.F = np.array([value])
            individual.evaluated = {"F", "G", "H"}
        algorithm.evaluator.n_eval += len(fresh)
        algorithm.tell(infills=asked)


def takes_start(algorithm: Algorithm) -> bool:
    return isinstance(algorithm, SearchAlgorithm | LocalSearch) or hasattr(algorithm, "x0")
