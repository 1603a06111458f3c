"""Any algorithm of pymoo as a search, so that a chain can take it as a phase."""

import numpy as np
from pymoo.algorithms.base.local import LocalSearch
from pymoo.core.algorithm import Algorithm
from pymoo.core.individual import Individual
from pymoo.core.initialization import Initialization
from pymoo.core.population import Population
from pymoo.core.termination import NoTermination

from armid.identifiers.search import Array, Ask, Search, Task
from armid.identifiers.searching import Searching
from armid.model.errors import ArmidError
from armid.problem import PENALTY

SEEDS = 2**31 - 1


def search_of(algorithm: Algorithm, task: Task) -> Search:
    """Return the search that a fresh algorithm makes of a task.

    Raises ArmidError when the task has a start and the algorithm takes none.
    """
    if isinstance(algorithm, Searching):
        return algorithm.method(task)
    if task.start is not None:
        place_at(algorithm, task.start)
    return driven(algorithm, task)


def takes_start(algorithm: Algorithm) -> bool:
    """Tell whether an algorithm can be told where to start: pymoo's local ones can, and whatever has an `x0`."""
    return isinstance(algorithm, Searching | LocalSearch) or hasattr(algorithm, "x0")


def place_at(algorithm: Algorithm, start: Array) -> None:
    """Let an algorithm start at a candidate, (n_parameters,).

    Raises ArmidError for one that takes no start.
    """
    if not takes_start(algorithm):
        raise ArmidError(f"{type(algorithm).__name__} takes no start x0, so a chain may begin with it and no more")
    if isinstance(algorithm, LocalSearch):
        algorithm.initialization = Initialization(start[np.newaxis])
    else:
        algorithm.x0 = start.copy()


def driven(algorithm: Algorithm, task: Task) -> Search:
    """Ask and tell an algorithm until it ends by itself; its own evaluator is told of the evaluations."""
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
