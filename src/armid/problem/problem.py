"""Identification as a problem on which any algorithm of pymoo can work."""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError
from armid.problem.fitness import Fitness, joined, record_weights
from armid.problem.meter import Meter, Metered
from armid.problem.replay import Replay, weighted
from armid.problem.space import Space

Array = NDArray[np.float64]
# Values of signals in memory at a time (64 MB), and what the numbers of candidates at a time are multiples of, so that
# the engine's lanes are full.
MOST_VALUES, LANES = 2**23, 16


class IdentificationProblem(Metered):
    """Minimise a fitness over the free parameters of a model, on the train records of a campaign.

    A candidate that diverges gets PENALTY and is counted; so does one asked for beyond the budget, but it is neither
    simulated nor counted. `names` and `units` describe the columns of X.
    An evaluator that names "residuals" in `evaluate_values_of` gets the weighted residual vectors as well.

    Parameters
    ----------
    space : Space
        Bounds and fixed values.
    replays : tuple of Replay
        Records made ready to be simulated.
    fitness : Fitness
        How far a candidate is from them.
    meter : Meter or None
        The budget, counted in candidates, each simulated through all records; without one there is no limit.

    Raises
    ------
    ArmidError
        No parameter is free, no record is given, or residuals are asked of a fitness that has none.
    """

    def __init__(self, space: Space, replays: tuple[Replay, ...], fitness: Fitness, meter: Meter | None = None) -> None:
        if not space.free.any():
            raise ArmidError("no parameter is free: at least one is expected to be identified")
        if not replays:
            raise ArmidError("no record is given: at least one is expected to identify from")
        self.space, self.replays, self.fitness = space, replays, fitness
        self.names = space.free_names
        self.units = tuple(u for u, f in zip(space.units, space.free, strict=True) if f)
        self.measured = [r.measured for r in replays]
        super().__init__(meter, n_var=len(self.names), n_obj=1, xl=space.low[space.free], xu=space.high[space.free])

    def value(self, X: Array) -> Array:
        """Return the fitness of candidates X, shape (n_candidates, n_free), +inf where one diverged."""
        return self.evaluated(np.atleast_2d(X), False)[0]

    def evaluated(self, X: Array, residuals: bool) -> tuple[Array, Array | None]:
        """Return fitness, +inf where one diverged, and where asked the weighted residuals, (n_candidates, n_total)."""
        if not residuals:
            parts = [self._fitness(X[part])[0] for part in self._parts(len(X))]
            return parts[0] if len(parts) == 1 else np.concatenate(parts), None
        values, signals = self._fitness(X)
        weights = [self.fitness.weight_of(r.record.noise.rms) for r in self.replays]
        return values, weighted(signals, self.measured, weights)

    def _fitness(self, X: Array) -> tuple[Array, list[Array]]:
        """Return the fitness of candidates, (n_candidates,), and their signals in each record."""
        candidates = self.space.complete(X)
        signals = [replay.signal(candidates) for replay in self.replays]
        return fitness_of(self.fitness, self.replays, self.measured, signals, self.record_weights), signals

    def _parts(self, n_candidates: int) -> list[slice]:
        """Return the parts of a population whose signals are in memory at a time; no result depends on them."""
        size = LANES * max(MOST_VALUES // (LANES * sum(x.size for x in self.measured)), 1)
        return [slice(first, first + size) for first in range(0, max(n_candidates, 1), size)]

    @cached_property
    def record_weights(self) -> Array:
        """What each record weighs in the fitness, (n_records,)."""
        return weights_of(self.fitness, self.replays)

    def __deepcopy__(self, memo: dict[int, Any]) -> "IdentificationProblem":
        """Share the records and the meter: pymoo copies its problem, the measurement is one."""
        return self


def fitness_of(
    fitness: Fitness, replays: tuple[Replay, ...], measured: list[Array], signals: list[Array], weights: Array
) -> Array:
    """Return the joined fitness of the signals of each record, (n_candidates,); weights: of the records."""
    table = [
        fitness(x, signal, replay.pieces[0].manoeuvre.interval, replay.record.noise.rms)
        for replay, x, signal in zip(replays, measured, signals, strict=True)
    ]
    return joined(fitness, np.array(table), weights)


def weights_of(fitness: Fitness, replays: tuple[Replay, ...]) -> Array:
    """Return what each record weighs in a fitness, (n_records,)."""
    records = [r.record for r in replays]
    return record_weights(fitness, [r.duration for r in records], [r.n_samples for r in records])
