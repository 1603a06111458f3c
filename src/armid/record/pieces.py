"""Pieces of a record: where a simulation starts, from which measured state, and which samples count."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError
from armid.model import Manoeuvre
from armid.record.noise import noise_of, quantisation_step
from armid.record.record import Piece, Record
from armid.record.resample import FEWEST_SAMPLES, Timing, moved_onto_grid

Array = NDArray[np.float64]
# A window of smoothing holds only what a polynomial of one of these degrees describes ...
DEGREES = (1, 2)
# ... and its value is taken from one of so many degrees more, whose bias is of a higher order.
HIGHER = 2
# Standard deviations by which squares may exceed those of the noise.
CHANCE = 3.0
GROWTH, LONGEST = 1.25, 400
# Samples by which a window may miss one and still hold it.
SLACK = 1e-3


def piece_length(restart_s: float, interval: float, n_samples: int, where: str) -> int:
    """Return the number of samples in a piece of `restart_s` seconds.

    Raises ArmidError for a length that no piece of the record has, or that holds fewer than 20 samples.
    """
    length = int(min(restart_s / interval + 0.5, n_samples + 1))
    if length > n_samples:
        raise ArmidError(f"{where}: restart_s is {restart_s:g}, at most the record's {n_samples * interval:.6g} s are "
                         "expected")  # fmt: skip
    if length < FEWEST_SAMPLES:
        raise ArmidError(f"{where}: restart_s is {restart_s:g}, which holds {length} samples, at least "
                         f"{FEWEST_SAMPLES} are expected")  # fmt: skip
    return length


def part(manoeuvre: Manoeuvre, measured: Array, start: int, length: int, tracks: "Mapping[str, Track]") -> Piece:
    """Return the piece of `length` samples that starts at a sample, from the state there that the tracks tell."""
    stop = start + length
    state, deviation = state_at(tracks, start)
    cut = replace(
        manoeuvre,
        n_samples=length,
        start_time=manoeuvre.start_time + start * manoeuvre.interval,
        constants={**manoeuvre.constants, **state},
        inputs={name: values[start:stop] for name, values in manoeuvre.inputs.items()},
    )
    return Piece(cut, measured[start:stop], slice(0, length), start, deviation)


def with_window(record: Record, window_s: Sequence[float] | None, where: str) -> Record:
    """Return the record whose pieces show fitness and errors the samples of a window [s] only.

    window_s: begin and end in the record's own time, both included; None: all samples from t = 0 on. A piece of a
    restarted record with fewer than 20 samples in the window is left out.

    Raises ArmidError for a window that is empty, runs backward, holds fewer than 20 samples or a constant signal.
    """
    low, high = window_samples(record, window_s, where)
    if is_constant(record.measured[low:high]):
        raise ArmidError(f"{where}: the speed of {record.file} is constant in the window, a motion is expected")
    pieces = []
    for piece in record.whole_pieces:
        begin = max(low - piece.start_index, 0)
        end = min(high - piece.start_index, piece.measured.size)
        if end - begin >= FEWEST_SAMPLES:
            pieces.append(replace(piece, window=slice(begin, end)))
    if not pieces:
        raise ArmidError(f"{where}: no piece of {record.file} has {FEWEST_SAMPLES} samples in the window, a longer "
                         "window or restart_s is expected")  # fmt: skip
    return replace(record, pieces=tuple(pieces))


def window_samples(record: Record, window_s: Sequence[float] | None, where: str) -> tuple[int, int]:
    """Return first and one past the last sample of a window, as `with_window` wants it."""
    n_samples, grid = record.measured.size, record.manoeuvre
    low, high = record.earliest, n_samples
    if window_s is not None:
        begin, end = window_s
        if not begin < end:
            raise ArmidError(f"{where}: window_s is [{begin:g}, {end:g}], an end after its beginning is expected")
        ends = np.clip((np.array([begin, end]) - grid.start_time) / grid.interval, -1.0, n_samples)
        low = max(int(np.ceil(ends[0] - SLACK)), low)
        high = min(int(np.floor(ends[1] + SLACK)) + 1, high)
    if high - low < FEWEST_SAMPLES:
        raise ArmidError(f"{where}: the window holds {max(high - low, 0)} samples of {record.file}, at least "
                         f"{FEWEST_SAMPLES} are expected")  # fmt: skip
    return low, high


def is_constant(speed: Array) -> bool:
    """Tell whether a signal never changes."""
    return bool(np.ptp(speed) < 1e-30)


@dataclass(frozen=True, eq=False)
class Track:
    """Hold a signal from which a start is taken.

    values: [SI], (n_samples,). noise: standard deviation of one sample [SI]. step: of the sensor [SI], 0: a fine one.
    """

    values: Array
    noise: float
    step: float = 0.0


def track_of(values: Array, times: Array, timing: Timing) -> Track:
    """Return a column on the even grid, with its noise from the differences of what is in the file.

    values: [SI], (n_rows,). times: [s], (n_rows,).
    """
    irregular = times if timing.irregularity else None
    noise = noise_of(np.empty(0), values, timing.interval, irregular)
    return Track(moved_onto_grid(values, times, timing), noise.rms, quantisation_step(values))


def state_at(tracks: Mapping[str, Track], index: int) -> tuple[dict[str, float], dict[str, float]]:
    """Return constants (`start_position`, `start_speed`) and their standard deviations (SI) at one sample.

    A step of the sensor that no motion averages out is counted in full.
    """
    found = {name: smoothed(t.values, index, t.noise) for name, t in tracks.items()}
    deviations = {name: float(max(d, tracks[name].step / np.sqrt(12.0))) for name, (_, d) in found.items()}
    return {name: value for name, (value, _) in found.items()}, deviations


def smoothed(values: Array, index: int, noise: float) -> tuple[float, float]:
    """Return the value of a signal at one sample and its standard deviation, both in the unit of the signal.

    A polynomial of degree 1 or 2 is fitted to a window around the sample (at the ends of a record beside it), which
    grows from 5 to 400 samples until its squares are more than noise: sum r^2 > noise^2 (f + 3 sqrt(2 f)) with f
    degrees of freedom, or the same for what the next two degrees explain. The value is that of the polynomial with
    these two degrees more on the last window that held, so that its bias is small against its deviation. The window of
    the smallest deviation wins; a signal without noise is not smoothed.

    values: (n_samples,). noise: standard deviation of one sample, taken for white.
    Source of the higher degree: Calonico, Cattaneo, Titiunik 2014, doi:10.3982/ECTA11757.
    """
    best = float(values[index]), noise
    for degree in DEGREES:
        n = degree + HIGHER + 2
        while n <= min(values.size, LONGEST):
            low = min(max(index - (n - 1) // 2, 0), values.size - n)
            found = fitted(values[low : low + n], index - low, degree, noise)
            if found is None:
                break
            best = min(best, found, key=lambda pair: pair[1])
            n = int(n * GROWTH) + 1
    return best


def fitted(window: Array, place: int, degree: int, noise: float) -> tuple[float, float] | None:
    """Return value and standard deviation at one place of a window, None where it holds more than a polynomial."""

    def exceeds(squares: float, freedom: int) -> bool:
        return bool(squares > noise**2 * (freedom + CHANCE * np.sqrt(2.0 * freedom)))

    basis, mean = polynomials(window.size, degree + HIGHER), float(np.mean(window))
    centred = window - mean
    parts = basis.T @ centred
    inside, beyond = parts[: degree + 1], parts[degree + 1 :]
    left = float(centred @ centred - inside @ inside)
    if exceeds(left, window.size - degree - 1) or exceeds(float(beyond @ beyond), HIGHER):
        return None
    row = basis[place]
    return mean + float(row @ parts), noise * float(np.sqrt(row @ row))


@cache
def polynomials(n: int, degree: int) -> Array:
    """Return orthonormal polynomials on n even samples, lowest degree first, shape (n, degree + 1)."""
    places = np.linspace(-1.0, 1.0, n)
    return np.asarray(np.linalg.qr(np.vander(places, degree + 1, increasing=True))[0])
