"""Identification as a problem on which any algorithm of pymoo can work."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armid.engine import Calibration, Prepared, Schedule, Simulation, accuracy_against, calibrate, prepare, probes
from armid.errors import ArmidError, nearest
from armid.model import Array, Model
from armid.problem.fitness import Fitness, joined
from armid.problem.meter import Meter, Metered
from armid.problem.space import Space
from armid.record import Piece, Record

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class ReadyRecord:
    """Simulate the pieces of one record, each until the end of its window, on its own calibrated schedule.

    changes: parameters that are larger in this record, name -> by how much, SI.
    """

    record: Record
    model: Model
    calibrations: tuple[Calibration, ...]
    threads: int = 1
    changes: Mapping[str, float] = field(default_factory=dict)

    def runs(self, candidates: Array, shares: Mapping[str, Array] | None = None) -> list[Simulation]:
        """Return the simulation of each piece with whole candidates, its start corrected where it is fitted.

        shares: by which share of its value a constant differs from the record's, name -> (n_candidates,).
        """
        return self.corrected(self.simulated(candidates, shares))

    def simulated(self, candidates: Array, shares: Mapping[str, Array] | None = None) -> list[Simulation]:
        """Return what `runs` does, from the starts that the pieces have."""
        return self.simulated_as(self.own(candidates), shares)

    def simulated_as(self, candidates: Array, shares: Mapping[str, Array] | None = None) -> list[Simulation]:
        """Return what `simulated` does of candidates that hold the changes of their record."""
        return [p.run(candidates, self.threads, p.moved_constants(shares) if shares else None) for p in self.prepared]

    def own(self, candidates: Array) -> Array:
        """Return whole candidates, (..., n_parameters), with the changes of this record."""
        if not self.changes:
            return candidates
        return np.asarray(candidates + [self.changes.get(name, 0.0) for name in self.model.parameters])

    def corrected(self, runs: Sequence[Simulation]) -> list[Simulation]:
        """Return the simulation of each piece with its start corrected where it is fitted."""
        pairs = [(run, piece.correction) for run, piece in zip(runs, self.record.pieces, strict=True)]
        return [run if c is None else replace(run, outputs=c.corrected(run.outputs)) for run, c in pairs]

    @property
    def simulates(self) -> tuple[int, ...]:
        """What its simulations depend on, except its changes: records that share it differ in what was measured."""
        pairs = zip(self.record.pieces, self.calibrations, strict=True)
        return tuple(id(each) for piece, c in pairs for each in (piece.manoeuvre, c))

    @cached_property
    def prepared(self) -> tuple[Prepared, ...]:
        pairs = zip(self.record.pieces, self.calibrations, strict=True)
        return tuple(prepare(self.model, piece.manoeuvre, c.schedule) for piece, c in pairs)

    @property
    def each(self) -> tuple["Replay", ...]:
        """A replay for each of its signals."""
        return tuple(Replay(self, i) for i in range(len(self.record.signals)))


@dataclass(frozen=True, eq=False)
class Replay:
    """Compare one signal of a record with its simulation; `signals_of` simulates a record once for all its signals."""

    ready: ReadyRecord
    index: int = 0

    @property
    def record(self) -> Record:
        """The record with this signal alone."""
        return self.ready.record.each[self.index]

    @property
    def model(self) -> Model:
        return self.ready.model

    @property
    def pieces(self) -> tuple[Piece, ...]:
        return self.ready.record.pieces

    @property
    def calibrations(self) -> tuple[Calibration, ...]:
        return self.ready.calibrations

    def changed(self, **changes: Any) -> "Replay":
        """Return the same signal of a record with other fields of `ReadyRecord`."""
        return replace(self, ready=replace(self.ready, **changes))

    def measuring(self, values: Array) -> "Replay":
        """Return a replay with other measured values, (n_samples,)."""
        measured, first = self.record.measured.copy(), 0
        for piece, samples, n in zip(self.pieces, self.record.samples, self.record.lengths, strict=True):
            piece.of(measured)[samples] = values[first : first + n]
            first += n
        return self.changed(record=self.ready.record.with_measured({self.record.output: measured}))

    def seen(self, runs: Sequence[Simulation]) -> Array:
        parts = [run.outputs[self.place][:, samples] for run, samples in zip(runs, self.record.samples, strict=True)]
        return np.ascontiguousarray(parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1))

    def signal(self, candidates: Array) -> Array:
        return self.seen(self.ready.runs(candidates))

    @cached_property
    def place(self) -> int:
        names = [o.name for o in self.model.plant.outputs]
        return names.index(self.record.output) if self.record.output else 0

    @property
    def name(self) -> str:
        """File of the record, with the output where the plant has several."""
        several = len(self.model.plant.outputs) > 1
        return f"{self.record.file}, {self.record.output}" if several else self.record.file

    @property
    def measured(self) -> Array:
        return self.record.seen

    def zeroed(self, simulated: Array) -> Array:
        """Return what was measured, a counted position from the zero that fits a simulation best, (n_samples,)."""
        measured, reach = self.measured, self.record.signals[0].zero_reach
        return measured - np.clip(np.mean(measured - simulated), -reach, reach) if reach else measured

    @property
    def times(self) -> Array:
        pairs = zip(self.pieces, self.record.samples, strict=True)
        return np.concatenate([p.manoeuvre.times()[samples] for p, samples in pairs])

    def engine_error_at(self, candidate: Array) -> float:
        """Return the largest error of the engine at one whole candidate [unit of the record], from halved steps."""
        halved = (replace(c, schedule=Schedule(2 * c.schedule.substeps)) for c in self.calibrations)
        coarse, fine = (r.signal(candidate[np.newaxis]) for r in (self, self.changed(calibrations=tuple(halved))))
        return float(np.max(np.abs(coarse - fine))) * 16.0 / 15.0


def with_each(replays: Sequence[Replay], change: Callable[[ReadyRecord], ReadyRecord]) -> tuple[Replay, ...]:
    """Return replays whose records are changed, each once for all its signals."""
    made = {ready: change(ready) for ready in by_record(replays)}
    return tuple(replace(r, ready=made[r.ready]) for r in replays)


def by_record(replays: Sequence[Replay]) -> dict[ReadyRecord, list[Replay]]:
    """Return the replays of each record."""
    groups: dict[ReadyRecord, list[Replay]] = {}
    for replay in replays:
        groups.setdefault(replay.ready, []).append(replay)
    return groups


def samples_of(starts: Sequence[int], lengths: Sequence[Sequence[int]], piece: int) -> NDArray[np.int64]:
    """Return the samples of a piece among all, signal by signal; starts: of the signals. lengths: of their pieces."""
    begins = [start + sum(n[:piece]) for start, n in zip(starts, lengths, strict=True)]
    return np.concatenate([np.arange(a, a + n[piece]) for a, n in zip(begins, lengths, strict=True)])


def by_output(replays: Sequence[Replay], values: Sequence[T]) -> dict[int, list[T]]:
    """Return the place of each output that is recorded, in order, with the values of its replays."""
    pairs = list(zip(replays, values, strict=True))
    return {place: [v for r, v in pairs if r.place == place] for place in sorted({r.place for r in replays})}


def ready_record(
    record: Record, model: Model, space: Space, accuracy: str | None = None, threads: int = 1,
    known: dict[object, Calibration] | None = None, spans: bool = True,
) -> ReadyRecord:  # fmt: skip
    """Calibrate the engine on candidates spread over the space and make a record ready to be simulated.

    accuracy: None: as the record's noise asks for. known: calibrations of the same model and space by manoeuvre, so
    that none is calibrated twice; those that are made are added. spans: see `calibrate`.
    """
    spread = space.complete(probes(space.low[space.free], space.high[space.free]))
    wanted = accuracy or accuracy_against(record.noises, model)
    record, known, calibrations = record.until_window_end(), {} if known is None else known, []
    for piece in record.pieces:
        key = (wanted, *piece.manoeuvre.likeness())
        if key not in known:
            known[key] = calibrate(model, piece.manoeuvre, spread, wanted, spans)
        calibrations.append(known[key])
    return ReadyRecord(record, model, tuple(calibrations), threads)


def replays(
    records: Sequence[Record], model: Model, space: Space, accuracy: str | None = None, threads: int = 1,
    spans: bool = True,
) -> tuple[Replay, ...]:  # fmt: skip
    """Make several records ready to be simulated, each output by itself; what is repeated is calibrated once.

    Parameters
    ----------
    records, model, space
        What was measured, what is simulated, and the box over which the engine is calibrated.
    accuracy : {"standard", "fine"}
        Of the engine; None: as the noise of each record asks for.
    threads : int
        Of each simulation.
    spans : bool
        See `armid.calibrate`.

    Returns
    -------
    tuple of Replay
    """
    known: dict[object, Calibration] = {}
    return tuple(one for r in records for one in ready_record(r, model, space, accuracy, threads, known, spans).each)


def signals_of(
    replays: Sequence[Replay], candidates: Array, shares: Mapping[str, Array] | None = None
) -> list[Array]:  # fmt: skip
    """Return the signal of each replay, as `Replay.signal` does; those of one record share its simulation.

    shares: see `ReadyRecord.runs`.
    """
    runs = {ready: ready.runs(candidates, shares) for ready in by_record(replays)}
    return [replay.seen(runs[replay.ready]) for replay in replays]


def signals_of_each(
    forms: Sequence[tuple[Sequence[Replay], NDArray[np.int64]]], candidates: Array, shares: Mapping[str, Array]
) -> list[list[Array]]:
    """Return what `signals_of` does for several forms of the same records, of each its rows of the candidates.

    A record that differs in what was measured, or in its changes, is simulated once for all forms, its candidates side
    by side.
    """
    simulations: dict[int, dict[ReadyRecord, list[Simulation]]] = {i: {} for i in range(len(forms))}
    for alike in zip(*(by_record(form) for form, _ in forms), strict=True):
        groups: dict[tuple[int, ...], list[int]] = {}
        for i, ready in enumerate(alike):
            groups.setdefault(ready.simulates, []).append(i)
        for members in groups.values():
            rows = np.concatenate([forms[i][1] for i in members])
            own = np.concatenate([alike[i].own(candidates[forms[i][1]]) for i in members])
            runs = alike[members[0]].simulated_as(own, {n: share[rows] for n, share in shares.items()})
            edges = np.cumsum([0, *(len(forms[i][1]) for i in members)])
            for i, (first, end) in zip(members, pairwise(edges), strict=True):
                mine = [replace(run, outputs=run.outputs[:, first:end]) for run in runs]
                simulations[i][alike[i]] = alike[i].corrected(mine)
    return [[replay.seen(simulations[i][replay.ready]) for replay in form] for i, (form, _) in enumerate(forms)]


def residuals(replays: Sequence[Replay], space: Space, X: ArrayLike, weights: ArrayLike) -> Array:
    """Return w_i (x' - x) over all samples of all records; NaN in a row that diverged.

    Parameters
    ----------
    replays, space
        The records ready to be simulated, each output of a file one, and the box of their parameters.
    X : array, SI, (n_candidates, n_free) or (n_free,)
        Free parameters.
    weights : array, (n_records,)
        Of the records, such as 1/noise [1/signal's unit].

    Returns
    -------
    array, (n_candidates, n_total)
    """
    candidates = space.complete(np.atleast_2d(np.asarray(X, dtype=np.float64)))
    return weighted(signals_of(replays, candidates), [replay.measured for replay in replays], weights)


def weighted(signals: Sequence[Array], measured: Sequence[Array], weights: ArrayLike) -> Array:
    """Return w_i (x' - x), end to end: signals (n_candidates, n_samples) and measured (n_samples,) of each record."""
    pairs = zip(signals, measured, np.asarray(weights, dtype=np.float64), strict=True)
    return np.concatenate([weight * (signal - x) for signal, x, weight in pairs], axis=1)


# Values of signals in memory at a time (64 MB), and what the numbers of candidates at a time are multiples of, so that
# the engine's lanes are full.
MOST_AT_ONCE, LANES = 2**23, 16


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
        How far a candidate is from them; one that names an output sees the records of that output alone.
    meter : Meter or None
        The budget, counted in candidates, each simulated through all records; without one there is no limit.

    Raises
    ------
    ArmidError
        No parameter is free, no record is given, residuals are needed and the fitness has none, or no record holds the
        output that the fitness names.
    """

    def __init__(self, space: Space, replays: tuple[Replay, ...], fitness: Fitness, meter: Meter | None = None) -> None:
        if not space.free.any():
            raise ArmidError("no parameter is free: at least one is expected to be identified")
        if not replays:
            raise ArmidError("no record is given: at least one is expected to identify from")
        self.space, self.fitness = space, fitness
        self.replays = replays = judged_by(fitness, replays)
        self.names = space.free_names
        self.units = tuple(u for u, f in zip(space.units, space.free, strict=True) if f)
        self.measured = [r.measured for r in replays]
        # what each record weighs in the fitness, and what its signals are divided by, both (n_records,)
        self.record_weights, self.sizes = weights_of(fitness, replays), output_sizes(replays)
        super().__init__(meter, n_var=len(self.names), n_obj=1, xl=space.low[space.free], xu=space.high[space.free])

    def value(self, X: Array) -> Array:
        """Return the fitness of candidates X, shape (n_candidates, n_free), +inf where one diverged."""
        return self.evaluated(np.atleast_2d(X), False)[0]

    def evaluated(self, X: Array, residuals: bool) -> tuple[Array, Array | None]:
        """Return fitness, +inf where one diverged, and where asked the weighted residuals, (n_candidates, n_total)."""
        # so many candidates have their signals in memory at a time; no result depends on it
        size = LANES * max(MOST_AT_ONCE // (LANES * sum(x.size for x in self.measured)), 1)
        weights = residual_weights(self.fitness, self.replays, self.sizes) if residuals else []
        values, vectors = [], []
        for first in range(0, max(len(X), 1), size):
            signals = signals_of(self.replays, self.space.complete(X[first : first + size]))
            known = self.measured, signals, self.record_weights, self.sizes
            values.append(fitness_of(self.fitness, self.replays, *known))
            vectors += [weighted(signals, self.measured, weights)] if residuals else []
        return np.concatenate(values), np.concatenate(vectors) if residuals else None


def fitness_of(
    fitness: Fitness, replays: tuple[Replay, ...], measured: list[Array], signals: list[Array], weights: Array,
    sizes: Array,
) -> Array:  # fmt: skip
    """Return the joined fitness of the signals of each record, (n_candidates,); sizes: see `output_sizes`."""
    table = []
    for replay, x, signal, size in zip(replays, measured, signals, sizes, strict=True):
        interval, noise = replay.record.spacing, replay.record.noise.rms
        pair = (x, signal) if size == 1.0 else (x / size, signal / size)
        table.append(fitness(pair[0], pair[1], interval, noise / size))
    return joined(fitness, np.array(table), weights)


def judged_by(fitness: Fitness, replays: tuple[Replay, ...]) -> tuple[Replay, ...]:
    """Return the records that a fitness sees: those of the output that it names, else all."""
    kept = tuple(r for r in replays if fitness.output in ("", r.record.output))
    if replays and not kept:
        known = dict.fromkeys(r.record.output for r in replays)
        raise ArmidError(f"fitness '{fitness.name}': no record holds the output '{fitness.output}', "
                         f"{nearest(fitness.output, known)}")  # fmt: skip
    return kept


def output_sizes(replays: Sequence[Replay]) -> Array:
    """Return what the signals of each record are divided by before they are compared, (n_records,).

    1 where all records hold one output. Else the noise of each output, the root of the mean square over its records;
    where one has no noise, the largest value of each output.
    """
    outputs = [r.record.output for r in replays]
    if len(set(outputs)) < 2:
        return np.ones(len(replays))
    groups = {name: [r for r in replays if r.record.output == name] for name in outputs}
    noise = {n: float(np.sqrt(np.mean([r.record.noise.rms**2 for r in group]))) for n, group in groups.items()}
    if min(noise.values()) == 0.0:
        noise = {n: max(float(np.abs(r.measured).max()) for r in group) for n, group in groups.items()}
    return np.array([noise[name] for name in outputs])


def residual_weights(fitness: Fitness, replays: Sequence[Replay], sizes: Array) -> list[float]:
    """Return what the residual of each record weighs in the sum of squares that a fitness is, [1/unit].

    sizes: see `output_sizes`. Raises ArmidError when the fitness is not a sum of squares.
    """
    pairs = [(r.record.noise.rms, size) for r, size in zip(replays, sizes, strict=True)]
    return [fitness.weight_of(noise / size) / size for noise, size in pairs]


def weights_of(fitness: Fitness, replays: Sequence[Replay]) -> Array:
    """Return what each record weighs where their values join, (n_records,): its duration [s], its samples, or 1."""
    records = [r.record for r in replays]
    weights = {"duration": [r.duration for r in records], "samples": [r.n_samples for r in records]}
    return np.array(weights.get(fitness.join, [1.0] * len(records)), dtype=np.float64)
