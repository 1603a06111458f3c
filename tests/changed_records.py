"""Records as they were not made: with another noise, other samples, a fault that is undone."""

from dataclasses import replace


def with_noise(record, **changes):
    """Return a record whose sensors have another noise."""
    return record.with_signals(lambda signal: replace(signal, noise=replace(signal.noise, **changes)))


def noisy(replay, **changes):
    """Return a replay of a record with another noise."""
    return replay.changed(record=with_noise(replay.ready.record, **changes))


def trimmed(fault, record, value, plant, output=""):
    """Return a record without a fault, and without the samples that were not measured at their new time."""
    there, (first, last) = fault.undone(record, value, plant, output), fault.lost(record, value)
    ends = [(first - p.start_index, record.measured.size - last - p.start_index) for p in there.pieces]
    windows = [slice(max(p.window.start, low), min(p.window.stop, high))
               for p, (low, high) in zip(there.pieces, ends, strict=True)]  # fmt: skip
    return replace(there, pieces=tuple(replace(p, window=w) for p, w in zip(there.pieces, windows, strict=True)
                                       if w.start < w.stop))  # fmt: skip
