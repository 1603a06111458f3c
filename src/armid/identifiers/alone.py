"""A search run without the loop of pymoo, which takes longer than a simulation."""

from collections.abc import Callable
from typing import TypeGuard

import numpy as np
from pymoo.core.algorithm import Algorithm

from armid.identifiers.population import box
from armid.identifiers.search import Array, Dropped, Task, Told
from armid.identifiers.searching import Searching
from armid.problem import PENALTY, Metered


def can_run_alone(algorithm: Algorithm) -> TypeGuard[Searching]:
    """Tell whether an algorithm is a search of ours that was given nothing for pymoo's loop to see to."""
    return type(algorithm) is Searching and algorithm.is_bare


def run_alone(algorithm: Searching, problem: Metered, seed: int, is_over: Callable[[], bool]) -> None:
    """Run a search to its end, or until it is over; the problem's meter keeps what it found.

    Asks for the same candidates in the same order as pymoo's `minimize` with this seed, bit for bit.
    is_over: called after each evaluation of what was asked for at once, which is a generation of pymoo.
    Raises ArmidError for a problem that has no finite box.
    """
    box(problem)

    def ask(X: Array, residuals: bool = False) -> Told:
        values, vectors = problem.answered(X, residuals)
        if is_over():
            raise Dropped
        return Told(np.where(values < PENALTY, values, np.inf), vectors)

    search = algorithm.method(Task(problem, np.random.default_rng(seed), ask=ask))
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
