"""How the simulated arm moves through one manoeuvre."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from stand.motion import Motion
from stand.refusal import RefusalError

FloatArray = npt.NDArray[np.float64]
SAMPLES_PER_SECOND = 1000
TOLERANCE = 1e-11
MOST_RATES = 300_000
"""Evaluations of the equations that a stage may take; a usual one takes some 10,000."""


@dataclass(frozen=True)
class Trajectory:
    """Hold a manoeuvre sampled at 1 kHz from t = 0: time [s], the states by name, the speed the gyro shows [rad/s].

    `switch_s` is the instant of E [s], or None when the arm does not get there.
    """

    time_s: FloatArray
    states: dict[str, FloatArray]
    gyro: FloatArray
    switch_s: float | None


def simulate(motion: Motion, duration_s: float) -> Trajectory:
    """Integrate a manoeuvre from rest and sample it at 1 kHz.

    DOP853 runs to the switch E, the first instant at which abs(theta_D - theta) falls to delta_E, and starts again
    from there in closed loop; a stroke no longer than delta_E is in closed loop from the start.
    Raises RefusalError when the arm leaves its travel, or when the equations are too stiff or fail.
    """
    time = np.arange(round(duration_s * SAMPLES_PER_SECOND) + 1) / SAMPLES_PER_SECOND
    start = np.array(list(motion.start.values()))
    if abs(motion.manoeuvre.target - motion.manoeuvre.start) <= motion.arm.switch_distance:
        return _trajectory(motion, time, _stage(motion, start, 0.0, time, closed_loop=True).y, 0.0)
    before = _stage(motion, start, 0.0, time, closed_loop=False)
    if not before.t_events[0].size:
        return _trajectory(motion, time, before.y, None)
    switch, state = float(before.t_events[0][0]), before.y_events[0][0]
    rest = time[before.y.shape[1] :]
    if not rest.size:
        return _trajectory(motion, time, before.y, switch)
    after = _stage(motion, state, switch, rest, closed_loop=True)
    return _trajectory(motion, time, np.hstack((before.y, after.y)), switch)


def _stage(motion: Motion, state: FloatArray, begin: float, samples: FloatArray, *, closed_loop: bool) -> Any:
    """Integrate one stage from `begin` [s]; the first event is E, which ends the open loop, the second the travel."""
    count = itertools.count()

    def rates(_time: float, values: FloatArray) -> list[float]:
        if next(count) > MOST_RATES:
            raise RefusalError(f"{motion.manoeuvre.name} is too stiff to integrate: an effect is too fast or too large")
        return motion.rates(values, closed_loop)

    events = [_ending(_to_switch(motion), not closed_loop), _ending(_to_stops(motion), True)]
    span = (begin, float(samples[-1]))
    found: Any = solve_ivp(
        rates, span, state, method="DOP853", t_eval=samples, events=events, rtol=TOLERANCE, atol=TOLERANCE
    )
    if found.t_events[1].size:
        where = f"at {found.t_events[1][0]:.3f} s, and the stand has no end stops"
        raise RefusalError(f"{motion.manoeuvre.name} would leave the travel of -55 to 45 deg {where}")
    if not found.success or not np.isfinite(found.y).all():
        raise RefusalError(f"{motion.manoeuvre.name} cannot be integrated with these values: {found.message}")
    return found


def _to_switch(motion: Motion) -> Callable[[FloatArray], float]:
    """Give the distance to E [rad]: abs(theta_D - theta) - delta_E."""
    target, distance = motion.manoeuvre.target, motion.arm.switch_distance
    return lambda values: abs(target - float(values[0])) - distance


def _to_stops(motion: Motion) -> Callable[[FloatArray], float]:
    """Give the distance to the nearer end of the travel [rad]."""
    low, high = motion.arm.travel
    return lambda values: min(float(values[0]) - low, high - float(values[0]))


def _ending(distance: Callable[[FloatArray], float], terminal: bool) -> Any:
    """Make an event of scipy where a distance falls to 0."""

    def event(_time: float, values: FloatArray) -> float:
        return distance(values)

    event.terminal = terminal  # type: ignore[attr-defined]
    event.direction = -1.0  # type: ignore[attr-defined]
    return event


def _trajectory(motion: Motion, time: FloatArray, values: FloatArray, switch_s: float | None) -> Trajectory:
    """Name the states and read the gyro: its lagged speed, times 1 + scale error, plus bias."""
    states = dict(zip(motion.start, values, strict=True))
    effects = motion.effects
    seen = states.get("gyro", states["speed"])
    gyro = seen * (1.0 + effects.gyro_scale) + math.radians(effects.gyro_bias_deg_s)
    return Trajectory(time, states, gyro, switch_s)
