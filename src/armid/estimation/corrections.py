"""Mistakes that records may contain, each with what undoes it: sign, unit, clock, zero, manoeuvre."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from armid.estimation.design import range_of
from armid.model import Array, Manoeuvre, ManoeuvreKey, Plant
from armid.record import Piece, Record, Signal
from armid.record.start import state_shown, track_of

IN_DEGREES = 180.0 / np.pi
# Units in which a mistake can be made that is one of angles and turning speeds, of turning speeds, of any signal.
ANGULAR, TURNING_UNITS, ANY = ("rad", "rad/s"), ("rad/s",), ()
# Factor that undoes a mistake -> kind, units of the signals in which it can be, words. Inputs have those of any signal.
FACTORS = {
    -1.0: ("sign", ANY, "its sign looks inverted: with the other one"),
    IN_DEGREES: ("unit", ANGULAR, "57.3 times too small, as radians under a header in degrees are: in the other unit"),
    1.0 / IN_DEGREES: ("unit", ANGULAR,
                       "57.3 times too large, as degrees under a header in radians are: in the other unit"),
    30.0 / np.pi: ("unit", TURNING_UNITS,
                   "9.55 times too small, as a mistake between rad/s and revolutions per minute makes it: corrected"),
    np.pi / 30.0: ("unit", TURNING_UNITS,
                   "9.55 times too large, as revolutions per minute under a header in rad/s are: corrected"),
    6.0: ("unit", TURNING_UNITS, "6 times too small, as revolutions per minute under a header in deg/s are: corrected"),
    10.0: ("unit", ANY, "10 times too small: ten times as large"),
    0.1: ("unit", ANY, "10 times too large: a tenth as large"),
    1000.0: ("unit", ANY, "1,000 times too small, as thousands under a plain unit are: corrected"),
    0.001: ("unit", ANY, "1,000 times too large, as thousandths (mm, ms) under a plain unit are: corrected"),
    2.0: ("gain", ANY, "half as large as it should be: doubled"),
    0.5: ("gain", ANY, "twice as large as it should be: halved"),
}  # fmt: skip
TURNS = (90.0, -90.0, 180.0)
# Samples that a piece must keep.
FEWEST_LEFT = 20
TIME_FACTORS = {
    0.001: "time_s looks like milliseconds: in seconds",
    1000.0: "time_s looks like thousands of seconds: in seconds",
    0.1: "time_s looks ten times too long: a tenth as long",
    10.0: "time_s looks ten times too short: ten times as long",
    1.0 / 60.0: "time_s looks sixty times too long: a sixtieth as long",
    60.0: "time_s looks like minutes: in seconds",
}


@dataclass(frozen=True)
class DataIssue:
    """One mistake that the records seem to contain.

    kind: "sign", "unit", "gain", "time", "late", "exchanged", "absolute", "zero", "key", "angle" (of a key), "input",
    "bounds", "position", "noise", "rest", "twice", "start", "unlike" or "unjudged" (no mistake was found, and the
    model misses most of a record). record: file, "" for every train record. after: rms error over rms of the signal
    with the mistake undone. factor: of its correction, NaN without one.
    """

    kind: str
    record: str
    sentence: str
    after: float = np.nan
    factor: float = np.nan


@dataclass(frozen=True)
class Correction:
    """Undo one mistake: `undo` returns a piece as it should have been, `words` begin a sentence about it.

    factor: what the signal or the times are to be multiplied by, for "late" the seconds, for "zero" what is to be added
    [rad], else NaN. other: the second of two files.
    """

    kind: str
    factor: float
    words: str
    undo: Callable[[Record], Record]
    other: str = ""

    def issue(self, record: str, before: float, after: float) -> DataIssue:
        who = record or "every train record"
        text = f"{who}: {self.words} the error falls from {before:.3g} to {after:.2g} of the signal"
        return DataIssue(self.kind, record, f"{text}.", after, self.factor)


WIDER_BOUNDS = Correction("bounds", np.nan, "bounds or fixed values look wrong: with those that the model declares",
                    lambda record: record)  # fmt: skip


def corrections(plant: Plant, record: Record, shift: int) -> Iterator[Correction]:
    """Yield what may be undone in a record; shift: by how many samples its signal may come too late."""
    yield from corrections_of_sizes(plant, record)
    yield from corrections_of_zeros(plant, record)
    for a, b in combinations(record.signals, 2):
        if a.unit == b.unit:
            words = f"its {a.output} and {b.output} look exchanged: the other way round"
            other_way = of_signals(plant, [a.output, b.output], lambda x, y: [y, x])
            yield Correction("exchanged", np.nan, words, other_way)
            for one, other in ((a, b), (b, a)):
                words = f"{one.output} looks counted from the ground, {other.output} being in it: without"
                less = of_signals(plant, [one.output, other.output], lambda x, y: [x - y, y])
                yield Correction("absolute", np.nan, words, less)
    yield from corrections_of_keys(plant, record)
    if shift:
        seconds = shift * record.manoeuvre.interval
        words = f"its clock looks {abs(seconds):.3g} s {'late' if shift > 0 else 'early'}: moved by that"
        yield Correction("late", seconds, words, partial(moved, seconds=seconds))


def scaled_input(piece: Piece, name: str, factor: float) -> Piece:
    return piece.with_inputs({name: factor * piece.manoeuvre.inputs[name]})


def corrections_of_sizes(plant: Plant, record: Record) -> Iterator[Correction]:
    for factor, (kind, units, words) in FACTORS.items():
        for one in record.signals:
            if not units or one.unit in units:
                signal = f"{one.output} [{one.unit}]" if record.signals[1:] else f"{one.unit} signal"
                yield Correction(kind, factor, f"the measured {signal}: {words}",
                           of_signals(plant, [one.output], lambda x, by=factor: [by * x], factor))  # fmt: skip
        for name in (i.name for i in plant.inputs if not units):
            yield Correction("input", factor, f"input '{name}': {words}", of_pieces(
                partial(scaled_input, name=name, factor=factor)))  # fmt: skip
    for factor, words in TIME_FACTORS.items():
        yield Correction("time", factor, words, partial(with_interval, plant=plant, factor=factor))


def corrections_of_zeros(plant: Plant, record: Record) -> Iterator[Correction]:
    angles = [one.output for one in record.signals if one.unit == "rad"]
    position = record.constants.get("start_position") if record.unit == "rad/s" else None
    for turn in np.deg2rad(TURNS).tolist():
        more = f"looks counted from elsewhere: with {np.rad2deg(turn):g} deg more"
        for output in angles:
            yield Correction("zero", turn, f"{output} {more}", of_signals(plant, [output], lambda x, by=turn: [x + by]))
        if position is not None:
            other_start = partial(Piece.with_constants, constants={"start_position": position + turn})
            yield Correction("zero", turn, f"the angle {more}", of_pieces(other_start))


def corrections_of_keys(plant: Plant, record: Record) -> Iterator[Correction]:
    defaults = {c.name: c.value for c in plant.constants}
    constants = {**defaults, **record.constants}

    def correction(words: str, change: Callable[..., dict[str, float]], kind: str = "key") -> Correction:
        def undo(piece: Piece) -> Piece:
            return piece.with_constants(change({**defaults, **piece.manoeuvre.constants}))

        return Correction(kind, np.nan, words, of_pieces(undo))

    for key in plant.keys:
        if key.boolean:
            other = "true" if constants[key.constant] == 0.0 else "false"
            yield correction(f"{key.key} looks wrong: with {other}", lambda given, n=key.constant: {n: 1.0 - given[n]})
        elif key.unlike:
            words = f"start and end ({key.unlike} and {key.constant}) look exchanged: the other way round"
            yield correction(words, lambda given, a=key.constant, b=key.unlike: {a: given[b], b: given[a]})
    degrees = [k for k in plant.keys if k.key.endswith("_deg") and may_be_radians(k, constants[k.constant] / k.factor)]
    for keys in sorted({tuple(degrees), *((k,) for k in degrees)} - {()}, key=len):
        words = f"{' and '.join(k.key for k in keys)} {'look' if keys[1:] else 'looks'} given in radians: in degrees"
        names = [k.constant for k in keys]
        yield correction(words, lambda given, names=names: {n: IN_DEGREES * given[n] for n in names}, "angle")


def may_be_radians(key: ManoeuvreKey, value: float) -> bool:
    low, high = range_of(key)
    return 0.0 < abs(value) <= 2.0 * np.pi and low <= IN_DEGREES * value <= high


def of_pieces(undo: Callable[[Piece], Piece]) -> Callable[[Record], Record]:
    return lambda record: record.with_pieces(undo)


def of_signals(
    plant: Plant, outputs: Sequence[str], change: Callable[..., Sequence[Array]], factor: float = 1.0
) -> Callable[[Record], Record]:
    """Return what changes the samples of some outputs together, in a record that holds all of these."""

    def undo(record: Record) -> Record:
        measured = {one.output: one.measured for one in record.signals}
        if not measured.keys() >= {*outputs}:
            return with_measured(record, plant, {}, factor)
        changed = change(*(measured[name] for name in outputs))
        return with_measured(record, plant, dict(zip(outputs, changed, strict=True)), factor)

    return undo


def with_interval(record: Record, plant: Plant, factor: float) -> Record:
    def slower(old: Manoeuvre) -> Manoeuvre:
        return replace(old, interval=factor * old.interval, start_time=factor * old.start_time)

    told = record.with_pieces(lambda piece: replace(piece, manoeuvre=slower(piece.manoeuvre)))
    return with_measured(replace(told, manoeuvre=slower(told.manoeuvre)), plant, {})


def with_measured(record: Record, plant: Plant, measured: Mapping[str, Array], factor: float = 1.0) -> Record:
    """Return a file with other signals of some outputs, (n_samples,), and the starts that its outputs then show.

    factor: what the start of a plant that records one speed is multiplied by.
    """

    def changed(one: Signal) -> Signal:
        samples = measured.get(one.output, one.measured)
        noise = replace(one.noise, rms=one.noise.rms * rms(samples) / rms(one.measured))
        return replace(one, measured=samples, noise=noise)

    record = record.with_signals(changed)
    return replace(record, pieces=tuple(p.with_constants(start_of(record, p, plant, factor)) for p in record.pieces))


def start_of(record: Record, piece: Piece, plant: Plant, factor: float) -> dict[str, float]:
    old = piece.manoeuvre.constants
    if plant.records_one_speed:
        return {n: factor * v for n, v in old.items() if n.startswith("start_")}
    if not piece.start_deviation:
        return {}
    given = {n: v for n, v in old.items() if n not in piece.start_deviation}
    tracks = {one.output: track_of(one) for one in record.signals}
    inputs = list(piece.manoeuvre.inputs.values())
    return state_shown(plant, given, tracks, piece.manoeuvre.interval, piece.start_index, inputs)[0]


def moved(record: Record, seconds: float) -> Record:
    """Return a record whose measured signals come earlier by some time (later where negative); what is lost goes.

    Where inputs drive the machine they come later instead, so that its measured start stays where it is. A piece that
    would lose nearly all samples stays as it is.
    """
    shift = round(seconds / record.manoeuvre.interval)

    if record.manoeuvre.inputs:
        return record.with_pieces(lambda piece: replace(piece, manoeuvre=piece.manoeuvre.later(shift)))
    earlier, pieces = {s.output: s.measured.copy() for s in record.signals}, []
    for piece in record.pieces:
        begin, end = max(piece.window.start, -shift), min(piece.window.stop, piece.manoeuvre.n_samples - shift)
        if end - begin < FEWEST_LEFT:
            pieces.append(piece)
            continue
        for own in map(piece.of, earlier.values()):
            own[:] = np.roll(own, -shift)
        pieces.append(replace(piece, window=slice(begin, end)).until_window_end())
    return replace(record.with_measured(earlier), pieces=tuple(pieces))


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
