"""Identification as a problem on which any algorithm of pymoo can work."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armid.engine import Calibration, Prepared, accuracy_against, calibrate, prepare, probes
from armid.errors import ArmidError
from armid.model import Model
from armid.problem.fitness import Fitness, joined, record_weights
from armid.problem.meter import Meter, Metered
from armid.problem.space import Space
from armid.record import Piece, Record

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Replay:
    """Simulate the pieces of one record, each on its own calibrated schedule."""

    record: Record
    model: Model
    pieces: tuple[Piece, ...]
    calibrations: tuple[Calibration, ...]
    threads: int = 1

    def outputs(self, candidates: Array) -> Iterator[tuple[Piece, Array]]:
        """Yield each piece with the recorded signal of whole candidates in its window, (n_candidates, n_samples)."""
        for piece, prepared in zip(self.pieces, self.prepared, strict=True):
            run = prepared.run(candidates, self.threads)
            yield piece, run.output[:, piece.window] if piece.window.start else run.output

    def signal(self, candidates: Array) -> Array:
        """Return the signal in the windows of all pieces, end to end, shape (n_candidates, n_samples)."""
        parts = [output for _, output in self.outputs(candidates)]
        return np.ascontiguousarray(parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1))

    @cached_property
    def prepared(self) -> tuple[Prepared, ...]:
        """What simulates each piece, made ready at the first call."""
        pairs = zip(self.pieces, self.calibrations, strict=True)
        return tuple(prepare(self.model, piece.manoeuvre, c.schedule) for piece, c in pairs)

    @property
    def measured(self) -> Array:
        """Measured signal in the windows of all pieces, end to end [unit of the record]."""
        return np.concatenate([p.measured[p.window] for p in self.pieces])

    @property
    def times(self) -> Array:
        """Times of these samples [s]."""
        return np.concatenate([p.manoeuvre.times()[p.window] for p in self.pieces])

    @property
    def engine_error(self) -> float:
        """Largest error of the engine that was measured on the probes [unit of the record]."""
        return max(c.error for c in self.calibrations)


def accuracy_for(record: Record, model: Model) -> str:
    """Return "fine" for a record whose noise would not hide the engine's standard error, else "standard"."""
    return accuracy_against(record.noise.rms, model)


def replay_of(
    record: Record, model: Model, space: Space, accuracy: str | None = None, threads: int = 1,
    known: dict[object, Calibration] | None = None,
) -> Replay:  # fmt: skip
    """Calibrate the engine on candidates spread over the space and make a record ready to be simulated.

    accuracy: "standard", "fine", or None: as the record's noise asks for. known: calibrations of the same model and
    space by manoeuvre, so that none is calibrated twice; those that are made are added.
    Raises ArmidError for an unknown accuracy.
    """
    spread = space.complete(probes(space.low[space.free], space.high[space.free]))
    wanted = accuracy or accuracy_for(record, model)
    pieces = tuple(p.until_window_end() for p in record.pieces)
    known = {} if known is None else known
    calibrations = []
    for piece in pieces:
        key = (wanted, *piece.manoeuvre.likeness())
        if key not in known:
            known[key] = calibrate(model, piece.manoeuvre, spread, wanted)
        calibrations.append(known[key])
    return Replay(record, model, pieces, tuple(calibrations), threads)


def replays(
    records: Sequence[Record], model: Model, space: Space, accuracy: str | None = None, threads: int = 1
) -> tuple[Replay, ...]:
    """Make several records ready to be simulated; a manoeuvre that several repeat is calibrated once."""
    known: dict[object, Calibration] = {}
    return tuple(replay_of(r, model, space, accuracy, threads, known) for r in records)


def residuals(replays: Sequence[Replay], space: Space, X: ArrayLike, weights: ArrayLike) -> Array:
    """Return w_i (x' - x) over all samples of all records, (n_candidates, n_total); NaN in a row that diverged.

    replays: n_records of them; X: free parameters, SI, (n_candidates, n_free) or (n_free,).
    weights: of the records, (n_records,), such as 1/noise [1/signal's unit].
    """
    candidates = space.complete(np.atleast_2d(np.asarray(X, dtype=np.float64)))
    signals = [replay.signal(candidates) for replay in replays]
    return weighted(signals, [replay.measured for replay in replays], weights)


def weighted(signals: Sequence[Array], measured: Sequence[Array], weights: ArrayLike) -> Array:
    """Return w_i (x' - x), end to end: signals (n_candidates, n_samples) and measured (n_samples,) of each record."""
    pairs = zip(signals, measured, np.asarray(weights, dtype=np.float64), strict=True)
    return np.concatenate([weight * (signal - x) for signal, x, weight in pairs], axis=1)


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
