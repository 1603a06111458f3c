"""Pieces of a record: where a simulation starts, from which state, and which samples count."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armid.model import ArmidError, Manoeuvre
from armid.record.record import Piece, Record
from armid.record.start import Track, state_at
from armid.record.timing import FEWEST_SAMPLES

Array = NDArray[np.float64]
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


def part(manoeuvre: Manoeuvre, measured: Array, start: int, length: int, tracks: Mapping[str, Track]) -> Piece:
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


def restarted(manoeuvre: Manoeuvre, measured: Array, tracks: Mapping[str, Track], length: int) -> tuple[Piece, ...]:
    """Return pieces of `length` samples, each from the measured state; an incomplete last one is dropped."""
    starts = range(0, measured.size - length + 1, length)
    return tuple(part(manoeuvre, measured, s, length, tracks) for s in starts)


def window_samples(record: Record, window_s: Sequence[float] | None, where: str) -> tuple[int, int]:
    """Return first and one past the last sample of a window [s], both of its ends included.

    Raises ArmidError for a window that is empty, runs backward, or holds fewer than 20 samples of the record.
    """
    n_samples, grid = record.measured.size, record.manoeuvre
    if window_s is None:
        low, high = record.earliest, n_samples
    else:
        begin, end = window_s
        if not begin < end:
            raise ArmidError(f"{where}: window_s is [{begin:g}, {end:g}], an end after its beginning is expected")
        ends = (np.array([begin, end]) - grid.start_time) / grid.interval
        ends = np.clip(ends, -1.0, n_samples)
        low = max(int(np.ceil(ends[0] - SLACK)), record.earliest)
        high = min(int(np.floor(ends[1] + SLACK)) + 1, n_samples)
    if high - low < FEWEST_SAMPLES:
        raise ArmidError(f"{where}: the window holds {max(high - low, 0)} samples of {record.file}, at least "
                         f"{FEWEST_SAMPLES} are expected")  # fmt: skip
    return low, high


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


def is_constant(speed: Array) -> bool:
    """Tell whether a signal never changes."""
    return bool(np.ptp(speed) < 1e-30)
