"""What may be wrong in one record: late, a fast clock, an offset, a drift, a gain, another start, another load.

Each is undone by a size; `column_of` gives what a unit of it does to the whitened signal.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armid.inference.whitening import WhiteRecords, with_samples
from armid.model import Array, Model, Plant
from armid.problem.problem import Replay, signals_of
from armid.record import Piece, Record

# Faults whose size is fitted: largest plausible one, in seconds, in shares of the largest signal (a drift per second),
# as a share, in radians or metres.
PLAUSIBLE = {"late": 0.05, "clock": 0.02, "offset": 0.05, "drift": 0.1, "gain": 0.1, "start": 0.1}
# Faults of a sensor, and of the times; all but those of a sensor are of the whole file.
OF_SENSOR, OF_TIMES = ("offset", "drift", "gain"), ("late", "clock")
# Samples on either side from which one between them is made.
REACH = 32
# Share of the largest plausible size over which differences are taken.
STEP = 1e-3


@dataclass(frozen=True)
class Fault:
    """Name what may be wrong in a file: a kind, and of a start or a label the constant of the record that is."""

    kind: str
    constant: str = ""

    def largest(self, record: Record) -> float:
        of_signal = float(np.abs(record.measured).max()) if self.kind in ("offset", "drift") else 1.0
        return PLAUSIBLE[self.kind] * of_signal

    def unit(self, record: Record, plant: Plant) -> str:
        units = {"late": "s", "clock": "1", "offset": record.unit, "drift": f"{record.unit}/s", "gain": "1"}
        return units.get(self.kind) or next((c.unit for c in plant.constants if c.name == self.constant), "1")

    def touches(self, record: Record, other: Record) -> bool:
        """Tell whether what is wrong in one record is so in another: its own sensor, or all of its file."""
        return other.file == record.file and (self.kind not in OF_SENSOR or other.output == record.output)

    def undone(self, record: Record, value: float, plant: Plant) -> Record:
        measured = self.measured(record.measured, record, value)
        pieces, whole = (tuple(self.undone_piece(p, measured, value, plant) for p in some)
                         for some in (record.pieces, record.whole_pieces))  # fmt: skip
        return replace(record, measured=measured, pieces=pieces, whole_pieces=whole)

    def trimmed(self, record: Record, value: float, plant: Plant, faulty: Record | None = None) -> Record:
        """Return a file without the fault, and without the samples that were not measured at their new time.

        faulty: the record of that of its outputs in which the fault is, None: the first.
        """
        each = list(record.each)
        for i, one in enumerate(record.each):
            if self.touches(faulty or record, one):
                there, (first, last) = self.undone(one, value, plant), self.lost(one, value)
                ends = [(first - p.start_index, one.measured.size - last - p.start_index) for p in there.pieces]
                pieces = [replace(p, window=slice(max(p.window.start, low), min(p.window.stop, high)))
                          for p, (low, high) in zip(there.pieces, ends, strict=True)]  # fmt: skip
                each[i] = replace(there, pieces=tuple(p for p in pieces if p.n_samples > 0))
        return replace(each[0], others=tuple(each[1:]))

    def lost(self, record: Record, value: float) -> tuple[int, int]:
        """Return how many samples at either end of a record have no measured value once its times are mended."""
        if self.kind not in OF_TIMES:
            return (0, 0)
        places = self.places(record, value)
        return (int(np.ceil(max(-places[0], 0.0))) + 2 * (places[0] < 0.0),
                int(np.ceil(max(places[-1] - len(places) + 1, 0.0))) + 2 * (places[-1] > len(places) - 1))  # fmt: skip

    def spent(self, record: Record, value: float) -> float:
        """Return by how much the sum of squares of noise alone falls once the fault is undone, in units of the noise.

        Samples at the ends have no value. Between samples noise is smoothed. A smaller signal has less noise, whose
        density counts with twice the logarithm of the factor.
        """
        if self.kind == "gain":
            return 2.0 * record.measured.size * float(np.log(abs(1.0 + value)))
        if self.kind not in OF_TIMES:
            return 0.0
        _, weights = sinc_weights(len(record.measured), self.places(record, value))
        return float(sum(self.lost(record, value)) + np.sum(1.0 - np.sum(weights**2, axis=1)))

    def places(self, record: Record, value: float) -> Array:
        """Return where in its samples a record holds those of its true times, (n_samples,)."""
        own = np.arange(record.measured.size, dtype=np.float64)
        return own + value / record.manoeuvre.interval if self.kind == "late" else own * (1.0 + value)

    def undone_piece(self, piece: Piece, measured: Array, value: float, plant: Plant) -> Piece:
        """Return a piece without the fault; measured: the whole record without it."""
        if not self.constant:
            return replace(piece, measured=measured[piece.start_index :][: piece.measured.size])
        given = {c.name: c.value for c in plant.constants} | dict(piece.manoeuvre.constants)
        changed = value if self.kind == "label" else given[self.constant] + value
        constants = {**piece.manoeuvre.constants, self.constant: changed}
        return replace(piece, manoeuvre=replace(piece.manoeuvre, constants=constants))

    def measured(self, signal: Array, record: Record, value: float) -> Array:
        if self.kind in OF_TIMES:
            return resampled(signal, self.places(record, value))
        if self.kind == "gain":
            return signal / (1.0 + value)
        if self.constant:
            return signal
        return signal - value * (np.maximum(record.times, 0.0) if self.kind == "drift" else 1.0)


def resampled(signal: Array, places: Array) -> Array:
    """Return a signal between its samples, (n_places,), by windowed cardinal sines: white noise in it stays white.

    A spline would smooth it, and what is left would no longer look like the noise of the sensor. places: in samples.
    """
    padded = np.pad(signal, REACH, mode="reflect", reflect_type="odd")
    near, weights = sinc_weights(len(signal), places)
    return np.asarray(np.sum(padded[near + REACH] * weights, axis=1))


def sinc_weights(n: int, places: Array) -> tuple[NDArray[np.int64], Array]:
    """Return for each place which of n samples are near, and what each weighs, (n_places, 2 REACH) both."""
    inside = np.clip(places, 0.0, n - 1.0)
    first = np.minimum(np.floor(inside), n - 2.0).astype(np.int64) - REACH + 1
    near = first[:, np.newaxis] + np.arange(2 * REACH)
    away = inside[:, np.newaxis] - near
    weights = np.sinc(away) * np.cos(0.5 * np.pi * away / REACH) ** 2
    return near, weights / np.sum(weights, axis=1, keepdims=True)


def faults_of(base: WhiteRecords, index: int) -> Iterator[Fault]:
    """Yield what may be wrong in a record; faults of a whole file belong to its first output."""
    model, record = base.model, base.data.records[index]
    yield from (Fault(kind) for kind in OF_SENSOR)
    if index != of_file(base, index)[0]:
        return
    yield from (Fault(kind) for kind in OF_TIMES)
    keys = [key for key in model.plant.keys if key.constant in record.constants]
    starts = {name for node in model.graph.of_kind("initial") for name in leaves_of(model, node.key)}
    yield from (Fault("start", key.constant) for key in keys if key.constant in starts and not key.boolean)
    yield from (Fault("label", key.constant) for key in keys if key.boolean)


def leaves_of(model: Model, key: str) -> set[str]:
    needs = model.graph.nodes[key].needs
    return {key}.union(*(leaves_of(model, k) for k in needs)) if needs else {key}


def with_record(base: WhiteRecords, index: int, fault: Fault, value: float) -> WhiteRecords:
    """Return a problem in which one record, or its whole file, is replaced by itself without a fault."""
    faulty, edges = base.data.records[index], base.data.edges
    sound, records, replays = base.data.sound.copy(), list(base.data.records), list(base.replays)
    inside = of_file(base, index)
    for i in inside:
        old = records[i]
        if not fault.touches(faulty, old):
            continue
        first, last = fault.lost(old, value)
        sound[edges[i] : edges[i] + first] = sound[edges[i + 1] - last : edges[i + 1]] = 0.0
        records[i] = fault.undone(old, value, base.model.plant)
        pieces = tuple(fault.undone_piece(p, records[i].measured, value, base.model.plant) for p in replays[i].pieces)
        replays[i] = replace(replays[i], record=records[i], pieces=pieces)
    data = replace(base.data, records=tuple(records), sound=sound)
    return replace(base, replays=with_shared_starts(replays, inside), data=data)


def with_measured(base: WhiteRecords, index: int, changes: Sequence[Array]) -> WhiteRecords:
    """Return a problem in which the outputs of the file of one record were measured so much larger."""
    replays, inside = list(base.replays), of_file(base, index)
    for i, change in zip(inside, changes, strict=True):
        replays[i] = with_samples(replays[i], replays[i].measured + change)
    return replace(base, replays=with_shared_starts(replays, inside))


def with_shared_starts(replays: Sequence[Replay], inside: Sequence[int]) -> tuple[Replay, ...]:
    """Return replays; outputs of one file share their manoeuvre and a start fitted to all of them.

    A simulation is shared by its manoeuvres, and a start is corrected by what all outputs show.
    """
    found = list(replays)
    for i in inside:
        pieces = []
        for several in zip(*(replays[k].pieces for k in inside), strict=True):
            piece = several[inside.index(i)]
            shown = np.concatenate([p.measured[p.samples] for p in several])
            correction = None if piece.correction is None else replace(piece.correction, measured=shown)
            pieces.append(replace(piece, manoeuvre=several[0].manoeuvre, correction=correction))
        found[i] = replace(found[i], pieces=tuple(pieces))
    return tuple(found)


def of_file(base: WhiteRecords, index: int) -> list[int]:
    """Return the records that are outputs of the same file as one."""
    return [i for i, r in enumerate(base.data.records) if r.file == base.data.records[index].file]


def residual_of(posed: WhiteRecords, index: int, z: Array) -> Array:
    """Return the whitened residual of the file of one record, the others' at 0, (n_samples,)."""
    left = [np.zeros(r.record.n_samples) for r in posed.replays]
    for i, simulated in zip(of_file(posed, index), simulated_file(posed, index, z), strict=True):
        left[i] = posed.replays[i].measured - simulated
    return posed.data.white(left)


def simulated_file(posed: WhiteRecords, index: int, z: Array) -> list[Array]:
    """Return the simulated signals of the outputs of the file of one record, each (n_samples of it,)."""
    replays = [posed.replays[i] for i in of_file(posed, index)]
    return [signal[0] for signal in signals_of(replays, posed.space.complete(posed.values(z)[np.newaxis]))]


def delayed(base: WhiteRecords, index: int, z: Array, fault: Fault) -> list[Array]:
    """Return by how much a unit of a fault of times changes the signals of a file.

    From the simulated slope: that of the measured signal is mostly noise.
    """
    found = []
    for i, simulated in zip(of_file(base, index), simulated_file(base, index, z), strict=True):
        replay, record = base.replays[i], base.data.records[i]
        step = record.manoeuvre.interval
        samples = np.concatenate([p.start_index + np.arange(p.measured.size)[p.samples] for p in replay.pieces])
        found.append(-np.gradient(simulated, record.spacing) * (1.0 if fault.kind == "late" else step * samples))
    return found


def column_of(base: WhiteRecords, index: int, z: Array, fault: Fault, value: float) -> Array:
    """Return what one unit of a fault does to the whitened signal, (n_samples,), about a size of it."""
    if fault.kind in OF_TIMES:
        moved = with_measured(base, index, delayed(base, index, z, fault))
        return residual_of(moved, index, z) - residual_of(base, index, z)
    step = STEP * fault.largest(base.data.records[index])
    sides = [residual_of(with_record(base, index, fault, value + s), index, z) for s in (step, -step)]
    return np.asarray(sides[1] - sides[0]) / (2.0 * step)


def moved_by(base: WhiteRecords, index: int, z: Array, fault: Fault, value: float) -> float:
    """Return the rms by which a fault moves its record, of several outputs the most, in units of the noise there."""
    inside = of_file(base, index)
    if fault.kind in OF_TIMES:
        changes = [value * change for change in delayed(base, index, z, fault)]
    else:
        there = with_record(base, index, fault, value)
        before, after = (simulated_file(posed, index, z) for posed in (base, there))
        changes = [there.replays[i].measured - base.replays[i].measured - y + x
                   for i, x, y in zip(inside, before, after, strict=True)]  # fmt: skip
    levels = [base.data.levels[i].rms for i in inside]
    return max(float(np.sqrt(np.mean(c**2))) / rms for c, rms in zip(changes, levels, strict=True))
