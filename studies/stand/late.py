"""The closed loop of a controller that is late: delayed signals, or a command held between samples."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from stand.motion import Motion
from stand.stage import Signal, closed_piece, open_piece

FloatArray = npt.NDArray[np.float64]


def is_late(motion: Motion) -> bool:
    """Tell whether the controller acts on an earlier state than the present one."""
    return bool(motion.effects.controller_delay or motion.effects.controller_period)


def notice(motion: Motion, switch: float) -> float:
    """Give the time [s] at which the controller learns of the switch E: a delay after it, or at its next sample."""
    period = motion.effects.controller_period
    return math.ceil(switch / period) * period if period else switch + motion.effects.controller_delay


def late_stage(
    motion: Motion, state: FloatArray, switch: float | None, samples: FloatArray, tolerance: float
) -> FloatArray:
    """Integrate from the switch E [s] to the last sample, each sample a column; None starts in closed loop at t = 0.

    The delay is that of a delay line and not an approximation: by the method of steps each piece is no longer than
    the delay, so that all the controller sees in it lies in the piece before, and every kink falls between pieces.
    """
    pieces = _Pieces(samples)
    begin, seen = 0.0, _held(state)
    if switch is not None:
        begin = min(notice(motion, switch), float(samples[-1]))
        if begin > switch:
            found = open_piece(motion, state, (switch, begin), tolerance)
            state, seen = pieces.add(found), found.sol
    length = motion.effects.controller_delay or motion.effects.controller_period
    count = 0
    while pieces.missing:
        span = (begin + count * length, min(begin + (count + 1) * length, float(samples[-1])))
        known = _held(state) if motion.effects.controller_period else _delayed(seen, length)
        found = closed_piece(motion, state, span, tolerance, known)
        state, seen, count = pieces.add(found), found.sol, count + 1
    return np.hstack(pieces.columns)


def _held(state: FloatArray) -> Signal:
    return lambda _time: state


def _delayed(seen: Callable[[float], FloatArray], delay: float) -> Signal:
    return lambda time: seen(time - delay)


class _Pieces:
    """Collect the samples of one piece after the other."""

    def __init__(self, samples: FloatArray) -> None:
        self.samples, self.count = samples, 0
        self.columns: list[FloatArray] = []

    @property
    def missing(self) -> bool:
        """Tell whether samples are still to come."""
        return self.count < self.samples.size

    def add(self, found: Any) -> FloatArray:
        """Take the samples that a piece reaches and give its last state."""
        reached = int(np.searchsorted(self.samples, found.t[-1], side="right"))
        if reached > self.count:
            self.columns.append(found.sol(self.samples[self.count : reached]))
            self.count = reached
        return np.asarray(found.y[:, -1])
