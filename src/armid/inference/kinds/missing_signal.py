"""Where the library ends: the signal that a model lacks, recovered at each port without a form, and what it follows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import add

import numpy as np
from scipy.linalg import block_diag

from armid.engine import Schedule, Simulation, along, simulate
from armid.estimation.least_squares import WeightedRecords
from armid.inference.candidates import PROBE, idle
from armid.inference.checks import variable_names
from armid.inference.library import Library
from armid.inference.model import Fit, beyond, candidate_at, free_values, problem_about
from armid.inference.whitening import WhiteRecords
from armid.model import Array, Model
from armid.problem.problem import Replay, by_record, with_each
from armid.problem.space import Space
from armid.record import Piece

# A signal without a form is sought at so many knots in all: its cost grows with their square.
MOST_KNOTS = 600
KNOT_S, MOST_KNOTS_OF_A_PIECE = 0.02, 240
# A test signal may move the output by this share of the speed scale: far above rounding, hardly beyond linearity.
MOVED = 1e-4
SIZES_OF_TEST = 10.0 ** np.arange(-12.0, 10.0)
# Ports whose signals correlate above this are one; variables whose ranks do are one.
SAME_PORT, SAME_VARIABLE = 0.9999, 0.999


@dataclass(frozen=True, eq=False)
class Segment:
    """Hold one piece of a train record, ready for linear algebra; all signals are divided by the record's level.

    replays: of each output of the file; their signals stand one behind the other. levels: of the replays. index: which
    piece of theirs. knots: times at which a missing signal is sought [s], (n_knots,). residual: measured minus
    simulated, (n_samples,). jacobian: of the free parameters, (n_samples, n_free). gains: port -> change of the signal
    per unit of the missing signal at each knot (straight lines between knots), (n_samples, n_knots). group: number of
    its file. variables, factors: of the simulated motion, at the knots, see `motions`.
    """

    replays: tuple[Replay, ...]
    levels: tuple[float, ...]
    index: int
    schedule: Schedule
    knots: Array
    residual: Array
    jacobian: Array
    gains: dict[str, Array]
    group: int
    variables: dict[str, Array] = field(default_factory=dict)
    factors: dict[str, Array] = field(default_factory=dict)

    @property
    def piece(self) -> Piece:
        """The piece of the first output."""
        return self.replays[0].pieces[self.index]


@dataclass(frozen=True, eq=False)
class MissingSignal:
    """Hold what must be added at a port to bring the residual down.

    signals: one for each segment, [unit of the port], at its knots. share: share of the squared residual, beyond what
    the free parameters can absorb, that it removes.
    """

    port: str
    signals: tuple[Array, ...]
    share: float


@dataclass(frozen=True, eq=False)
class Dependence:
    """Say that a signal at a port is factor x curve(variable), the curve straight between evenly spaced knots.

    factor: "1", "direction" (sign of the speed) or "drive_effort". share: of the squared residual beyond the reach of
    the free parameters, that it removes in records (or blocks of time) left out of its fit; below 0 where it makes
    their prediction worse. heights: of the curve at its knots from `first` to `last` [unit of the variable], fitted on
    all train records, (n_knots,).
    """

    port: str
    variable: str
    factor: str
    share: float
    first: float
    last: float
    heights: Array


@dataclass(frozen=True, eq=False)
class Missing:
    """Hold what is known of the signal that a model lacks.

    lacking: the model. signals: what would have to be added at each port, the port that removes most of the residual
    first. segments: those to which they belong. dependences: curves over one variable, the one that predicts most
    first.
    """

    lacking: Fit
    segments: tuple[Segment, ...]
    signals: tuple[MissingSignal, ...]
    dependences: tuple[Dependence, ...]


def missing_from(lacking: Fit, library: Library) -> Missing:
    """Recover the missing signal at every port of a fitted model, and on what it depends there.

    Each port costs a simulation for every knot of every piece.
    """
    segments = segments_about(problem_about(lacking, lacking.active, library), lacking.values, library)
    # Pieces spread evenly over all, as many as the knots allow.
    most = max(1, int(MOST_KNOTS / np.mean([len(s.knots) for s in segments])))
    shown = [segments[i] for i in np.unique(np.linspace(0, len(segments) - 1, min(most, len(segments))).astype(int))]
    signals = sorted((missing_signal(shown, port) for port in segments[0].gains), key=lambda s: -s.share)
    return Missing(lacking, tuple(shown), tuple(signals), tuple(dependences(segments)))


def segments_about(
    records: WhiteRecords, values: Mapping[str, float], library: Library, port: str = ""
) -> list[Segment]:
    """Return every piece of the train records about values of the free parameters, SI, with gains and motions.

    port: at which alone gains are wanted, "" for all.
    """
    tested, levels = library.with_test_signals(records.model), [level.rms for level in records.data.levels]
    x, ports = free_values(records, values), [port] if port else list(records.model.plant.ports)
    candidate = candidate_at(records, values)
    return motions(records.model, candidate, segments(tested, records.space, x, records.replays, levels, ports))


def segments(
    model: Model, space: Space, x: Array, replays: Sequence[Replay], levels: Sequence[float], ports: Sequence[str]
) -> list[Segment]:
    """Return every piece of the train records with its residual, sensitivities and gains.

    x: free parameters, SI, (n_free,); levels: what residuals of each record are divided by [its unit].
    model: with a test signal at each port, see `Library.with_test_signals`.
    A port at which no signal moves the output has no gain, nor has one whose signals do what those of an earlier port
    do, a factor aside.
    """
    level_of = dict(zip(replays, levels, strict=True))
    segments = [segment_of(outputs, [level_of[r] for r in outputs], i, k, space, x)
                for i, (ready, outputs) in enumerate(by_record(replays).items())
                for k in range(len(ready.record.pieces))]  # fmt: skip
    known = {n: idle(p) for n, p in model.parameters.items()}
    known |= dict(zip(space.names, space.complete(x[np.newaxis])[0], strict=True))
    kept: list[Array] = []
    for port in ports:
        probe = Probe(model, known, f"{PROBE}{port}")
        size = probe.fitting_size(segments[0])
        if size is None:
            continue
        gains = [probe.gain(segment, size) for segment in segments]
        stacked = np.concatenate([gain.ravel() for gain in gains])
        unit = stacked / (np.linalg.norm(stacked) or 1.0)
        if not any(abs(float(unit @ other)) > SAME_PORT for other in kept):
            kept.append(unit)
            for segment, gain in zip(segments, gains, strict=True):
                segment.gains[port] = gain
    return segments


def segment_of(
    replays: Sequence[Replay], levels: Sequence[float], group: int, index: int, space: Space, x: Array
) -> Segment:
    one, replay = slice(index, index + 1), replays[0]
    alone = with_each(replays, lambda r: replace(
        r, record=replace(r.record, pieces=r.record.pieces[one]), calibrations=r.calibrations[one]))  # fmt: skip
    records = WeightedRecords(alone, space, (1.0,) * len(alone))
    residual, jacobian = records.residual_and_slopes(records.shares(x))
    level = np.repeat(levels, [len(r.measured) for r in alone])
    times = replay.pieces[index].manoeuvre.times()
    n_knots = int(np.clip((times[-1] - times[0]) / KNOT_S, 4, MOST_KNOTS_OF_A_PIECE)) + 1
    # Steps over several samples would jump across a narrow triangle; the weights belong to another set of parameters.
    schedule = replace(replay.calibrations[index].schedule, plan=None, weights=None)
    knots = np.linspace(times[0], times[-1], n_knots)
    return Segment(tuple(replays), tuple(levels), index, schedule, knots, residual / level,
                   jacobian / level[:, np.newaxis], {}, group)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Probe:
    """Hold a model with a test signal at each port, and which of them is meant; known: name -> value of the others."""

    model: Model
    known: Mapping[str, float]
    name: str

    def run(self, segment: Segment, size: float | Array, centre: float | Array, width: float) -> Simulation:
        """Simulate a segment without the test signal, then with it for each size or centre."""
        sizes, centres = np.broadcast_arrays(np.atleast_1d(size), np.atleast_1d(centre))
        names = list(self.model.parameters)
        rows = np.tile([self.known[n] for n in names], (len(sizes) + 1, 1))
        rows[:, [i for i, n in enumerate(names) if n.startswith(PROBE) and n.endswith(".width")]] = width
        rows[1:, names.index(f"{self.name}.size")], rows[1:, names.index(f"{self.name}.centre")] = sizes, centres
        return simulate(self.model, segment.piece.manoeuvre, rows, segment.schedule)

    def fitting_size(self, segment: Segment) -> float | None:
        """Return the largest power of ten whose effect on the output is still small, None where none has any."""
        knots = segment.knots
        run = self.run(segment, SIZES_OF_TEST, float(knots[len(knots) // 3]), float(knots[-1] - knots[0]) / 4)
        signals, size = run.joint(self.model.plant.sizes), self.model.plant.sizes[0]
        moved = np.abs(signals[1:] - signals[0]).max(axis=1)
        small = np.isfinite(moved) & (moved <= MOVED * size) & (moved > 0.0)
        return float(SIZES_OF_TEST[small][-1]) if small.any() else None

    def gain(self, segment: Segment, size: float) -> Array:
        """Return d signal / d missing signal at each knot, over the levels, (n_samples, n_knots)."""
        run = self.run(segment, size, segment.knots, float(segment.knots[1] - segment.knots[0]))
        pairs, correction = zip(segment.replays, segment.levels, strict=True), segment.piece.correction
        outputs = run.outputs if correction is None else correction.corrected(run.outputs)
        seen = ((outputs[r.place][:, r.record.samples[segment.index]], level) for r, level in pairs)
        return np.concatenate([(output[1:] - output[0]).T / size / level for output, level in seen])


STRENGTHS_OF_SIGNAL = 10.0 ** np.arange(-8.0, 6.0, 0.5)
# Added to the squared second differences (up to 16): keeps straight lines from being free.
LITTLE = 1e-6
# Smaller eigenvalues of the normal equations, relative to the largest, are rounding.
ROUNDING_OF_SIGNAL = 1e-13


def missing_signal(segments: Sequence[Segment], port: str) -> MissingSignal:
    """Recover the missing signal at a port.

    minimise sum |P (r - G c)|^2 + s sum |D c|^2 over the knots' values c of all segments; P projects off the
    sensitivities to the free parameters of all segments together, D takes second differences; s by generalised
    cross-validation (Golub, Heath, Wahba 1979, doi:10.1080/00401706.1979.10489751).
    """
    basis = np.concatenate([s.jacobian for s in segments])
    if basis.shape[1]:
        left, values, _ = np.linalg.svd(basis, full_matrices=False)
        basis = left[:, values > 1e-12 * values[0]] if values[0] > 0.0 else basis[:, :0]
    r = beyond(basis, np.concatenate([s.residual for s in segments]))
    g = beyond(basis, np.asarray(block_diag(*(s.gains[port] for s in segments))))
    scale = np.sqrt(np.mean(np.sum(g**2, axis=0))) or 1.0
    rough = np.asarray(block_diag(*(np.diff(np.eye(len(s.knots)), 2, axis=0) for s in segments)))
    signal = smoothest(g.T @ g / scale**2, g.T @ r / scale, rough, float(r @ r), len(r))
    rest = r - g @ signal / scale
    edges = np.cumsum([len(s.knots) for s in segments])[:-1]
    share = 1.0 - float(rest @ rest) / float(r @ r)
    return MissingSignal(port, tuple(np.split(signal / scale, edges)), share)


def smoothest(normal: Array, slope: Array, rough: Array, total: float, n: int) -> Array:
    """Return the solution with the least generalised cross-validation score, n |rest|^2 / (n - freedom)^2.

    normal, slope: G^T G and G^T r of the residual's least-squares problem; total: |r|^2; n: samples.
    In c = L^-T b with L L^T = D^T D + a little, the smoothing is plain ridge: one decomposition serves all strengths.
    """
    lower = np.linalg.cholesky(rough.T @ rough + LITTLE * np.eye(rough.shape[1]))
    inner = np.linalg.solve(lower, np.linalg.solve(lower, normal).T)
    values, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
    seen = values > ROUNDING_OF_SIGNAL * values[-1]
    values, vectors = values[seen], vectors[:, seen]
    along = vectors.T @ np.linalg.solve(lower, slope)
    squares = along**2 / values
    outside = max(total - float(squares.sum()), 0.0)
    scores = []
    for strength in STRENGTHS_OF_SIGNAL:
        kept = values / (values + strength)
        rest = outside + float(np.sum((1.0 - kept) ** 2 * squares))
        scores.append(n * rest / (n - min(float(kept.sum()), 0.9 * n)) ** 2)
    strength = float(STRENGTHS_OF_SIGNAL[int(np.argmin(scores))])
    return np.asarray(np.linalg.solve(lower.T, vectors @ (along / (values + strength))))


def motions(model: Model, candidate: Array, segments: Sequence[Segment]) -> list[Segment]:
    """Return the segments with the variables of the motion on which a missing signal may depend, and their factors.

    candidate: whole, SI, (n_parameters,). Variables that never move, and those that order the samples as an earlier one
    does, are left out.
    """
    names = curve_variables(model)
    asked = [*names, *(n for n in ("omega", "drive_effort") if knows(model, n) and n not in names)]
    tables = []
    for segment in segments:
        values = along(model, segment.piece.manoeuvre, candidate, segment.schedule, asked)
        times = segment.piece.manoeuvre.times()
        tables.append({name: np.interp(segment.knots, times, v) for name, v in values.items()})
    ranks: dict[str, Array] = {}
    for name in names:
        samples = np.concatenate([t[name] for t in tables])
        if np.ptp(samples) <= 1e-9 * max(float(np.abs(samples).max()), 1e-300):
            continue
        rank = np.argsort(np.argsort(samples)).astype(float)
        if all(abs(np.corrcoef(rank, other)[0, 1]) < SAME_VARIABLE for other in ranks.values()):
            ranks[name] = rank
    return [replace(s, variables={n: t[n] for n in ranks}, factors=factors(t, model))
            for s, t in zip(segments, tables, strict=True)]  # fmt: skip


def curve_variables(model: Model) -> list[str]:
    """Return the variables over which a curve may run: those of a residual but the voltage, and time."""
    return [*(n for n in variable_names(model) if n != "voltage"), "time"]


def knows(model: Model, name: str) -> bool:
    return model.plant.aliases.get(name, name) in model.graph.nodes


def factors(values: dict[str, Array], model: Model) -> dict[str, Array]:
    """Return what a curve may be multiplied by, at the knots."""
    factors = {"1": np.ones(len(next(iter(values.values()))))}
    speed = values.get(model.plant.aliases.get("omega", "omega"), values.get("omega"))
    if speed is not None:
        factors["direction"] = speed / np.hypot(speed, 0.005 * model.plant.scales.speed)
    if "drive_effort" in values:
        factors["drive_effort"] = values["drive_effort"]
    return factors


N_HEIGHTS, N_BLOCKS = 8, 4
# Added to a scaled normal matrix: its diagonal, and the squared bends of the curve.
RIDGE, STRAIGHT = 1e-9, 1e-4


def dependences(segments: Sequence[Segment]) -> list[Dependence]:
    pairs = [(v, f) for v in segments[0].variables for f in segments[0].factors if v != f]
    dependences = [dependence(segments, port, variable, factor)
                   for port in segments[0].gains for variable, factor in pairs]  # fmt: skip
    return sorted(dependences, key=lambda d: -d.share)


def dependence(segments: Sequence[Segment], port: str, variable: str, factor: str) -> Dependence:
    """Fit one curve, and again without each record (or block of time), to see what it predicts there."""
    values = np.concatenate([s.variables[variable] for s in segments])
    first, last = float(values.min()), float(values.max())
    weights = [hats(s.variables[variable], first, last) * s.factors[factor][:, np.newaxis] for s in segments]
    design = np.concatenate([np.hstack([s.jacobian, s.gains[port] @ w])
                             for s, w in zip(segments, weights, strict=True)])  # fmt: skip
    residual = np.concatenate([s.residual for s in segments])
    groups = np.concatenate([np.full(len(s.residual), s.group) for s in segments])
    if len(np.unique(groups)) == 1:
        groups = np.arange(len(groups)) * N_BLOCKS // len(groups)
    n_free = segments[0].jacobian.shape[1]
    blocks = [(design[groups == n], residual[groups == n]) for n in np.unique(groups)]
    parts = [NormalEquations(d.T @ d, d.T @ r, float(r @ r), n_free) for d, r in blocks]
    total, before, after = reduce(add, parts), 0.0, 0.0
    for i, left_out in enumerate(parts):
        others = reduce(add, [*parts[:i], *parts[i + 1 :]])
        before += left_out.without_curve.rest(others.without_curve.solution)
        after += left_out.rest(others.solution)
    share = 1.0 - after / before if before > 0.0 else 0.0
    return Dependence(port, variable, factor, share, first, last, total.solution[n_free:])


def hats(values: Array, first: float, last: float, n_knots: int = N_HEIGHTS) -> Array:
    """Return triangles over a range: at each value the weights of its two neighbouring knots, (n, n_knots)."""
    place = np.clip((values - first) / (last - first), 0.0, 1.0) * (n_knots - 1)
    return np.maximum(0.0, 1.0 - np.abs(place[:, np.newaxis] - np.arange(n_knots)))


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Hold what a least-squares fit needs of some samples: design^T design, design^T residual, |residual|^2.

    n_free: the first columns of the design are free parameters, the others heights of a curve.
    """

    gram: Array
    slope: Array
    square: float
    n_free: int

    def __add__(self, other: "NormalEquations") -> "NormalEquations":
        square = self.square + other.square
        return NormalEquations(self.gram + other.gram, self.slope + other.slope, square, self.n_free)

    @property
    def without_curve(self) -> "NormalEquations":
        n = self.n_free
        return NormalEquations(self.gram[:n, :n], self.slope[:n], self.square, n)

    def rest(self, coefficients: Array) -> float:
        fitted = float(coefficients @ self.gram @ coefficients)
        return self.square - 2.0 * float(coefficients @ self.slope) + fitted

    @property
    def solution(self) -> Array:
        """The coefficients of a least-squares fit whose curve is lightly held straight.

        Heights that the motion never visits then follow their neighbours instead of being free.
        """
        norms, n = np.sqrt(np.diag(self.gram)), self.n_free
        scale = np.where(norms > 0.0, norms, 1.0)
        normal = self.gram / np.outer(scale, scale) + RIDGE * np.eye(len(scale))
        heights = scale[n:].max(initial=0.0)
        if heights > 0.0:
            bends = np.diff(np.eye(len(scale) - n), 2, axis=0) * (heights / scale[n:])
            normal[n:, n:] += STRAIGHT * bends.T @ bends
        return np.asarray(np.linalg.solve(normal, self.slope / scale) / scale)
