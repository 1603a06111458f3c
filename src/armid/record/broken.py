"""Samples of a record that are no data: gaps that were bridged, clipped stretches, repeated samples, spikes."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armid.record.record import Record

Mask = NDArray[np.bool_]
# So many equal samples in a row are no chance where the noise exceeds half a step of the values; so many lie on one
# straight line only where a gap was bridged; a sensor at its limit shows as many in all.
REPEATED, BRIDGED, CLIPPED = 8, 4, 8
# A sample that is so many times the noise away from the median of its four neighbours, this many times what nearly all
# samples of the record are, and so many times what the closest three of the neighbours span: a step spans them.
ABOVE_NOISE, ABOVE_OTHERS, USUAL, ABOVE_SPAN = 10.0, 6.0, 0.95, 3.0
# An input that changes in one sample by so many times what it usually does, and by so much of its range, makes a signal
# jump too (a current, say); so many samples from there on are no spikes.
SUDDEN, SUDDEN_SHARE, AFTER_SUDDEN = 6.0, 0.05, 4
# Rounding of a value, relative to the largest.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Broken:
    """Samples of one kind: "gap", "clipped", "stuck" or "spikes"; samples: (n_samples,), True where it is broken."""

    kind: str
    samples: Mask
    from_s: float
    to_s: float

    @property
    def count(self) -> int:
        return int(self.samples.sum())


def broken_samples(record: Record) -> tuple[Broken, ...]:
    """Return the broken samples of a record by kind, whatever the model says; one sample is of one kind."""
    found, taken = [], np.zeros(record.measured.size, dtype=np.bool_)
    for kind, samples in kinds_of(record):
        own = samples & ~taken
        if own.any():
            taken |= own
            times = record.times[own]
            found.append(Broken(kind, own, float(times[0]), float(times[-1])))
    return tuple(found)


def sound_samples(record: Record) -> Mask:
    """Return which samples of a record are data, (n_samples,)."""
    sound = np.ones(record.measured.size, dtype=np.bool_)
    for _, samples in kinds_of(record):
        sound &= ~samples
    return sound


def kinds_of(record: Record) -> Iterator[tuple[str, Mask]]:
    signal, noise = record.measured, record.noise.rms
    rounding = ROUNDING * max(float(np.abs(signal).max()), 1e-300)
    level = np.abs(np.diff(signal)) <= rounding
    if record.irregularity is not None:
        straight = np.abs(np.diff(signal, 2)) <= rounding
        bridged = in_runs(np.concatenate([[False], straight, [False]]), BRIDGED - 2, 1)
        yield "gap", bridged & ~in_runs(np.append(level, False), REPEATED, 0)
    steps = np.unique(np.abs(np.diff(signal)))
    smallest = float(steps[steps > rounding].min(initial=np.inf))
    # A quiet sensor of coarse steps repeats itself.
    if noise > 0.5 * smallest:
        equal = in_runs(np.append(level, False), REPEATED - 1, 0)
        equal = equal | np.append(False, equal[:-1] & level)
        # A sensor that tells a standstill by an exact 0 is not stuck.
        equal &= signal != 0.0
        for end in (signal.max(), signal.min()):
            at_end = np.abs(signal - end) <= rounding
            if int(at_end.sum()) >= CLIPPED and (at_end & equal).any():
                yield "clipped", at_end
        yield "stuck", equal
    # beyond its ends a signal goes on as it comes in
    padded = np.pad(signal, 2, mode="reflect", reflect_type="odd")
    sides = np.sort(np.stack([padded[i : i + signal.size] for i in (0, 1, 3, 4)]), axis=0)
    away = np.abs(signal - 0.5 * (sides[1] + sides[2]))
    span = np.minimum(sides[2] - sides[0], sides[3] - sides[1])
    usual = max(ABOVE_NOISE * noise, ABOVE_OTHERS * float(np.quantile(away, USUAL)))
    yield "spikes", (away > np.maximum(usual, ABOVE_SPAN * span)) & ~after_sudden_input(record)


def after_sudden_input(record: Record) -> Mask:
    """Return the samples at which an input has just jumped."""
    found = np.zeros(record.measured.size, dtype=np.bool_)
    for values in record.manoeuvre.inputs.values():
        change = np.abs(np.diff(values))
        least = max(SUDDEN * float(np.quantile(change, USUAL)), SUDDEN_SHARE * float(np.ptp(values)))
        for place in np.flatnonzero(change > least):
            found[place : place + AFTER_SUDDEN] = True
    return found


def in_runs(true: Mask, shortest: int, wider: int) -> Mask:
    """Return the runs of a mask that are so long or longer, each wider by so many samples on either side."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(np.int8)))
    found = np.zeros(true.size, dtype=np.bool_)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if end - begin >= shortest:
            found[max(begin - wider, 0) : end + wider] = True
    return found
