"""One measurement with its manoeuvre: Record, and the Pieces in which it is simulated."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from armid.model import Manoeuvre

Array = NDArray[np.float64]
NOISE_FREE = 1e-6


@dataclass(frozen=True)
class Noise:
    """Hold what is known of a sensor's noise.

    rms: [rad/s or m/s], about the mean. mean: [same], not subtracted anywhere; None where no rest was recorded.
    correlation_time_s: time constant [s] of the exponential correlation with the same sum; 0 for white noise.
    effective_fraction: independent samples per sample, 1/(1 + 2 sum rho_k), in (0, 1]. n_samples: that were looked at.
    source: "rest" (the arm under its brake) or "differences" (high differences of the motion, which cannot tell a
    correlation: the noise is taken for white).
    """

    rms: float
    mean: float | None
    correlation_time_s: float
    effective_fraction: float
    n_samples: int
    source: str


@dataclass(frozen=True)
class Irregularity:
    """Tell how irregular the times of a file are.

    share: of the intervals, off by more than 1 % of the median interval.
    largest_gap: largest interval in median intervals; at_s: where it begins [s].
    """

    share: float
    largest_gap: float
    at_s: float


@dataclass(frozen=True, eq=False)
class Piece:
    """Hold what is simulated in one go and compared with its measurement.

    manoeuvre: from the piece's first sample on. measured: [rad/s or m/s], (n_samples,), the same grid.
    window: the samples that fitness and errors see. start_index: sample of the record at which the piece begins.
    start_deviation: constant (`start_position`, `start_speed`) -> standard deviation of its measured value, SI; empty
    for a machine that starts from its declared state.
    """

    manoeuvre: Manoeuvre
    measured: Array
    window: slice
    start_index: int = 0
    start_deviation: Mapping[str, float] = field(default_factory=dict)

    @property
    def n_samples(self) -> int:
        """Number of samples in the window."""
        return int(self.window.stop - self.window.start)

    @property
    def duration(self) -> float:
        """Length of the window [s], from its first to its last sample."""
        return (self.n_samples - 1) * self.manoeuvre.interval

    def until_window_end(self) -> "Piece":
        """Return the piece without the samples after its window: what an identification has to simulate."""
        stop = int(self.window.stop)
        return replace(self, manoeuvre=self.manoeuvre.shortened(stop), measured=self.measured[:stop])


@dataclass(frozen=True, eq=False)
class Record:
    """Hold one measurement: its file, its grid, what was measured on it, and the pieces to simulate.

    file: name inside the campaign's folder. role: "train" or "holdout". unit: "rad/s" or "m/s".
    manoeuvre: of the whole record, on an even grid from t = 0 (a plant from rest) or from the first sample (an axis).
    measured: recorded speed [unit], (n_samples,), on that grid. rest: samples before t = 0 [unit], as in the file.
    pieces: cut to the window; one piece unless `restart_s` was given. whole_pieces: the same before the window.
    earliest: first sample that may be in a window. columns: header -> the file's other columns on the grid, in the
    unit of the header. repeat_of: file of the record whose manoeuvre this one repeats, or "".
    irregularity: None where the file's times were even.
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

    @property
    def times(self) -> Array:
        """Sample times [s], shape (n_samples,)."""
        return self.manoeuvre.times()

    @property
    def constants(self) -> Mapping[str, float]:
        """Constants of the record's manoeuvre, SI."""
        return self.manoeuvre.constants

    @property
    def n_samples(self) -> int:
        """Number of samples in the windows of all pieces."""
        return sum(p.n_samples for p in self.pieces)

    @property
    def duration(self) -> float:
        """Length of the windows of all pieces [s]."""
        return sum(p.duration for p in self.pieces)

    @property
    def is_noise_free(self) -> bool:
        """Tell whether the noise is below a millionth of the largest speed: a simulation, not a measurement."""
        return self.noise.rms <= NOISE_FREE * float(np.max(np.abs(self.measured)))
