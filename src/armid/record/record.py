"""One measurement with its manoeuvre: Record, and the Pieces in which it is simulated."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from armid.model import Array, Manoeuvre
from armid.record.broken import Broken
from armid.record.sensor import Mask, Sensor

NOISE_FREE = 1e-6
# Which samples of a piece: those of a window, or these of it that were measured.
Samples = slice | NDArray[np.intp]


class RecordWarning(UserWarning):
    """Say what had to be assumed to read a record, or what of it is no data."""


@dataclass(frozen=True)
class Noise:
    """What is known of a sensor's noise.

    rms: [unit of the output], about the mean. mean: not subtracted anywhere; None where no rest was recorded.
    correlation_time_s: of the exponential correlation with the same sum; 0 for white noise. effective_fraction:
    independent samples per sample, 1/(1 + 2 sum rho_k), in (0, 1]. source: "rest" (the arm under its brake) or
    "differences" (high differences of the motion, which cannot tell a correlation: the noise is taken for white).
    """

    rms: float
    mean: float | None
    correlation_time_s: float
    effective_fraction: float
    n_samples: int
    source: str


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

    Beside a candidate's signals y the start moves by d = gain (x - y) + offset, x what was measured: the d that brings
    x - y - slopes d down, of all outputs of the file together, and does not leave the start that the reader saw.
    slopes: d signal / d start constant, SI, (n_constants, n_outputs, n_samples). gain: (n_constants, n_seen); offset:
    (n_constants,). samples: of each output, those that are seen; measured: their values, the outputs one behind the
    other, (n_seen,).
    """

    places: tuple[int, ...]
    slopes: Array
    gain: Array
    offset: Array
    measured: Array
    samples: tuple[Samples, ...]

    def corrected(self, outputs: Array) -> Array:
        """Return signals from each candidate's own best start; outputs: of the plant, (n_outputs, n, n_samples)."""
        pairs = zip(self.places, self.samples, strict=True)
        seen = np.concatenate([outputs[place][:, samples] for place, samples in pairs], axis=1)
        # no matrix product: its rounding of one candidate may depend on how many others there are
        lacking = np.einsum("cn,sn->cs", self.measured - seen, self.gain) + self.offset
        found = outputs.copy()
        for place, slopes in zip(self.places, self.slopes.swapaxes(0, 1), strict=True):
            found[place] += np.einsum("cs,sn->cn", lacking, slopes[:, : outputs.shape[2]])
        return found


@dataclass(frozen=True, eq=False)
class Piece:
    """What is simulated in one go and compared with its measurement, on one grid.

    window: the samples that fitness and errors see. start_index: sample of the record at which the piece begins.
    start_deviation: constant (`start_position`, `start_speed`) -> standard deviation of its measured value, SI; empty
    for a machine that starts from its declared state. n_spent: first samples that told the start of a record that is
    held out, so that they judge nothing. shown_start: constant -> its measured value, SI, where a fit estimates these
    constants beside the parameters; correction: what does so, None before. data: which of its samples were measured,
    (n_samples,), None: all; the others hold a straight line between these, which no fit and no error sees.
    """

    manoeuvre: Manoeuvre
    measured: Array
    window: slice
    start_index: int = 0
    start_deviation: Mapping[str, float] = field(default_factory=dict)
    n_spent: int = 0
    shown_start: Mapping[str, float] = field(default_factory=dict)
    correction: StartCorrection | None = None
    data: Mask | None = None

    @property
    def samples(self) -> Samples:
        """The samples that fitness and errors see: those of the window that were measured."""
        if self.data is None:
            return self.window
        return np.asarray(np.flatnonzero(self.data[self.window]) + self.window.start)

    @property
    def n_samples(self) -> int:
        """How many samples fitness and errors see."""
        if self.data is None:
            return int(self.window.stop - self.window.start)
        return int(self.data[self.window].sum())

    @property
    def duration(self) -> float:
        """Length of the window [s], from its first to its last sample."""
        return float((self.window.stop - self.window.start - 1) * self.manoeuvre.interval)

    def until_window_end(self) -> "Piece":
        """Return the piece without the samples after its window: what an identification has to simulate."""
        stop = int(self.window.stop)
        data = None if self.data is None else self.data[:stop]
        return replace(self, manoeuvre=self.manoeuvre.shortened(stop), measured=self.measured[:stop], data=data)


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """Hold one measured output of one file: its grid, what was measured on it, and the pieces to simulate.

    file: name inside the campaign's folder. role: "train" or "holdout". unit: of the output, SI.
    manoeuvre: of the whole record, on an even grid from t = 0 (a plant from rest) or from the first sample (an axis).
    measured: recorded signal [unit], (n_samples,), on that grid. rest: samples before t = 0 [unit], as in the file.
    pieces: cut to the window; one piece unless `restart_s` was given. whole_pieces: the same before the window.
    earliest: first sample that may be in a window. columns: header -> the file's other columns on the grid, in the
    unit of the header. repeat_of: file of the record whose manoeuvre this one repeats, or "".
    irregularity: None where the file's times were even. output: name of the output, "" for a plant's only one.
    others: records of the file's other outputs, with the same manoeuvres. data: which samples were measured,
    (n_samples,), None: all. sensor: what the values tell of it. broken: samples that are no data by what is wrong.
    header: of the column.
    """

    file: str
    role: str
    unit: str
    manoeuvre: Manoeuvre
    measured: Array
    rest: Array
    noise: Noise
    pieces: tuple[Piece, ...]
    whole_pieces: tuple[Piece, ...]
    earliest: int = 0
    columns: Mapping[str, Array] = field(default_factory=dict)
    repeat_of: str = ""
    restart_s: float | None = None
    irregularity: Irregularity | None = None
    output: str = ""
    others: tuple["Record", ...] = ()
    data: Mask | None = None
    sensor: Sensor = field(default_factory=Sensor)
    broken: tuple[Broken, ...] = ()
    header: str = ""

    def __repr__(self) -> str:
        return (f"<Record {self.file} ({self.role}): {len(self.measured)} samples of {self.manoeuvre.interval:g} s, "
                f"noise {self.noise.rms:.3g} {self.unit}>")  # fmt: skip

    @property
    def filled(self) -> "Record":
        """The record with the straight lines between its samples taken as measured."""

        def whole(pieces: tuple[Piece, ...]) -> tuple[Piece, ...]:
            return tuple(replace(p, data=None) for p in pieces)

        others = tuple(other.filled for other in self.others)
        return replace(self, data=None, pieces=whole(self.pieces), whole_pieces=whole(self.whole_pieces), others=others)

    @property
    def each(self) -> tuple["Record", ...]:
        """The records of all outputs of the file."""
        return (self, *self.others)

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
        if self.data is None:
            return self.manoeuvre.interval
        return self.manoeuvre.interval * float(np.median(np.diff(np.flatnonzero(self.data))))

    @property
    def constants(self) -> Mapping[str, float]:
        """Constants of the record's manoeuvre, SI."""
        return self.manoeuvre.constants

    @property
    def n_samples(self) -> int:
        """Number of samples in the windows of all pieces that were measured."""
        return sum(p.n_samples for p in self.pieces)

    @property
    def duration(self) -> float:
        """Length of the windows of all pieces [s]."""
        return sum(p.duration for p in self.pieces)

    @property
    def noises(self) -> dict[str, float]:
        """Output -> rms of its noise [its unit], of all outputs of the file."""
        return {one.output: one.noise.rms for one in self.each}

    @property
    def is_noise_free(self) -> bool:
        """Tell whether the noise is below a millionth of the largest value: a simulation, not a measurement."""
        return self.noise.rms <= NOISE_FREE * float(np.max(np.abs(self.measured)))
