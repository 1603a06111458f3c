"""How the simulated arm moves through one manoeuvre."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stand.late import is_late, late_stage, notice
from stand.motion import Motion
from stand.stage import closed_stage, open_stage

FloatArray = npt.NDArray[np.float64]
SAMPLES_PER_SECOND = 1000
TOLERANCE = 1e-11


@dataclass(frozen=True)
class Trajectory:
    """Hold a manoeuvre sampled at 1 kHz from t = 0: time [s], the states by name, the speed the gyro shows [rad/s].

    `switch_s` is the instant at which the closed loop begins [s], or None when the arm does not get there.
    """

    time_s: FloatArray
    states: dict[str, FloatArray]
    gyro: FloatArray
    switch_s: float | None


def simulate(motion: Motion, duration_s: float, tolerance: float = TOLERANCE) -> Trajectory:
    """Integrate a manoeuvre from rest and sample it at 1 kHz; `tolerance` is relative and absolute.

    DOP853 runs to the switch E, the first instant at which abs(theta_D - theta) falls to delta_E, and starts again
    from there in closed loop; a stroke no longer than delta_E is in closed loop from the start.
    Raises RefusalError when the arm leaves its travel, or when the equations are too stiff or fail.
    """
    time = np.arange(round(duration_s * SAMPLES_PER_SECOND) + 1) / SAMPLES_PER_SECOND
    start = np.array(list(motion.start.values()))
    if abs(motion.manoeuvre.target - motion.manoeuvre.start) <= motion.arm.switch_distance:
        return _trajectory(motion, time, _closed_loop(motion, start, None, time, tolerance), 0.0)
    before = open_stage(motion, start, time, tolerance)
    if not before.t_events[0].size:
        return _trajectory(motion, time, before.y, None)
    switch, state = float(before.t_events[0][0]), before.y_events[0][0]
    begins = notice(motion, switch) if is_late(motion) else switch
    rest = time[before.y.shape[1] :]
    if not rest.size:
        return _trajectory(motion, time, before.y, begins)
    after = _closed_loop(motion, state, switch, rest, tolerance)
    return _trajectory(motion, time, np.hstack((before.y, after)), begins)


def _closed_loop(
    motion: Motion, state: FloatArray, switch: float | None, samples: FloatArray, tolerance: float
) -> FloatArray:
    """Integrate from the switch E, or from t = 0 where there is none, to the last sample."""
    if is_late(motion):
        return late_stage(motion, state, switch, samples, tolerance)
    return np.asarray(closed_stage(motion, state, switch or 0.0, samples, tolerance).y)


def _trajectory(motion: Motion, time: FloatArray, values: FloatArray, switch_s: float | None) -> Trajectory:
    """Name the states and read the gyro: its lagged speed, times 1 + scale error, plus bias."""
    states = dict(zip(motion.start, values, strict=True))
    effects = motion.effects
    seen = states.get("gyro", states["speed"])
    gyro = seen * (1.0 + effects.gyro_scale) + math.radians(effects.gyro_bias_deg_s)
    return Trajectory(time, states, gyro, switch_s)
