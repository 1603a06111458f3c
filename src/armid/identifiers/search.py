"""Individuals of pymoo made, read and evaluated in a fraction of its time."""

import weakref
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from functools import cache
from math import inf, isfinite
from queue import SimpleQueue
from threading import Thread, current_thread
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from pymoo.core.evaluator import Evaluator
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.core.problem import Problem

from armid.errors import ArmidError
from armid.problem.meter import PENALTY

Array = NDArray[np.float64]


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
        if not (plain and fresh) or problem.has_constraints():
            return self._finite(super().eval(problem, pop, *args, **kwargs))
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
        return self._finite(pop)

    def _finite(self, evaluated: Any) -> Any:
        if self.finite:
            for individual in [evaluated] if isinstance(evaluated, Individual) else evaluated:
                if not np.isfinite(individual.F).all():
                    individual.F = np.where(np.isfinite(individual.F), individual.F, PENALTY)
        return evaluated


@cache
def blank() -> dict[str, Any]:
    """Return the attributes of an individual of which nothing is known."""
    return dict(vars(Individual()))


def as_population(x: Array, n_iter: int | None) -> Population:
    """Return individuals at the candidates x, (n, n_parameters), as Population.new does, in a fraction of its time."""
    attributes = blank()
    pop = np.empty(len(x), dtype=object).view(Population)
    for i in range(len(x)):
        pop[i] = individual = Individual.__new__(Individual)
        own = {"_X": x[i], "data": {"n_gen": n_iter, "n_iter": n_iter}, "evaluated": set()}
        individual.__dict__ = attributes | own
    return pop


def box(problem: Problem) -> tuple[Array, Array]:
    """Return the bounds of a problem; refuse with ArmidError one that our algorithms cannot search."""
    if problem.n_obj != 1 or problem.has_constraints():
        raise ArmidError(
            f"the problem has {problem.n_obj} objectives and {problem.n_constr} constraints, expected 1 and 0"
        )
    if not problem.has_bounds() or not np.isfinite([problem.xl, problem.xu]).all() or (problem.xl > problem.xu).any():
        raise ArmidError(f"the problem's bounds are {problem.xl} and {problem.xu}, expected a finite box")
    return problem.xl, problem.xu


class Ask(NamedTuple):
    """Candidates to evaluate as one population, (n, n_parameters); residuals: whether their vectors are wanted."""

    X: Array
    residuals: bool = False


class Told(NamedTuple):
    """Fitness of what was asked for, (n,), +inf where a candidate failed; residual vectors, (n, n_total), if wanted."""

    F: Array
    residuals: Array | None = None


class Asker(Protocol):
    """What a routine calls for values."""

    def __call__(self, X: Array, residuals: bool = False) -> Told:
        """Return what the candidates X, (n, n_parameters), are worth."""


class Dropped(BaseException):
    """Unwind a routine: nobody wants its candidates any more. No error, so that nobody catches it by the way."""


@dataclass(frozen=True, eq=False)
class Task:
    """Hold what a search works on: the problem, everything random, and where to start (None: wherever it likes).

    ask: answers at once where whoever runs the search lets it, and raises Dropped at the end of the run; a routine
    that calls for values then needs no thread. None: a search has to yield what it asks for. It may do so in any case.
    """

    problem: Problem
    random: np.random.Generator
    start: Array | None = None
    ask: Asker | None = None

    def at(self, start: Array | None) -> "Task":
        """Return the task with another start, (n_parameters,)."""
        return replace(self, start=start)

    @property
    def cube(self) -> "Cube":
        """The unit cube in which local searches work."""
        return Cube(*box(self.problem))


@dataclass(frozen=True, eq=False)
class Cube:
    """Map the problem's box to the unit cube and back."""

    low: Array
    high: Array

    @property
    def n(self) -> int:
        """Number of parameters."""
        return len(self.low)

    def candidates(self, u: Array) -> Array:
        """Return points of the unit cube as candidates in the box, (n, n_parameters), also for a single point."""
        x = self.low + np.atleast_2d(u) * (self.high - self.low)
        return np.asarray(np.minimum(np.maximum(x, self.low), self.high))

    def point(self, x: Array) -> Array:
        """Return a candidate of the box as a point of the unit cube, (n_parameters,)."""
        span = self.high - self.low
        u = np.divide(x - self.low, span, out=np.full(len(span), 0.5), where=span > 0.0)
        return np.asarray(np.minimum(np.maximum(u, 0.0), 1.0))

    def drawn(self, random: np.random.Generator) -> Array:
        """Return a uniform random point of the unit cube."""
        return random.random(self.n)


Search = Generator[Ask, Told, bool]
Method = Callable[[Task], Search]
"""What makes a search of a task; the search returns whether it met any candidate that has a fitness."""


class Best:
    """Remember the best candidate of a search."""

    def __init__(self) -> None:
        self.x: Array | None = None
        self.f = np.inf

    def see(self, X: Array, F: Array) -> None:
        """Look at candidates (n, n_parameters) and their fitness (n,)."""
        i = int(np.argmin(F))
        if F[i] < self.f:
            self.x, self.f = X[i].copy(), float(F[i])


class End(NamedTuple):
    """How the routine ended: with a result, or with an error of its own."""

    result: bool
    error: BaseException | None


class Line:
    """The two queues between a search and its thread; the search holds it, the thread holds the queues alone."""

    def __init__(self, routine: Callable[[Asker], bool]) -> None:
        self.asked: SimpleQueue[Any] = SimpleQueue()
        self.told: SimpleQueue[Told | None] = SimpleQueue()
        self.thread = Thread(target=work, args=(routine, self.asked, self.told), name="armid search", daemon=True)
        # also at the interpreter's exit, while daemon threads still run: later nobody could wait for them
        self.hang_up = weakref.finalize(self, ended, self.told, self.thread)


def as_search(routine: Callable[[Asker], bool]) -> Search:
    """Run a routine in a thread that moves only while the search waits for its next question.

    routine: takes a function that evaluates candidates and returns whether any of them has a fitness.
    The thread ends with the routine, and when the search is closed or dropped or the interpreter exits.
    """
    line = Line(routine)
    try:
        line.thread.start()
        while not isinstance(question := line.asked.get(), End):
            line.told.put((yield question))
    finally:
        line.hang_up()
    if question.error is not None:
        raise question.error
    return question.result


def work(routine: Callable[[Asker], bool], asked: "SimpleQueue[Any]", told: "SimpleQueue[Told | None]") -> None:
    """Run the routine and say how it ended."""

    def ask(X: Array, residuals: bool = False) -> Told:
        asked.put(Ask(X, residuals))
        answer = told.get()
        if answer is None:
            raise Dropped
        return answer

    try:
        asked.put(End(routine(ask), None))
    except Dropped:
        # nobody listens; kept, its frames would hold NLopt's object and that the routine, in a circle that never ends
        return
    except BaseException as error:
        # nothing is swallowed: the thread that waits for the routine raises it
        asked.put(End(False, error))


def ended(told: "SimpleQueue[Told | None]", thread: Thread) -> None:
    """Tell a thread to end and wait for it; memory may be tidied by the thread itself, which cannot wait for itself."""
    told.put(None)
    if thread.is_alive() and thread is not current_thread():
        thread.join()


# A start on a bound stalls the simplex.
PULLED = 1e-3


class NoFitnessError(Exception):
    """Say that the start of a local search has no fitness."""


def started(task: Task, routine: Callable[[Asker, Array], None]) -> Search:
    """Run a routine from the task's start, or from points drawn in the box until one of them has a fitness.

    routine: takes what it asks and its start in the unit cube, (n_parameters,).
    """
    cube = task.cube
    start = cube.drawn(task.random) if task.start is None else cube.point(task.start)
    while not (yield from moved(task, attempt(routine, pulled(start)))):
        start = cube.drawn(task.random)
    return True


def moved(task: Task, routine: Callable[[Asker], bool]) -> Search:
    """Run a routine: at once where the task answers at once, else in a thread that yields what it asks for."""
    return (yield from as_search(routine)) if task.ask is None else routine(task.ask)


def attempt(routine: Callable[[Asker, Array], None], start: Array) -> Callable[[Asker], bool]:
    """Return a run of the routine from a start that says whether the start has a fitness."""

    def run(ask: Asker) -> bool:
        try:
            routine(ask, start)
        except NoFitnessError:
            return False
        return True

    return run


def pulled(u: Array) -> Array:
    """Return a point of the unit cube pulled inside by 0.1 % of the range where it sits on a bound."""
    return np.asarray(np.minimum(np.maximum(u, PULLED), 1.0 - PULLED))


class Height:
    """Turn fitness values into heights of about 1, and give what failed a height above all that was seen.

    Line searches expect a scale of 1, and a likelihood may be of any; more than a little above all that was seen would
    bend every model that is laid through it.
    """

    def __init__(self) -> None:
        self.scale = 0.0
        self.lowest, self.highest = inf, -inf

    def of(self, f: float) -> float:
        """Return the height of a fitness.

        Raises NoFitnessError while none has been finite: there is nothing to start from.
        """
        if isfinite(f):
            self.scale = self.scale or abs(f) or 1.0
            height = f / self.scale
            self.lowest, self.highest = min(self.lowest, height), max(self.highest, height)
            return height
        if not self.scale:
            raise NoFitnessError
        return 2.0 * self.highest - self.lowest
