"""The face towards pymoo: identification as a problem that any of its algorithms can work on."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.problem import Problem

from armid.fitness import Fitness, join_records
from armid.model import ArmidError
from armid.problem.meter import Meter
from armid.problem.replay import Replay
from armid.problem.space import Space

Array = NDArray[np.float64]
# Finite, for identifiers that cannot live with infinity, and worse than any fitness.
PENALTY = 1e12


class IdentificationProblem(Problem):  # type: ignore[misc]
    """Minimise a fitness over the free parameters of a model, on the train records of a campaign.

    space: bounds and fixed values; replays: records made ready to be simulated; fitness: how far; meter: the budget,
    counted in candidates, each simulated through all records; without one there is no limit.
    A candidate that diverges gets PENALTY and is counted; so does one asked for beyond the budget, but it is neither
    simulated nor counted. `names` and `units` describe the columns of X.

    Raises ArmidError when no parameter is free or no record is given.
    """

    def __init__(self, space: Space, replays: tuple[Replay, ...], fitness: Fitness, meter: Meter | None = None) -> None:
        if not space.free.any():
            raise ArmidError("no parameter is free: at least one is expected to be identified")
        if not replays:
            raise ArmidError("no record is given: at least one is expected to identify from")
        self.space, self.replays, self.fitness, self.meter = space, replays, fitness, meter
        self.names = space.free_names
        self.units = tuple(u for u, f in zip(space.units, space.free, strict=True) if f)
        self.measured = [r.measured for r in replays]
        super().__init__(n_var=len(self.names), n_obj=1, xl=space.low[space.free], xu=space.high[space.free])

    def value(self, X: Array) -> Array:
        """Return the fitness of candidates X, shape (n_candidates, n_free), +inf where one diverged."""
        return fitness_of(self.fitness, self.replays, self.measured, self.space.complete(np.atleast_2d(X)))

    def _evaluate(self, X: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        granted = len(X) if self.meter is None else self.meter.grant(len(X))
        values = np.full(len(X), PENALTY)
        if granted:
            found = self.value(X[:granted])
            failed = ~np.isfinite(found)
            values[:granted] = np.where(failed, PENALTY, found)
            if self.meter is not None:
                self.meter.record(X[:granted], values[:granted], failed)
        out["F"] = values[:, np.newaxis]

    def __deepcopy__(self, memo: dict[int, Any]) -> "IdentificationProblem":
        """Share the records and the meter: pymoo copies its problem, the measurement is one."""
        return self


def fitness_of(fitness: Fitness, replays: tuple[Replay, ...], measured: list[Array], candidates: Array) -> Array:
    """Return the joined fitness of whole candidates, (n_candidates,)."""
    table = [
        fitness(x, replay.signal(candidates), replay.pieces[0].manoeuvre.interval, replay.record.noise.rms)
        for replay, x in zip(replays, measured, strict=True)
    ]
    records = [r.record for r in replays]
    return join_records(fitness, np.array(table), [r.duration for r in records], [r.n_samples for r in records])
