"""What a search is: a generator that asks for candidates and is told their fitness.

Also: the threads in which routines that call for values are run, the starts of local searches, and individuals of pymoo
made, read and evaluated in a fraction of its time.
"""

import weakref
from collections.abc import Callable, Generator
from dataclasses import dataclass
from math import inf, isfinite
from queue import SimpleQueue
from threading import Thread, current_thread
from typing import Any, NamedTuple, Protocol

import numpy as np
from pymoo.core.evaluator import Evaluator
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.core.problem import Problem

from armid.errors import ArmidError
from armid.model import Array
from armid.problem.meter import PENALTY

# A start on a bound stalls the simplex.
PULLED = 1e-3


class Ask(NamedTuple):
    """Candidates to evaluate as one population, (n, n_parameters); residuals: whether their vectors are wanted."""

    X: Array
    residuals: bool = False


class Told(NamedTuple):
    """Fitness of what was asked for, (n,), +inf where a candidate failed; residual vectors, (n, n_total), if wanted."""

    F: Array
    residuals: Array | None = None


class Asker(Protocol):
    def __call__(self, X: Array, residuals: bool = False) -> Told:
        """Return what the candidates X, (n, n_parameters), are worth."""


class Dropped(BaseException):
    """Unwind a routine: nobody wants its candidates any more. No error, so that nobody catches it by the way."""


class NoFitnessError(Exception):
    """Say that the start of a local search has no fitness."""


@dataclass(frozen=True, eq=False)
class SearchTask:
    """What a search works on: the problem, everything random, and where to start (None: wherever it likes).

    ask: answers at once where whoever runs the search lets it, and raises Dropped at the end of the run; a routine that
    calls for values then needs no thread. None: a search has to yield what it asks for. It may do so in any case.
    """

    problem: Problem
    random: np.random.Generator
    start: Array | None = None
    ask: Asker | None = None

    @property
    def cube(self) -> "Cube":
        return Cube(*bounds_of(self.problem))


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

    def drawn(self, random: np.random.Generator) -> Array:
        return random.random(self.n)


Search = Generator[Ask, Told, bool]
Method = Callable[[SearchTask], Search]
"""What makes a search of a task; the search returns whether it met any candidate that has a fitness."""
Routine = Callable[[Asker], bool]


def local_search(task: SearchTask, routine: Callable[[Asker, Array], None]) -> Search:
    """Run a routine from the task's start, or from points drawn in the box until one of them has a fitness.

    It runs at once where the task answers at once, else in a thread.
    """
    cube = task.cube
    start = cube.drawn(task.random) if task.start is None else cube.point(task.start)

    def attempt(ask: Asker) -> bool:
        try:
            routine(ask, np.clip(start, PULLED, 1.0 - PULLED))
        except NoFitnessError:
            return False
        return True

    while not (attempt(task.ask) if task.ask is not None else (yield from in_thread(attempt))):
        start = cube.drawn(task.random)
    return True


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


class Height:
    """Turn fitness values into heights of about 1, and give what failed a height above all that was seen.

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


class End(NamedTuple):
    """How a routine ended: with a result, or with an error of its own."""

    result: bool
    error: BaseException | None


class SearchThread:
    """The thread of a search and the queues to it; the search holds all of them, the thread holds the queues alone."""

    def __init__(self, routine: Routine) -> None:
        self.asked: SimpleQueue[Any] = SimpleQueue()
        self.told: SimpleQueue[Told | None] = SimpleQueue()
        arguments = (routine, self.asked, self.told)
        self.thread = Thread(target=run_routine, args=arguments, name="armid search", daemon=True)
        # also at the interpreter's exit, while daemon threads still run: later nobody could wait for them
        self.hang_up = weakref.finalize(self, end_thread, self.told, self.thread)


def in_thread(routine: Routine) -> Search:
    """Run a routine in a thread that moves only while the search waits for its next question.

    The thread ends with the routine, and when the search is closed or dropped or the interpreter exits.
    """
    line = SearchThread(routine)
    try:
        line.thread.start()
        while not isinstance(question := line.asked.get(), End):
            line.told.put((yield question))
    finally:
        line.hang_up()
    if question.error is not None:
        raise question.error
    return question.result


def run_routine(routine: Routine, asked: "SimpleQueue[Any]", told: "SimpleQueue[Told | None]") -> None:
    def ask(X: Array, residuals: bool = False) -> Told:
        asked.put(Ask(X, residuals))
        answer = told.get()
        if answer is None:
            raise Dropped
        return answer

    try:
        asked.put(End(routine(ask), None))
    except Dropped:
        # nobody listens; if the exception were kept, its frames would hold NLopt's object and that the routine: a
        # reference cycle that is never collected
        return
    except BaseException as error:
        # nothing is swallowed: the thread that waits for the routine raises it
        asked.put(End(False, error))


def end_thread(told: "SimpleQueue[Told | None]", thread: Thread) -> None:
    """Tell a thread to end and wait for it; garbage may be collected in the thread itself, which cannot wait."""
    told.put(None)
    if thread.is_alive() and thread is not current_thread():
        thread.join()


class SwarmEvaluator(Evaluator):  # type: ignore[misc]
    """Evaluate as pymoo's Evaluator does, with one pass over the individuals instead of one for each attribute.

    finite: give PENALTY instead of a fitness that is no finite number, for algorithms that a NaN would poison.
    """

    def __init__(self, finite: bool = False, **of_pymoo: Any) -> None:
        super().__init__(**of_pymoo)
        self.finite = finite

    def eval(self, problem: Problem, pop: Population, *args: Any, **kwargs: Any) -> Population:
        """Set F of individuals that nobody evaluated before; leave every other case to pymoo."""
        plain = not args and kwargs.keys() <= {"algorithm"} and {"F", "G", "H"} <= set(self.evaluate_values_of)
        fresh = isinstance(pop, Population) and not any(individual.evaluated for individual in pop)
        if plain and fresh and not problem.has_constraints():
            self._eval_fresh(problem, pop, **kwargs)
        else:
            pop = super().eval(problem, pop, *args, **kwargs)
        if self.finite:
            for individual in [pop] if isinstance(pop, Individual) else pop:
                if not np.isfinite(individual.F).all():
                    individual.F = np.where(np.isfinite(individual.F), individual.F, PENALTY)
        return pop

    def _eval_fresh(self, problem: Problem, pop: Population, **kwargs: Any) -> None:
        x = np.array([individual.X for individual in pop])
        values = [name for name in self.evaluate_values_of if name not in "GH"]
        out = problem.evaluate(x, return_values_of=values, return_as_dictionary=True, **kwargs)
        for individual, value in zip(pop, out.pop("F"), strict=True):
            individual.F = value
            individual.evaluated = {"F", "G", "H", *out}
        for name, column in out.items():
            pop.set(name, column)
        self.n_eval += len(pop)
        if self.callback:
            self.callback(pop)


# What a new individual holds.
BLANK = dict(vars(Individual()))


def as_population(x: Array, n_iter: int | None) -> Population:
    """Return individuals at the candidates x, (n, n_parameters), as Population.new does, in a fraction of its time."""
    pop = np.empty(len(x), dtype=object).view(Population)
    for i in range(len(x)):
        pop[i] = individual = Individual.__new__(Individual)
        own = {"_X": x[i], "data": {"n_gen": n_iter, "n_iter": n_iter}, "evaluated": set()}
        individual.__dict__ = BLANK | own
    return pop


def bounds_of(problem: Problem) -> tuple[Array, Array]:
    """Return the bounds of a problem; refuse with ArmidError one that our algorithms cannot search."""
    if problem.n_obj != 1 or problem.has_constraints():
        raise ArmidError(
            f"the problem has {problem.n_obj} objectives and {problem.n_constr} constraints, expected 1 and 0"
        )
    if not problem.has_bounds() or not np.isfinite([problem.xl, problem.xu]).all() or (problem.xl > problem.xu).any():
        raise ArmidError(f"the problem's bounds are {problem.xl} and {problem.xu}, expected a finite box")
    return problem.xl, problem.xu
