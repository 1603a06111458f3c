"""Train records, piece by piece, with what a signal at each port would do to them: small, so linear."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armid.identifiability import sensitivities
from armid.model import Effect, Model, Parameter
from armid.problem import Replay, Space
from armid.record import Piece
from armid.simulation import Schedule, simulate

Array = NDArray[np.float64]
KNOT_S, MOST_KNOTS = 0.02, 240
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
    n_knots = int(np.clip((times[-1] - times[0]) / KNOT_S, 4, MOST_KNOTS)) + 1
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
