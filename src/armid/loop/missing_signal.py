"""Where the library ends: the signal that a model lacks, recovered at each port without a form."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from armid.engine import Schedule, along, simulate
from armid.estimation.information import sensitivities
from armid.loop.candidates import Library, idle
from armid.loop.fit import Fit
from armid.loop.whitening import WhiteRecords
from armid.model import Effect, Model, Parameter
from armid.problem.replay import Replay
from armid.problem.space import Space
from armid.record import Piece

Array = NDArray[np.float64]
# Added to a scaled normal matrix: its diagonal, and the squared bends of the curve.
RIDGE, STRAIGHT = 1e-9, 1e-4


@dataclass(frozen=True, eq=False)
class Sums:
    """Hold what a least-squares fit needs of some samples: design^T design, design^T residual, |residual|^2."""

    gram: Array
    slope: Array
    square: float

    @staticmethod
    def of(design: Array, residual: Array) -> "Sums":
        """Return the sums over samples; design: (n_samples, n_columns), residual: (n_samples,)."""
        return Sums(design.T @ design, design.T @ residual, float(residual @ residual))

    @staticmethod
    def total(parts: Sequence["Sums"]) -> "Sums":
        """Return the sums over several sets of samples."""
        return Sums(sum((p.gram for p in parts), np.zeros(1)), sum((p.slope for p in parts), np.zeros(1)),
                    sum(p.square for p in parts))  # fmt: skip

    def first(self, n: int) -> "Sums":
        """Return the sums with the first columns of the design alone."""
        return Sums(self.gram[:n, :n], self.slope[:n], self.square)

    def rest(self, coefficients: Array) -> float:
        """Return |residual - design coefficients|^2."""
        fitted = float(coefficients @ self.gram @ coefficients)
        return self.square - 2.0 * float(coefficients @ self.slope) + fitted


def removed_share(sums: Sums, n_free: int) -> float:
    """Return the share of the squared residual that a fit removes, the free parameters fitted again on both sides."""
    before = sums.first(n_free).rest(solved(sums.first(n_free), n_free))
    return 1.0 - sums.rest(solved(sums, n_free)) / before if before > 0.0 else 0.0


def left_out_share(sums: Sequence[Sums], n_free: int) -> float:
    """Return the share of the squared residual that a fit to the other groups removes from each group.

    Both sides re-fit the free parameters; below 0 where the term makes the prediction worse.
    """
    before = after = 0.0
    for i, left_out in enumerate(sums):
        others = Sums.total([*sums[:i], *sums[i + 1 :]])
        before += left_out.first(n_free).rest(solved(others.first(n_free), n_free))
        after += left_out.rest(solved(others, n_free))
    return 1.0 - after / before if before > 0.0 else 0.0


def solved(sums: Sums, n_free: int) -> Array:
    """Return the coefficients of a least-squares fit whose curve is lightly held straight.

    Heights that the motion never visits then follow their neighbours instead of being free.
    """
    norms = np.sqrt(np.diag(sums.gram))
    scale = np.where(norms > 0.0, norms, 1.0)
    normal = sums.gram / np.outer(scale, scale) + RIDGE * np.eye(len(scale))
    heights = scale[n_free:].max(initial=0.0)
    if heights > 0.0:
        bends = np.diff(np.eye(len(scale) - n_free), 2, axis=0) * (heights / scale[n_free:])
        normal[n_free:, n_free:] += STRAIGHT * bends.T @ bends
    return np.asarray(np.linalg.solve(normal, sums.slope / scale) / scale)


KNOT_S, MOST_KNOTS_OF_A_PIECE = 0.02, 240
# A test signal may move the output by this share of the speed scale: far above rounding, hardly beyond linearity.
MOVES = 1e-4
SIZES = 10.0 ** np.arange(-12.0, 10.0)
PROBE = "probe_"
ALIKE = 0.9999


@dataclass(frozen=True, eq=False)
class Stretch:
    """Hold one piece of a train record, ready for linear algebra; all signals are divided by the record's level.

    knots: times at which a missing signal is sought [s], (n_knots,). residual: (n_samples,). jacobian: of the free
    parameters, (n_samples, n_free). gains: port -> change of the signal per unit of the missing signal at each knot
    (straight lines between knots), (n_samples, n_knots). group: number of the record that it belongs
    to.
    """

    replay: Replay
    piece: Piece
    schedule: Schedule
    knots: Array
    residual: Array
    jacobian: Array
    gains: dict[str, Array]
    group: int


def bump(time, size, centre, width):  # type: ignore[no-untyped-def]
    """Return a triangle of a height at a time [s], width to either side [s]."""
    return size * np.maximum(0.0, 1.0 - np.abs(time - centre) / width)


def bump_at(port: str) -> Effect:
    """Return the test signal as an effect at a port."""
    parameters = (
        Parameter("size", "1", -1.0, 1.0, null=0.0), Parameter("centre", "s", 0.0, 1.0),
        Parameter("width", "s", 1e-3, 1.0),
    )  # fmt: skip
    return Effect(f"{PROBE}{port}", parameters, {port: bump}, note="a triangle in time")


def stretches(
    model: Model, space: Space, x: Array, replays: Sequence[Replay], levels: Sequence[float], ports: Sequence[str]
) -> list[Stretch]:
    """Return every piece of the train records with its residual, sensitivities and gains.

    x: free parameters, SI, (n_free,); levels: what residuals of each record are divided by [its unit].
    A port at which no signal moves the output has no gain. All ports together cost one compiled model, none where the
    model holds the test signals already.
    """
    pairs = enumerate(zip(replays, levels, strict=True))
    whole = [piece_stretch(r, level, i, k, space, x) for i, (r, level) in pairs for k in range(len(r.pieces))]
    known = dict(zip(space.names, space.complete(x[np.newaxis])[0], strict=True))
    held = {e.name for e in model.effects}
    probes = [p for p in map(bump_at, ports) if p.name not in held]
    extended = Model(model.plant, (*model.effects, *probes)) if probes else model
    for port in ports:
        probe = Probe(extended, known, f"{PROBE}{port}")
        size = fitting_size(probe, whole[0])
        if size is not None:
            for stretch in whole:
                stretch.gains[port] = gain_of(probe, stretch, size) / levels[stretch.group]
    drop_alike(whole)
    return whole


def drop_alike(whole: Sequence[Stretch]) -> None:
    """Drop the ports whose signals do what those of an earlier port do, a factor aside: nothing tells them apart."""
    kept: list[Array] = []
    for port in list(whole[0].gains):
        every = np.concatenate([s.gains[port].ravel() for s in whole])
        unit = every / (np.linalg.norm(every) or 1.0)
        if any(abs(float(unit @ other)) > ALIKE for other in kept):
            for stretch in whole:
                del stretch.gains[port]
        else:
            kept.append(unit)


def piece_stretch(replay: Replay, level: float, group: int, index: int, space: Space, x: Array) -> Stretch:
    """Return one piece without gains yet."""
    one = slice(index, index + 1)
    alone = replace(replay, pieces=replay.pieces[one], calibrations=replay.calibrations[one])
    piece = replay.pieces[index]
    signal = alone.signal(space.complete(x[np.newaxis]))[0]
    times = piece.manoeuvre.times()
    n_knots = int(np.clip((times[-1] - times[0]) / KNOT_S, 4, MOST_KNOTS_OF_A_PIECE)) + 1
    jacobian = sensitivities(alone, space, x) if len(x) else np.empty((len(signal), 0))
    # Steps over several samples would jump across a narrow triangle; the weights belong to another set of parameters.
    schedule = replace(replay.calibrations[index].schedule, plan=None, weights=None)
    return Stretch(
        replay, piece, schedule, np.linspace(times[0], times[-1], n_knots), (alone.measured - signal) / level,
        jacobian / level, {}, group,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Probe:
    """Hold a model with a test signal at each port, and which of them is meant; known: name -> value of the others."""

    model: Model
    known: Mapping[str, float]
    name: str

    def rows(self, size: float | Array, centre: float | Array, width: float) -> Array:
        """Return a candidate of the model with the test signal for each size or centre, (n, n_parameters)."""
        sizes, centres = np.broadcast_arrays(np.atleast_1d(size), np.atleast_1d(centre))
        names = list(self.model.parameters)
        rows = np.tile([self.known.get(n, 0.0) for n in names], (len(sizes), 1))
        rows[:, [i for i, n in enumerate(names) if n.startswith(PROBE) and n.endswith(".width")]] = width
        rows[:, names.index(f"{self.name}.size")], rows[:, names.index(f"{self.name}.centre")] = sizes, centres
        return rows


def fitting_size(probe: Probe, stretch: Stretch) -> float | None:
    """Return the largest power of ten of a test signal whose effect on the output is still small, None without any."""
    knots = stretch.knots
    rows = probe.rows(np.append(0.0, SIZES), float(knots[len(knots) // 3]), float(knots[-1] - knots[0]) / 4)
    run = simulate(probe.model, stretch.piece.manoeuvre, rows, stretch.schedule)
    moved = np.abs(run.output[1:] - run.output[0]).max(axis=1)
    small = np.isfinite(moved) & (moved <= MOVES * probe.model.plant.scales.speed) & (moved > 0.0)
    return float(SIZES[small][-1]) if small.any() else None


def gain_of(probe: Probe, stretch: Stretch, size: float) -> Array:
    """Return d signal / d missing signal at each knot, (n_samples, n_knots), forward differences."""
    width = float(stretch.knots[1] - stretch.knots[0])
    rows = probe.rows(np.append(0.0, np.full(len(stretch.knots), size)), np.append(0.0, stretch.knots), width)
    output = simulate(probe.model, stretch.piece.manoeuvre, rows, stretch.schedule).output[:, stretch.piece.window]
    return np.asarray((output[1:] - output[0]).T / size)


STRENGTHS = 10.0 ** np.arange(-8.0, 6.0, 0.5)
# Beside the squared second differences (up to 16): keeps straight lines from being free.
LITTLE = 1e-6
# Smaller eigenvalues of the normal equations, relative to the largest, are rounding.
ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class MissingSignal:
    """Hold what must be added at a port to bring the residual down.

    signals: one for each stretch, [unit of the port], at its knots. share: share of the squared residual, beyond what
    the free parameters can absorb, that it removes. strength: of the smoothing, chosen by generalised cross-validation.
    """

    port: str
    signals: tuple[Array, ...]
    share: float
    strength: float


def missing_signal(whole: Sequence[Stretch], port: str) -> MissingSignal:
    """Recover the missing signal at a port.

    minimise sum |P (r - G c)|^2 + s sum |D c|^2 over the knots' values c of all stretches; P projects off the
    sensitivities to the free parameters of all stretches together, D takes second differences; s by generalised
    cross-validation (Golub, Heath, Wahba 1979, doi:10.1080/00401706.1979.10489751).
    """
    basis = parameter_basis(whole)
    residual = np.concatenate([s.residual for s in whole])
    columns = block_diagonal([s.gains[port] for s in whole])
    r, g = without(basis, residual), without(basis, columns)
    scale = np.sqrt(np.mean(np.sum(g**2, axis=0))) or 1.0
    rough = block_diagonal([np.diff(np.eye(len(s.knots)), 2, axis=0) for s in whole])
    strength, signal = smoothest(g.T @ g / scale**2, g.T @ r / scale, rough, float(r @ r), len(r))
    rest = r - g @ signal / scale
    edges = np.cumsum([len(s.knots) for s in whole])[:-1]
    share = 1.0 - float(rest @ rest) / float(r @ r)
    return MissingSignal(port, tuple(np.split(signal / scale, edges)), share, strength)


def smoothest(normal: Array, slope: Array, rough: Array, total: float, n: int) -> tuple[float, Array]:
    """Return strength and solution with the least generalised cross-validation score, n |rest|^2 / (n - freedom)^2.

    normal, slope: G^T G and G^T r of the residual's least-squares problem; total: |r|^2; n: samples.
    In c = L^-T b with L L^T = D^T D + a little, the smoothing is plain ridge: one decomposition serves all strengths.
    """
    lower = np.linalg.cholesky(rough.T @ rough + LITTLE * np.eye(rough.shape[1]))
    inner = np.linalg.solve(lower, np.linalg.solve(lower, normal).T)
    values, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
    seen = values > ROUNDING * values[-1]
    values, vectors = values[seen], vectors[:, seen]
    along = vectors.T @ np.linalg.solve(lower, slope)
    squares = along**2 / values
    outside = max(total - float(squares.sum()), 0.0)
    scores = []
    for strength in STRENGTHS:
        kept = values / (values + strength)
        rest = outside + float(np.sum((1.0 - kept) ** 2 * squares))
        scores.append(n * rest / (n - min(float(kept.sum()), 0.9 * n)) ** 2)
    strength = float(STRENGTHS[int(np.argmin(scores))])
    return strength, np.linalg.solve(lower.T, vectors @ (along / (values + strength)))


def parameter_basis(whole: Sequence[Stretch]) -> Array:
    """Return an orthonormal basis of what the free parameters can do to all stretches, (n_samples, n_free)."""
    jacobian = np.concatenate([s.jacobian for s in whole])
    if not jacobian.shape[1]:
        return jacobian
    left, values, _ = np.linalg.svd(jacobian, full_matrices=False)
    return np.asarray(left[:, values > 1e-12 * values[0]]) if values[0] > 0.0 else jacobian[:, :0]


def without(basis: Array, columns: Array) -> Array:
    """Return columns with their part along an orthonormal basis taken away."""
    return np.asarray(columns - basis @ (basis.T @ columns))


def block_diagonal(blocks: Sequence[Array]) -> Array:
    """Return blocks along the diagonal of one matrix."""
    from scipy.linalg import block_diag

    return np.asarray(block_diag(*blocks))


N_KNOTS = 8
# Two variables whose values order the samples alike tell the same story: the second is left out.
SAME_STORY = 0.999
N_BLOCKS = 4


@dataclass(frozen=True, eq=False)
class Dependence:
    """Say that a signal at a port is factor x curve(variable), the curve straight between evenly spaced knots.

    factor: "1", "direction" (sign of the speed) or "drive_effort". removed: share of the squared residual beyond the
    reach of the free parameters that it removes; share: of records (or blocks of time) left out of its fit, below 0
    where it makes their prediction worse. heights: of the curve at its knots from `first` to `last` [unit of the
    variable], fitted on all train records, (n_knots,).
    """

    port: str
    variable: str
    factor: str
    removed: float
    share: float
    first: float
    last: float
    heights: Array


@dataclass(frozen=True, eq=False)
class Motion:
    """Hold the variables of the simulated motion at the knots of one stretch: name -> (n_knots,)."""

    stretch: Stretch
    variables: dict[str, Array]
    factors: dict[str, Array] = field(default_factory=dict)


def motions(model: Model, candidate: Array, whole: Sequence[Stretch]) -> list[Motion]:
    """Return the variables of each stretch: states, inputs, time and the effort of the drive.

    candidate: whole, SI, (n_parameters,). Those that never move, and those that order the motion as an earlier one
    does, are left out.
    """
    names = variable_names(model)
    asked = [*names, *(n for n in ("omega", "drive_effort") if knows(model, n) and n not in names)]
    tables = []
    for stretch in whole:
        values = along(model, stretch.piece.manoeuvre, candidate, stretch.schedule, asked)
        times = stretch.piece.manoeuvre.times()
        tables.append({name: np.interp(stretch.knots, times, v) for name, v in values.items()})
    kept = told_apart({name: np.concatenate([t[name] for t in tables]) for name in names})
    return [Motion(s, {n: t[n] for n in kept}, factors(t, model)) for s, t in zip(whole, tables, strict=True)]


def variable_names(model: Model) -> list[str]:
    """Return speed and position, the other states that files show, inputs, the effort of the drive, time."""
    shown = [s.name for s in model.plant.states if s.column] or [s.name for s in model.plant.states]
    first = [model.plant.aliases.get(a, a) for a in ("omega", "theta")]
    ordered = [n for n in first if n in shown] + [n for n in shown if n not in first]
    effort = [n for n in ("drive_effort",) if knows(model, n)]
    return [*ordered, *(i.name for i in model.plant.inputs), *effort, "time"]


def knows(model: Model, name: str) -> bool:
    """Tell whether equations of the model may use a name."""
    return model.plant.aliases.get(name, name) in model.graph.nodes


def factors(values: dict[str, Array], model: Model) -> dict[str, Array]:
    """Return what a curve may be multiplied by, at the knots."""
    found = {"1": np.ones(len(next(iter(values.values()))))}
    speed = values.get(model.plant.aliases.get("omega", "omega"), values.get("omega"))
    if speed is not None:
        found["direction"] = speed / np.hypot(speed, 0.005 * model.plant.scales.speed)
    if "drive_effort" in values:
        found["drive_effort"] = values["drive_effort"]
    return found


def told_apart(variables: dict[str, Array]) -> list[str]:
    """Return the names of variables that move and whose order of samples no earlier one has."""
    ranks: dict[str, Array] = {}
    for name, values in variables.items():
        if np.ptp(values) <= 1e-9 * max(float(np.abs(values).max()), 1e-300):
            continue
        rank = np.argsort(np.argsort(values)).astype(float)
        if all(abs(np.corrcoef(rank, other)[0, 1]) < SAME_STORY for other in ranks.values()):
            ranks[name] = rank
    return list(ranks)


def dependences(moved: Sequence[Motion]) -> list[Dependence]:
    """Return every port, variable and factor, the one that removes most first."""
    ports, pairs = moved[0].stretch.gains, [(v, f) for v in moved[0].variables for f in moved[0].factors if v != f]
    found = [dependence(moved, port, variable, factor) for port in ports for variable, factor in pairs]
    return sorted(found, key=lambda d: -d.removed)


def dependence(moved: Sequence[Motion], port: str, variable: str, factor: str) -> Dependence:
    """Fit one curve, and again without each group, to see what it predicts there."""
    values = np.concatenate([m.variables[variable] for m in moved])
    first, last = float(values.min()), float(values.max())
    columns = [m.stretch.gains[port] @ weights(m, variable, factor, first, last) for m in moved]
    design = np.concatenate([np.hstack([m.stretch.jacobian, c]) for m, c in zip(moved, columns, strict=True)])
    residual = np.concatenate([m.stretch.residual for m in moved])
    sums = [Sums.of(design[g == n], residual[g == n]) for g in (groups(moved),) for n in np.unique(g)]
    n_free = moved[0].stretch.jacobian.shape[1]
    heights = solved(Sums.total(sums), n_free)[n_free:]
    removed, share = removed_share(Sums.total(sums), n_free), left_out_share(sums, n_free)
    return Dependence(port, variable, factor, removed, share, first, last, heights)


def weights(motion: Motion, variable: str, factor: str, first: float, last: float) -> Array:
    """Return what each knot of the curve adds to the missing signal of a stretch, (n_knots, n_heights)."""
    return hats(motion.variables[variable], first, last) * motion.factors[factor][:, np.newaxis]


def hats(values: Array, first: float, last: float, n_knots: int = N_KNOTS) -> Array:
    """Return triangles over a range: at each value the weights of the two knots beside it, (n, n_knots)."""
    place = np.clip((values - first) / (last - first), 0.0, 1.0) * (n_knots - 1)
    return np.maximum(0.0, 1.0 - np.abs(place[:, np.newaxis] - np.arange(n_knots)))


def groups(moved: Sequence[Motion]) -> NDArray[np.int64]:
    """Return to which record each sample belongs, or to which block of time where there is one record only."""
    numbers = np.concatenate([np.full(len(m.stretch.residual), m.stretch.group) for m in moved])
    if len(set(numbers.tolist())) > 1:
        return numbers
    return np.asarray(np.arange(len(numbers)) * N_BLOCKS // len(numbers))


# A signal without a form is sought at so many knots in all: its cost grows with their square.
MOST_KNOTS = 600


@dataclass(frozen=True, eq=False)
class Missing:
    """Hold what is known of the signal that a model lacks.

    lacking: the model. signals: what would have to be added at each port, the port that removes most of the residual
    first. moved: the motion to which they belong. dependences: curves over one variable, the one that predicts left-out
    records best first.
    """

    lacking: Fit
    moved: tuple[Motion, ...]
    signals: tuple[MissingSignal, ...]
    dependences: tuple[Dependence, ...]

    def signal_at(self, port: str) -> MissingSignal | None:
        """Return the signal at a port, None where no signal there moves the output."""
        return next((s for s in self.signals if s.port == port), None)


def missing_from(lacking: Fit, library: Library) -> Missing:
    """Recover the missing signal at every port of a fitted model, and on what it depends there.

    library: with the test signals (see `with_terms`). Each port costs a simulation for every knot of every piece.
    """
    records, x = posed_in(library, lacking, ())
    model, levels = records.replays[0].model, [level.rms for level in records.evidence.levels]
    ports = [p for p in model.plant.ports if f"{PROBE}{p}" in library.candidates]
    whole = stretches(model, records.space, x, records.replays, levels, ports)
    shown = spread(whole)
    moved = motions(model, records.space.complete(x[np.newaxis])[0], whole)
    signals = sorted((missing_signal(shown, port) for port in whole[0].gains), key=lambda s: -s.share)
    kept = tuple(m for m in moved if any(m.stretch is s for s in shown))
    return Missing(lacking, kept, tuple(signals), tuple(dependences(moved)))


def posed_in(library: Library, lacking: Fit, added: tuple[str, ...]) -> tuple[WhiteRecords, Array]:
    """Return the problem of a fit, with effects added at rest, in another library, and its free parameters, SI."""
    records = library.problem((*lacking.active, *added), lacking.values)
    declared = records.replays[0].model.parameters
    free = records.space.free_names
    return records, np.array([lacking.values[n] if n in lacking.values else idle(declared[n]) for n in free])


def spread(whole: Sequence[Stretch]) -> list[Stretch]:
    """Return pieces spread evenly over all, as many as the knots allow."""
    most = max(1, int(MOST_KNOTS / np.mean([len(s.knots) for s in whole])))
    places = np.unique(np.linspace(0, len(whole) - 1, min(most, len(whole))).astype(int))
    return [whole[i] for i in places]
