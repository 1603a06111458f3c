"""A run of any kind, with whatever it raises kept as its outcome."""

import json
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError
from armid.estimation.identify import AT_BOUND, campaign_errors, search, versions_of
from armid.estimation.information import Information, information_at
from armid.problem.fitness import Fitness
from armid.problem.meter import Meter
from armid.problem.problem import IdentificationProblem
from armid.problem.replay import Replay
from armid.problem.space import Space
from armid.registry import place_in_plugin
from armid.study.kind import KINDS
from armid.study.outcome import DONE, FAILED, Outcome, Task, packed
from armid.study.run_cache import Workshop

LONGEST_ERROR = 2000


def perform(task: Task, workshop: Workshop) -> Outcome:
    """Perform a run; one that fails is an outcome too, so that the others go on."""
    began, started_at = time.perf_counter(), datetime.now(UTC).isoformat(timespec="seconds")
    try:
        outcome: Outcome = KINDS[json.loads(task.settings)["kind"]].perform()(task, workshop)
    except (Exception, SystemExit) as error:
        seconds = time.perf_counter() - began
        return Outcome(task.run, FAILED, sentence(error), seconds=seconds, started_at=started_at)
    return outcome


def sentence(error: BaseException) -> str:
    """Return what an error says, with its kind and its place in a plug-in where it is none of ours."""
    if isinstance(error, ArmidError):
        return str(error)[:LONGEST_ERROR]
    place = place_in_plugin(error)
    where = "" if place is None else f"plug-in {place}: "
    return f"{where}{type(error).__name__}: {error}"[:LONGEST_ERROR]


PACKAGES = ("armid", "numpy", "scipy", "numba", "pymoo", "nlopt")


@cache
def versions() -> dict[str, str]:
    """Return package -> version, of Python too."""
    return versions_of(PACKAGES)


Array = NDArray[np.float64]


def identify_run(task: Task, workshop: Workshop) -> Outcome:
    """Perform one run.

    Raises ArmidError when no candidate has a fitness, and whatever an identifier raises.
    """
    began, started_at = time.perf_counter(), datetime.now(UTC).isoformat(timespec="seconds")
    settings = json.loads(task.settings)
    bench, replays = workshop.replays(settings)
    train = tuple(r for r in replays if r.record.role == "train")
    holdout = tuple(r for r in replays if r.record.role == "holdout")
    fitness: Fitness = workshop.known.fitness[settings["fitness"]]
    identifier = workshop.known.identifier(settings["identifier"], "settings").with_options(settings["options"])
    meter = Meter(settings["budget"])
    problem = IdentificationProblem(bench.space, train, fitness, meter)
    stopped = search(problem, meter, identifier, settings["seed"], None)
    if meter.best_x is None:
        raise ArmidError(f"none of {meter.used} candidates has a fitness: each diverged, or it was no finite number")
    rows: dict[str, Sequence[tuple[Any, ...]]] = {
        "identified": [identified(meter, stopped, train, holdout, bench.space)],
        "parameters": parameters(bench.space, meter.best_x, information_at(train, bench.space, meter.best_x)),
        "traces": [trace(meter, bench.space)],
    }
    seconds = time.perf_counter() - began
    return Outcome(task.run, DONE, "", meter.used, seconds, started_at, bench.equations, versions(), rows)


def identified(
    meter: Meter, stopped: str, train: tuple[Replay, ...], holdout: tuple[Replay, ...], space: Space
) -> tuple[float | int | str | None, ...]:
    """Return how well the best candidate fits, a row of the table `identified`."""
    assert meter.best_x is not None
    candidate = space.complete(meter.best_x[np.newaxis])[0]
    near, far = campaign_errors(train, candidate), campaign_errors(holdout, candidate)
    assert near is not None
    errors = (near.rmse, near.s, near.s1, near.s2, None if far is None else far.rmse)
    return (meter.used, meter.n_failed, meter.best_f, stopped, *errors)


def parameters(space: Space, x: Array, information: Information) -> list[tuple[Any, ...]]:
    """Return value, bounds, Cramer-Rao deviation, largest correlation and flag of each free parameter."""
    low, high = space.low[space.free], space.high[space.free]
    units = [u for u, f in zip(space.units, space.free, strict=True) if f]
    margin = AT_BOUND * (high - low)
    at_bound = (x <= low + margin) | (x >= high - margin)
    largest = [largest_correlation(information.correlation, i) for i in range(len(x))]
    columns = (space.free_names, units, x.tolist(), low.tolist(), high.tolist(), information.deviation.tolist(),
               largest, at_bound.tolist())  # fmt: skip
    return list(zip(*columns, strict=True))


def largest_correlation(correlation: Array, i: int) -> float | None:
    """Return the largest correlation of one estimate with another, by size; None where none is known."""
    others = np.abs(np.delete(correlation[i], i))
    known = others[np.isfinite(others)]
    return float(known.max()) if known.size else None


def trace(meter: Meter, space: Space) -> tuple[str, bytes]:
    """Return the improvements with their candidates, a row of the table `traces`."""
    found, log = meter.trace(), meter.log()
    return json.dumps(space.free_names), packed(found.evaluation, found.value, log.X[found.evaluation - 1])
