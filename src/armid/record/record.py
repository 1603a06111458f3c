"""One file with its manoeuvre: Record, the Signals that it measured, and the Pieces in which it is simulated."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.model import Array, Manoeuvre, Output
from armid.record.sensor import Broken, InputNoise, Mask, Noise, Sensor

NOISE_FREE = 1e-6
# Source of a noise that nothing has to be learnt from.
KNOWN = "known"
# Which samples of a piece: those of a window, or these of it that a sensor measured.
Samples = slice | NDArray[np.intp]


class RecordWarning(UserWarning):
    """Say what had to be assumed to read a record, or what of it is not data."""


@dataclass(frozen=True)
class Irregularity:
    """How irregular the times of a file are.

    share: of the intervals, off by more than 1 % of the median. largest_gap: in median intervals; at_s: its begin.
    """

    share: float
    largest_gap: float
    at_s: float


@dataclass(frozen=True, eq=False)
class StartCorrection:
    """How the signals of a piece answer to its start, and how much of it a candidate lacks.

    With a candidate's signals y the start moves by d = gain (x - y) + offset - by_first (y_0 - first), x what was
    measured: the d that brings x - y - slopes d down, of all outputs of the file together, and does not leave the start
    that the reader saw. Of a candidate whose sensors are off the reader saw another: its first samples y_0 are not
    those of the candidate (first) about which this holds.
    slopes: d signal / d start constant, SI, (n_constants, n_outputs, n_samples). gain: (n_constants, n_seen); offset:
    (n_constants,). by_first: (n_constants, n_outputs); first: (n_outputs,). samples: of each output, those that are
    seen; measured: their values, the outputs one behind the other, (n_seen,).
    """

    places: tuple[int, ...]
    slopes: Array
    gain: Array
    offset: Array
    by_first: Array
    first: Array
    measured: Array
    samples: tuple[Samples, ...]

    def corrected(self, outputs: Array) -> Array:
        """Return signals from each candidate's own best start; outputs: of the plant, (n_outputs, n, n_samples)."""
        pairs = zip(self.places, self.samples, strict=True)
        seen = np.concatenate([outputs[place][:, samples] for place, samples in pairs], axis=1)
        # no matrix product: its rounding of one candidate may depend on how many others there are
        lacking = np.einsum("cn,sn->cs", self.measured - seen, self.gain) + self.offset
        lacking -= np.einsum("oc,so->cs", outputs[list(self.places), :, 0] - self.first[:, np.newaxis], self.by_first)
        signals = outputs.copy()
        for place, slopes in zip(self.places, self.slopes.swapaxes(0, 1), strict=True):
            signals[place] += np.einsum("cs,sn->cn", lacking, slopes[:, : outputs.shape[2]])
        return signals

    def left_of(self, changes: Sequence[Array]) -> list[Array]:
        """Return what the start leaves of changes of the seen signals; of each output and in return (n_seen, n)."""
        moved = -self.gain @ np.concatenate(changes)
        pairs = zip(changes, self.slopes.swapaxes(0, 1), self.samples, strict=True)
        return [change + slopes[:, samples].T @ moved for change, slopes, samples in pairs]


@dataclass(frozen=True, eq=False)
class Piece:
    """What is simulated in one go, on one grid.

    window: the samples that fitness and errors see. start_index: sample of the record at which the piece begins.
    start_deviation: constant (`start_position`, `start_speed`) -> standard deviation of its measured value, SI; empty
    for a machine that starts from its declared state. n_spent: first samples that gave the start of a record that is
    held out, so that they judge nothing. shown_start: constant -> its measured value, SI, where a fit estimates these
    constants with the parameters; correction: what does so, None before. smoothed: input -> what is known of it,
    where the manoeuvre holds the best estimate of what was measured (see estimation/input_noise.py).
    """

    manoeuvre: Manoeuvre
    window: slice
    start_index: int = 0
    start_deviation: Mapping[str, float] = field(default_factory=dict)
    n_spent: int = 0
    shown_start: Mapping[str, float] = field(default_factory=dict)
    correction: StartCorrection | None = None
    smoothed: Mapping[str, Any] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Length of the window [s], from its first to its last sample."""
        return float((self.window.stop - self.window.start - 1) * self.manoeuvre.interval)

    def until_window_end(self) -> "Piece":
        """Return the piece without the samples after its window: what an identification has to simulate."""
        return replace(self, manoeuvre=self.manoeuvre.shortened(int(self.window.stop)))

    def with_constants(self, constants: Mapping[str, float]) -> "Piece":
        """Return the piece with other constants of its manoeuvre, SI."""
        return replace(self, manoeuvre=replace(self.manoeuvre, constants={**self.manoeuvre.constants, **constants}))

    def with_inputs(self, inputs: Mapping[str, Array]) -> "Piece":
        """Return the piece with other values of inputs, (n_samples,) each."""
        return replace(self, manoeuvre=replace(self.manoeuvre, inputs={**self.manoeuvre.inputs, **inputs}))

    def of(self, samples: NDArray[Any]) -> NDArray[Any]:
        """Return the samples of the piece out of those of the whole record."""
        return samples[self.start_index : self.start_index + self.manoeuvre.n_samples]


@dataclass(frozen=True, eq=False)
class Signal:
    """One measured output of a record.

    output: its name, "" for a plant's only one. unit: SI. measured: [unit], (n_samples,), on the grid of the record.
    rest: samples before t = 0 [unit], as in the file. data: which samples were measured, (n_samples,), None: all; the
    others hold a straight line between these, which no fit and no error sees. sensor: what the values tell of it.
    broken: samples that are no data by what is wrong. header: of the column. guessed: samples that lie beyond the file
    once its times are corrected, (n_samples,), None: none; they stand among those that are seen, and tell nothing.
    """

    output: str
    unit: str
    measured: Array
    rest: Array
    noise: Noise
    data: Mask | None = None
    sensor: Sensor = field(default_factory=Sensor)
    broken: tuple[Broken, ...] = ()
    header: str = ""
    guessed: Mask | None = None

    @property
    def is_speed(self) -> bool:
        return self.unit in ("rad/s", "m/s")

    @property
    def every(self) -> int:
        """Samples of the grid from one that was measured to the next."""
        return 1 if self.data is None else int(np.median(np.diff(np.flatnonzero(self.data))))

    @property
    def zero_reach(self) -> float:
        """How far the zero of a counted position may be off [unit]: counting began within a step either way."""
        return self.sensor.step if self.unit in ("rad", "m") else 0.0

    @property
    def zero_doubt(self) -> float:
        """Deviation of the zero of a counted position [unit]."""
        return self.zero_reach / float(np.sqrt(3.0))

    def samples(self, piece: Piece) -> Samples:
        """Return the samples of a piece that fitness and errors see: those of its window that were measured."""
        if self.data is None:
            return piece.window
        return np.asarray(np.flatnonzero(piece.of(self.data)[piece.window]) + piece.window.start)

    def seen(self, piece: Piece) -> Array:
        """Return the measured values of a piece that fitness and errors see."""
        return piece.of(self.measured)[self.samples(piece)]

    def told(self, piece: Piece) -> Array:
        """Return 1 for each seen sample of a piece, 0 for one that is guessed, (n_seen,)."""
        known = np.ones(self.measured.size) if self.guessed is None else 1.0 - self.guessed
        return piece.of(known)[self.samples(piece)]


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """Hold one file: its grid and manoeuvre, the signals that were measured on it, and the pieces to simulate.

    file: name inside the campaign's folder. role: "train" or "holdout". manoeuvre: of the whole record, on an even grid
    from t = 0 (a plant from rest) or from the first sample (an axis). signals: of each output that the file holds, in
    the order of the plant; `output`, `unit`, `measured`, `rest`, `noise` and what is counted are those of the first,
    and `each` holds a record for each. pieces: cut to the window; one piece unless `restart_s` was given. whole_pieces:
    the same before the window. earliest: first sample that may be in a window. columns: header -> the file's other
    columns on the grid, in the unit of the header; unused: those that are neither output nor input. repeat_of: file of
    the record whose manoeuvre this one repeats, or "". irregularity: None where the file's times were even.
    input_noise: measured input -> its noise, SI; without those that are exact.
    """

    file: str
    role: str
    manoeuvre: Manoeuvre
    signals: tuple[Signal, ...]
    pieces: tuple[Piece, ...]
    whole_pieces: tuple[Piece, ...]
    earliest: int = 0
    columns: Mapping[str, Array] = field(default_factory=dict)
    unused: tuple[str, ...] = ()
    repeat_of: str = ""
    restart_s: float | None = None
    irregularity: Irregularity | None = None
    input_noise: Mapping[str, InputNoise] = field(default_factory=dict)

    def __repr__(self) -> str:
        return (f"<Record {self.file} ({self.role}): {len(self.measured)} samples of {self.manoeuvre.interval:g} s, "
                f"noise {self.noise.rms:.3g} {self.unit}>")  # fmt: skip

    def with_signals(self, change: Callable[[Signal], Signal]) -> "Record":
        """Return the record with each of its signals changed."""
        return replace(self, signals=tuple(map(change, self.signals)))

    def with_measured(self, measured: Mapping[str, Array]) -> "Record":
        """Return the record with other samples of some outputs, name -> (n_samples,)."""
        return self.with_signals(lambda s: replace(s, measured=measured.get(s.output, s.measured)))

    def with_pieces(self, change: Callable[[Piece], Piece]) -> "Record":
        """Return the record with each of its pieces changed."""
        pieces, whole_pieces = (tuple(map(change, some)) for some in (self.pieces, self.whole_pieces))
        return replace(self, pieces=pieces, whole_pieces=whole_pieces)

    def until_window_end(self) -> "Record":
        """Return the record with its pieces cut: what an identification has to simulate."""
        return self.with_pieces(Piece.until_window_end)

    @cached_property
    def each(self) -> tuple["Record", ...]:
        """The record once for each of its signals, with that one alone."""
        return tuple(replace(self, signals=(signal,)) for signal in self.signals)

    @property
    def output(self) -> str:
        """Name of the output, "" for a plant's only one."""
        return self.signals[0].output

    @property
    def unit(self) -> str:
        """Unit of the output, SI."""
        return self.signals[0].unit

    @property
    def measured(self) -> Array:
        """What was measured [unit], (n_samples,), on the grid of the record."""
        return self.signals[0].measured

    @property
    def rest(self) -> Array:
        """Samples before t = 0 [unit], as in the file."""
        return self.signals[0].rest

    @property
    def noise(self) -> Noise:
        """What is known of the sensor's noise."""
        return self.signals[0].noise

    @property
    def seen(self) -> Array:
        """Measured samples that fitness and errors see, (n_samples,)."""
        return np.concatenate([self.signals[0].seen(p) for p in self.pieces])

    def seen_by_all(self, piece: Piece) -> Array:
        """Return the seen samples of a piece, the signals one behind the other, (n_seen,)."""
        return np.concatenate([signal.seen(piece) for signal in self.signals])

    @cached_property
    def samples(self) -> list[Samples]:
        """Samples of each piece that fitness and errors see."""
        return [self.signals[0].samples(piece) for piece in self.pieces]

    @property
    def lengths(self) -> tuple[int, ...]:
        """Number of these samples in each piece."""
        return tuple(len(self.signals[0].seen(p)) for p in self.pieces)

    @property
    def manoeuvre_file(self) -> str:
        """File of the record that first made the manoeuvre: the one that this repeats, else its own."""
        return self.repeat_of or self.file

    @property
    def times(self) -> Array:
        """Sample times [s], shape (n_samples,)."""
        return self.manoeuvre.times()

    @property
    def spacing(self) -> float:
        """Time from one measured sample to the next [s]: the interval of the grid, or a multiple of it."""
        return self.manoeuvre.interval * self.signals[0].every

    @property
    def constants(self) -> Mapping[str, float]:
        """Constants of the record's manoeuvre, SI."""
        return self.manoeuvre.constants

    @property
    def n_samples(self) -> int:
        """Number of samples in the windows of all pieces that were measured."""
        return sum(self.lengths)

    @property
    def duration(self) -> float:
        """Length of the windows of all pieces [s]."""
        return sum(p.duration for p in self.pieces)

    @property
    def noises(self) -> dict[str, float]:
        """Output -> rms of its noise [its unit]."""
        return {signal.output: signal.noise.rms for signal in self.signals}

    @property
    def is_noise_free(self) -> bool:
        """Tell whether the noise is below a millionth of the largest value: a simulation, not a measurement."""
        return self.noise.rms <= NOISE_FREE * float(np.max(np.abs(self.measured)))


def made_record(file: str, role: str, manoeuvre: Manoeuvre, output: Output, measured: Array, rms: float) -> Record:
    """Return a simulated record of one output, with white noise of a known rms."""
    noise = Noise(rms, 0.0, 1.0, measured.size, KNOWN)
    pieces = (Piece(manoeuvre, slice(0, measured.size)),)
    signal = Signal(output.name, output.unit, measured, np.empty(0), noise)
    return Record(file, role, manoeuvre, (signal,), pieces, pieces)
