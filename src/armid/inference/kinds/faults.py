"""Faults of one record as hypotheses: late, a fast clock, an offset, a drift, a gain, another start, another load.

Each is undone by a size; `column_of` gives what a unit of it does to the whitened signal.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from armid.inference.decisions import MOVES, calibration
from armid.inference.evidence import Expansion, Forecast
from armid.inference.kinds.hypothesis import Hypothesis, Proposal
from armid.inference.kinds.same_law import SAME_LAW, apart
from armid.inference.library import Library
from armid.inference.model import Fit, fit_from, unless_diverged
from armid.inference.unknowns import Unknown, freed, moved
from armid.inference.whitening import WhiteRecords
from armid.model import Array, Model, Plant
from armid.problem.problem import ReadyRecord, Replay, signals_of, with_each
from armid.problem.starts import with_shown_starts
from armid.record import Piece, Record
from armid.record.resample import share_at_once
from armid.record.start import VisibleOutputs

# Faults whose size is fitted: largest plausible one, in seconds, in shares of the largest signal (a drift per second),
# as a share, in radians or metres.
PLAUSIBLE = {"late": 0.05, "clock": 0.02, "offset": 0.05, "drift": 0.1, "gain": 0.1, "start": 0.1}
# Faults of a sensor, and of the times; all but those of a sensor are of the whole file, or of one sensor alone.
OF_SENSOR, OF_TIMES = ("offset", "drift", "gain"), ("late", "clock")
# Samples on either side from which one between them is made.
SIDE_SAMPLES = 32
# Places are told apart to so many digits of a sample: rounding is below, steps of differences are far above.
DIGITS_OF_PLACE = 10
# So few different weights are those of a late record.
FEW_PLACES = 8
# Part of a sample by which a sensor is read after an input changed, from which on it shows what the input was before.
JUST_READ = 0.05
# Share of the largest plausible size over which differences are taken.
FAULT_STEP = 1e-3


@dataclass(frozen=True)
class Fault:
    """Name what may be wrong in a file: a kind, and of a start or a label the constant of the record that is.

    alone: whether one sensor of several is late, and not the file. driven: whether a speed is read that bends where a
    held input jumps, so that between samples nobody knows it. Then signals are moved by whole samples, and inputs by
    the rest. fed: output -> by how much it follows each held input at once, for those that do. input: of a gain, the
    input that acts so much stronger than the file tells, "" for what a sensor shows.
    """

    kind: str
    constant: str = ""
    alone: bool = False
    driven: bool = False
    fed: Mapping[str, Array] = field(default_factory=dict)
    input: str = ""

    @property
    def of_sensor(self) -> bool:
        return self.alone or (self.kind in OF_SENSOR and not self.input)

    def largest(self, record: Record) -> float:
        of_signal = float(np.abs(record.measured).max()) if self.kind in ("offset", "drift") else 1.0
        return PLAUSIBLE[self.kind] * of_signal

    def unit(self, record: Record, plant: Plant) -> str:
        units = {"late": "s", "clock": "1", "offset": record.unit, "drift": f"{record.unit}/s", "gain": "1"}
        return units.get(self.kind) or next((c.unit for c in plant.constants if c.name == self.constant), "1")

    def touches(self, output: str, other: str) -> bool:
        """Tell whether a fault of one output of a record is a fault of another too."""
        return not self.input and (not self.of_sensor or other == output)

    def undone(self, record: Record, value: float, plant: Plant, output: str = "") -> Record:
        """Return a record without the fault; output: whose sensor it is, "" for the first."""
        own = output or record.output
        measured = {one.output: self.measured(one, value) for one in record.each if self.touches(own, one.output)}
        undone = record.with_measured(measured).with_pieces(lambda piece: self.undone_piece(piece, value, plant, own))
        first, last = self.lost(record, value)
        if not first + last:
            return undone
        sample = np.arange(record.measured.size)
        beyond = (sample < first) | (sample >= sample.size - last)
        return undone.with_signals(lambda s: s if not self.touches(own, s.output) else replace(
            s, guessed=beyond if s.guessed is None else beyond | s.guessed))  # fmt: skip

    def lost(self, record: Record, value: float) -> tuple[int, int]:
        """Return how many samples at either end of a record have no measured value once its times are corrected."""
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
        if self.kind == "gain" and not self.input:
            return 2.0 * record.measured.size * float(np.log(abs(1.0 + value)))
        if self.kind not in OF_TIMES:
            return 0.0
        _, weights, which = sinc_weights(len(record.measured), self.places(record, value))
        return float(sum(self.lost(record, value)) + np.sum((1.0 - np.sum(weights**2, axis=1))[which]))

    def places(self, record: Record, value: float) -> Array:
        """Return where in its samples a record holds those of its true times, (n_samples,)."""
        own = np.arange(record.measured.size, dtype=np.float64)
        if self.kind == "clock":
            return own * (1.0 + value)
        late = value / record.manoeuvre.interval
        return own + (np.floor(late) if self.driven else late)

    def inputs_read(self, record: Record, value: float) -> tuple[Mapping[str, Array], Mapping[str, Array]]:
        """Return held inputs as they were where a sensor read them, and as they are once the fault is undone.

        A sample that is read a little after an input changed shows what the input then is.
        """
        grid = record.manoeuvre
        late = value / grid.interval
        then = grid.later(late % 1.0) if self.driven else grid
        return grid.later(np.ceil(late - JUST_READ)).inputs, then.inputs

    def at_once(self, record: Record, inputs: Mapping[str, Array]) -> Array:
        """Return what of a signal follows held inputs at once, (n_samples,)."""
        share = self.fed.get(record.output)
        return np.zeros(record.measured.size) if share is None else share @ np.array(list(inputs.values()))

    def undone_piece(self, piece: Piece, value: float, plant: Plant, output: str) -> Piece:
        if self.driven:
            return replace(piece, manoeuvre=piece.manoeuvre.later(value / piece.manoeuvre.interval % 1.0))
        if self.input:
            return piece.with_inputs({self.input: (1.0 + value) * piece.manoeuvre.inputs[self.input]})
        if self.kind in ("offset", "gain"):
            return self.with_sound_start(piece, value, plant, output) if piece.shown_start else piece
        if not self.constant:
            return piece
        given = {c.name: c.value for c in plant.constants} | dict(piece.manoeuvre.constants)
        return piece.with_constants({self.constant: value if self.kind == "label" else given[self.constant] + value})

    def with_sound_start(self, piece: Piece, value: float, plant: Plant, output: str) -> Piece:
        """Return a piece whose start is what the sensor would have shown without its offset or gain."""
        outputs = VisibleOutputs(plant, piece.manoeuvre.constants)
        shown, name = outputs.at(piece.shown_start), output or plant.outputs[0].name
        if name not in shown:
            return piece
        change = -value if self.kind == "offset" else shown[name] / (1.0 + value) - shown[name]
        return replace(piece, shown_start=outputs.moved(piece.shown_start, {name: change}))

    def measured(self, record: Record, value: float) -> Array:
        """Return what was measured without the fault, (n_samples,)."""
        if self.kind in OF_TIMES:
            read, then = (self.at_once(record, inputs) for inputs in self.inputs_read(record, value))
            return resampled(record.measured - read, self.places(record, value)) + then
        if self.kind == "gain":
            return record.measured / (1.0 + value)
        if self.constant:
            return record.measured
        return record.measured - value * (np.maximum(record.times, 0.0) if self.kind == "drift" else 1.0)


def resampled(signal: Array, places: Array) -> Array:
    """Return a signal between its samples, (n_places,), by windowed cardinal sines: white noise in it stays white.

    A spline would smooth it, and what is left would no longer look like the noise of the sensor. places: in samples.
    """
    padded = np.pad(signal, SIDE_SAMPLES, mode="reflect", reflect_type="odd")
    begin, weights, which = sinc_weights(len(signal), places)
    if len(weights) > FEW_PLACES:
        near = sliding_window_view(padded, 2 * SIDE_SAMPLES)[begin + 1]
        return np.asarray(np.einsum("ij,ij->i", near, weights[which]))
    there = np.empty(len(places))
    for i, row in enumerate(weights):
        mine = which == i
        there[mine] = np.correlate(padded, row, "valid")[begin[mine] + 1]
    return there


def sinc_weights(n: int, places: Array) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
    """Return the sample before each place, weights of the samples near, and which of them are those of each place.

    Weights: (n_weights, 2 SIDE_SAMPLES). They depend on the distance to the sample before alone, which in a late record
    is the same at all places but its ends.
    """
    inside = np.clip(places, 0.0, n - 1.0)
    begin = np.minimum(np.floor(inside), n - 2.0)
    return begin.astype(np.int64), *weights_between(np.round(inside - begin, DIGITS_OF_PLACE).tobytes())


# A slope moves one unknown at a time: the places in most records are those of the simulation before.
@lru_cache(maxsize=8)
def weights_between(places: bytes) -> tuple[Array, NDArray[np.int64]]:
    """Return weights of the samples near, and which of them are those of each place, a share of the way to the next."""
    parts, which = np.unique(np.frombuffer(places), return_inverse=True)
    away = parts[:, np.newaxis] - (np.arange(2 * SIDE_SAMPLES) - SIDE_SAMPLES + 1)
    weights = np.sinc(away) * np.cos(0.5 * np.pi * away / SIDE_SAMPLES) ** 2
    return weights / np.sum(weights, axis=1, keepdims=True), which


def faults_of(base: WhiteRecords, index: int) -> Iterator[Fault]:
    """Yield what may be wrong in a record; faults of a whole file belong to its first output."""
    model, record = base.model, base.data.each[index]
    yield from (Fault(kind) for kind in OF_SENSOR)
    fed, inside = fed_through(base, index), of_file(base, index)
    if len(inside) > 1:
        yield Fault("late", alone=True, fed={o: share for o, share in fed.items() if o == record.output})
    if index != inside[0]:
        return
    yield Fault("late", driven=bends(base, index), fed=fed)
    yield Fault("clock")
    # of one output the gain of its sensor does nearly the same
    yield from (Fault("gain", input=i.name) for i in model.plant.inputs if len(inside) > 1)
    keys = [key for key in model.plant.keys if key.constant in record.constants]
    starts = {name for node in model.graph.of_kind("initial") for name in leaves_of(model, node.key)}
    yield from (Fault("start", key.constant) for key in keys if key.constant in starts and not key.boolean)
    yield from (Fault("label", key.constant) for key in keys if key.boolean)


def bends(base: WhiteRecords, index: int) -> bool:
    """Tell whether a signal of a file that reads no input bends where a held input jumps."""
    graph, inputs = base.model.graph, {i.name for i in base.model.plant.inputs}
    read = [leaves_of(base.model, signal) for signal in signals_read(base, index).values()]
    states = {key for leaves in read if leaves.isdisjoint(inputs) for key in leaves if graph.nodes[key].kind == "state"}
    return holds_inputs(base, index) and any(
        not leaves_of(base.model, f"rate__{key}").isdisjoint(inputs) for key in states)  # fmt: skip


def holds_inputs(base: WhiteRecords, index: int) -> bool:
    hold = base.data.each[index].manoeuvre.hold
    return all((i.hold or hold) == "zero" for i in base.model.plant.inputs)


def fed_through(base: WhiteRecords, index: int) -> dict[str, Array]:
    """Return by how much outputs of a file that read held inputs at once follow these, as the other records tell."""
    if not holds_inputs(base, index):
        return {}
    inputs, file = {i.name for i in base.model.plant.inputs}, base.data.each[index].file
    outputs = [o for o, key in signals_read(base, index).items() if not leaves_of(base.model, key).isdisjoint(inputs)]
    rows = {o: [r for r in base.data.each if r.output == o and r.file != file] for o in outputs}
    return {o: share_at_once([r.measured for r in records],
                             [np.array(list(r.manoeuvre.inputs.values())) for r in records])
            for o, records in rows.items() if records}  # fmt: skip


def signals_read(base: WhiteRecords, index: int) -> dict[str, str]:
    """Return output -> key of what is read, of the outputs of a file."""
    outputs = base.model.plant.outputs
    return {base.data.each[i].output: outputs[base.replays[i].place].signal for i in of_file(base, index)}


def leaves_of(model: Model, key: str) -> set[str]:
    needs = model.graph.nodes[key].needs
    return {key}.union(*(leaves_of(model, k) for k in needs)) if needs else {key}


def with_record(base: WhiteRecords, index: int, fault: Fault, value: float) -> WhiteRecords:
    """Return a problem with one record replaced by itself without a fault; index: of the faulty signal."""
    data, ready, plant = base.data, base.replays[index].ready, base.model.plant
    sound, output = data.sound.copy(), data.each[index].output
    for i in of_file(base, index):
        if fault.touches(output, data.each[i].output):
            first, last = fault.lost(data.each[i], value)
            sound[data.edges[i] : data.edges[i] + first] = sound[data.edges[i + 1] - last : data.edges[i + 1]] = 0.0
    undone = [fault.undone(r, value, plant, output) if r.file == ready.record.file else r for r in data.records]
    new = replace(ready, record=fault.undone(ready.record, value, plant, output))
    return replace(base, replays=replaced(base, new, index), data=replace(data, records=tuple(undone), sound=sound))


def with_measured(base: WhiteRecords, index: int, changes: Sequence[Array]) -> WhiteRecords:
    """Return a problem in which the signals of one record were measured so much larger."""
    ready = base.replays[index].ready
    for replay, change in zip(ready.each, changes, strict=True):
        ready = replace(replay, ready=ready).measuring(replay.measured + change).ready
    return replace(base, replays=replaced(base, ready, index))


def replaced(base: WhiteRecords, ready: ReadyRecord, index: int) -> tuple[Replay, ...]:
    """Return the replays with one record replaced; its fitted starts follow its samples."""
    old, new = base.replays[index].ready, with_shown_starts(ready)
    return with_each(base.replays, lambda one: new if one is old else one)


def of_file(base: WhiteRecords, index: int) -> list[int]:
    """Return the indices of all signals of the record that holds one signal."""
    return [i for i, r in enumerate(base.replays) if r.ready is base.replays[index].ready]


def residual_of(problem: WhiteRecords, index: int, z: Array) -> Array:
    """Return the whitened residual of the file of one record, the others' at 0, (n_samples,)."""
    left = [np.zeros(r.record.n_samples) for r in problem.replays]
    for i, simulated in zip(of_file(problem, index), simulated_file(problem, index, z), strict=True):
        left[i] = problem.replays[i].measured - simulated[0]
    return problem.data.white(left)


def simulated_file(
    problem: WhiteRecords, index: int, Z: Array, shares: Mapping[str, Array] | None = None
) -> list[Array]:  # fmt: skip
    """Return the simulated signals of the outputs of the file of one record, each (n_candidates, n_samples of it).

    shares: see `ReadyRecord.runs`.
    """
    replays = [problem.replays[i] for i in of_file(problem, index)]
    return signals_of(replays, problem.whole(np.atleast_2d(Z)), shares)


def delayed(base: WhiteRecords, index: int, z: Array, fault: Fault) -> list[Array]:
    """Return by how much a unit of a fault of times changes the signals of a file.

    From the simulated slope: that of the measured signal is mostly noise. What follows an input at once has none.
    """
    changes = []
    for i, simulated in zip(of_file(base, index), simulated_file(base, index, z), strict=True):
        replay, record = base.replays[i], base.data.each[i]
        if not fault.touches(base.data.each[index].output, record.output):
            changes.append(np.zeros(record.n_samples))
            continue
        step = record.manoeuvre.interval
        samples = np.concatenate([p.start_index + np.arange(p.manoeuvre.n_samples)[own]
                                  for p, own in zip(replay.pieces, replay.record.samples, strict=True)])  # fmt: skip
        smooth = simulated[0] - fault.at_once(record, record.manoeuvre.inputs)[samples]
        changes.append(-np.gradient(smooth, record.spacing) * (1.0 if fault.kind == "late" else step * samples))
    return changes


def column_of(base: WhiteRecords, index: int, z: Array, fault: Fault, value: float) -> Array:
    """Return what one unit of a fault does to the whitened signal, (n_samples,), about a size of it."""
    if fault.kind in OF_TIMES:
        moved = with_measured(base, index, delayed(base, index, z, fault))
        return residual_of(moved, index, z) - residual_of(base, index, z)
    step = FAULT_STEP * fault.largest(base.data.each[index])
    sides = [residual_of(with_record(base, index, fault, value + s), index, z) for s in (step, -step)]
    return np.asarray(sides[1] - sides[0]) / (2.0 * step)


def likely_shift(base: WhiteRecords, index: int, z: Array, fault: Fault) -> float:
    """Return the shift in halves of a sample that makes a record likeliest as a fit simulates it [s].

    Where a signal jumps its slope tells nothing.
    """
    inside, record = of_file(base, index), base.data.each[index]
    step = record.manoeuvre.interval
    most = min(int(fault.largest(record) / step), record.n_samples // 4)
    simulated = [simulated_file(with_record(base, index, fault, part * step), index, z) for part in (0.0, 0.5)]

    def cost(n: int) -> float:
        there = with_record(base, index, fault, 0.5 * n * step).replays
        left = [(there[i].measured - y[0])[most : len(y[0]) - most] / base.data.levels[i].rms
                for i, y in zip(inside, simulated[n % 2], strict=True)]  # fmt: skip
        return float(sum(np.mean(x**2) for x in left))

    return 0.5 * step * min(range(-2 * most, 2 * most + 1), key=cost)


def moved_by(base: WhiteRecords, index: int, z: Array, fault: Fault, value: float) -> float:
    """Return the rms by which a fault moves its record, of several outputs the most, in units of the noise there."""
    inside = of_file(base, index)
    if fault.kind in OF_TIMES and not fault.fed:
        changes = [value * change for change in delayed(base, index, z, fault)]
    else:
        faulty = with_record(base, index, fault, value)
        before, after = (simulated_file(problem, index, z) for problem in (base, faulty))
        changes = [faulty.replays[i].measured - base.replays[i].measured - y[0] + x[0]
                   for i, x, y in zip(inside, before, after, strict=True)]  # fmt: skip
    levels = [base.data.levels[i].rms for i in inside]
    return max(float(np.sqrt(np.mean(c**2))) / rms for c, rms in zip(changes, levels, strict=True))


# Prior deviations of a size, as shares of the largest plausible one.
SCALES_OF_FAULT = np.array([0.01, 0.03, 0.1, 0.3, 1.0])


@dataclass(frozen=True)
class OfRecord:
    """Name a fault and its record."""

    index: int
    fault: Fault
    largest: float

    def moved(self, records: WhiteRecords, value: float) -> WhiteRecords:
        """Return the records without the fault; value: in the largest plausible size, of a label 1 for the other."""
        if self.fault.kind == "label":
            given = records.data.each[self.index].constants[self.fault.constant]
            return with_record(records, self.index, self.fault, 1.0 - given) if value > 0.5 else records
        return with_record(records, self.index, self.fault, value * self.largest)

    def unknown(self, name: str, records: WhiteRecords) -> Unknown:
        """Return the size as an unknown; samples that were not measured at their new times must not speak for it."""
        record = records.data.each[self.index]
        return Unknown(name, self.moved, lambda value: self.fault.spent(record, value * self.largest),
                       self.column)  # fmt: skip

    def column(self, records: WhiteRecords, z: Array, value: float) -> Array:
        """Return what the largest plausible size takes away of the residual, about a value."""
        return self.largest * column_of(records, self.index, z, self.fault, value * self.largest)


def hypotheses(records: WhiteRecords) -> list[Hypothesis]:
    """Return what may be wrong in one of several records; a single record has nothing to compare it with."""
    if len(records.data.records) < 2:
        return []
    faults = []
    for index, record in enumerate(records.data.each):
        for fault in faults_of(records, index):
            largest = 1.0 if fault.kind == "label" else fault.largest(record)
            file, column = record.file, record.output if fault.of_sensor else fault.input
            place = f"{file}:{column}" if fault.of_sensor or fault.input else file
            name = f"{fault.kind}{'_' if fault.constant else ''}{fault.constant}@{place}"
            faults.append((name, OfRecord(index, fault, largest), (file, column)))
    odds = calibration().log_odds("record", len(faults))
    return [Hypothesis("record", name, "", odds, what, of) for name, what, of in faults]


def propose(fit: Fit, known: list[Hypothesis], library: Library, changes: Sequence[Proposal] = ()) -> list[Proposal]:
    """Return the faults of records that a fit does not hold, with what the largest plausible size does.

    changes: of parameters. A gain of an input that one of them in the same record is already is not proposed.
    """
    held = {f.unknown.name for f in fit.others}
    found = library.each(lambda h: proposal(fit, h), [h for h in known if h.name not in held])

    def is_change(p: Proposal) -> bool:
        file, own = p.hypothesis.record[0], p.columns[0]
        others = (c.columns[0] for c in changes if c.hypothesis.record[0] == file)
        return bool(p.hypothesis.means.fault.input) and any(apart(own, other) < SAME_LAW for other in others)

    return [p for p in found if p is not None and not is_change(p)]


def proposal(fit: Fit, hypothesis: Hypothesis) -> Proposal | None:
    what: OfRecord = hypothesis.means
    if what.fault.kind == "label":
        before, after = (r.plain.residuals(fit.z)[0] for r in (fit.records, what.moved(fit.records, 1.0)))
        column, scales = before - after, np.array([1.0])
    elif what.fault.fed and (shift := likely_shift(fit.records, what.index, fit.z, what.fault)) != 0.0:
        there = with_record(fit.records, what.index, what.fault, shift)
        column = residual_of(fit.records, what.index, fit.z) - residual_of(there, what.index, fit.z)
        column, scales = what.largest / shift * column, SCALES_OF_FAULT
    else:
        column = what.largest * column_of(fit.records, what.index, fit.z, what.fault, 0.0)
        scales = SCALES_OF_FAULT
    if not np.isfinite(column).all() or not column.any():
        return None
    return Proposal(hypothesis, column[np.newaxis], scales, np.zeros(1), partial(refit, hypothesis))


def refit(hypothesis: Hypothesis, fit: Fit, about: Expansion, ahead: Forecast, limit: float) -> Fit | None:
    """Return the model with a fault undone, its size fitted with all other unknowns."""
    what: OfRecord = hypothesis.means
    base = fit.base or fit.records
    if what.fault.kind == "label":
        return unless_diverged(lambda: relabelled(fit, what, about.scale.weight, limit))
    unknowns = [*(f.unknown for f in fit.others), what.unknown(hypothesis.name, base)]
    # a signal that jumps leads nowhere from a shift of 0
    begun = {hypothesis.name: ahead.best(1)[0][1]} if what.fault.fed else {}
    again = unless_diverged(lambda: freed(fit, base, unknowns, about.scale.weight, limit, rough=True, begun=begun))
    if again is None:
        return None
    size = again.others[-1].value * what.largest
    moves = moved_by(base, what.index, again.z, what.fault, size)
    return again if moves >= MOVES else None


def relabelled(fit: Fit, what: OfRecord, weight: float, limit: float) -> Fit:
    """Return the model with another load, or key, of a record than its file says; its further unknowns move on."""
    base, unknowns = what.moved(fit.base or fit.records, 1.0), [f.unknown for f in fit.others]
    problem = moved(base, unknowns, [f.value for f in fit.others])
    again = fit_from(problem, fit.active, [fit.z, np.full(fit.n_free, 0.5)], limit=limit)
    if not unknowns:
        return again
    return freed(replace(again, base=base, others=fit.others), base, unknowns, weight, limit)
