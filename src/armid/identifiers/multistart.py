"""A local identifier started again and again until the budget is used."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from pymoo.core.algorithm import Algorithm

from armid.identifiers.driven import search_of, takes_start
from armid.identifiers.identifier import Identifier
from armid.identifiers.phases import of_phases
from armid.identifiers.search import Array, Method, Search, Task
from armid.identifiers.searching import Searching
from armid.model.errors import ArmidError
from armid.simulation import golden_steps

PREFIX = "multistart:"


def multistart_of(local: Identifier) -> Identifier:
    """Return the identifier that starts a local one from points spread over the box until the budget is used.

    Options of the local one carry its name, as in `bobyqa.tolerance`.
    Raises ArmidError for a global one.
    """
    if local.is_global:
        raise ArmidError(f"identifier '{local.name}' is global, {PREFIX} expects a local one")
    return Identifier(
        f"{PREFIX}{local.name}", partial(built_multistart, local), f"{local.name} from ever new starts", is_global=True,
        uses_gradient=local.uses_gradient, needs_residuals=local.needs_residuals,
    )  # fmt: skip


def built_multistart(local: Identifier, budget: int, **options: Any) -> Searching:
    """Build the algorithm; refuse with ArmidError a local one that takes no start, and options that nobody knows."""
    (told,) = of_phases(options, (local,), (), f"'{PREFIX}{local.name}'")
    build = partial(told.build, budget)
    algorithm = build()
    if not takes_start(algorithm):
        raise ArmidError(f"identifier '{local.name}' takes no start x0, {PREFIX} expects one that does")
    return Searching(multistart_method(build), budget)


def multistart_method(build: Callable[[], Algorithm]) -> Method:
    """Return the search that starts a fresh local one at the task's start, if it has one, then at spread points."""

    def method(task: Task) -> Search:
        cube = task.cube
        start = task.start
        for point in spread(task.random, cube.n):
            yield from search_of(build(), task.at(cube.candidates(point)[0] if start is None else start))
            start = None
        return True

    return method


def spread(random: np.random.Generator, n: int) -> Iterator[Array]:
    """Yield points that fill the unit cube ever more evenly: a Kronecker sequence from a random point, (n,) each."""
    steps, point = golden_steps(n), random.random(n)
    while True:
        yield point
        point = (point + steps) % 1.0
