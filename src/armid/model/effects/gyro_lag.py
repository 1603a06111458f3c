"""The gyro is a second-order low-pass: T^2 d2w/dt2 + 2 zeta T dw/dt + w = omega; 40 Hz are T = 1/(2 pi 40 Hz) = 4 ms.

Below 1 ms the filter stays at 1 ms and takes a share T / 1 ms of the signal: the same delay, no stiff equation, and a
derivative by T at the null. Source: Titterton, Weston, Strapdown Inertial Navigation Technology, doi:10.1049/PBRA017E.
"""

import numpy as np

from armid.model.effect import Effect, State
from armid.model.parameter import Parameter


def output(time_constant, lagging, omega):
    """Speed that the gyro tells less the true one [speed]."""
    return time_constant / np.maximum(time_constant, 1e-3) * (lagging - omega)


def lagging_rate(slope):
    """Rate of the gyro's signal."""
    return slope


def slope_rate(time_constant, damping_ratio, lagging, slope, omega):
    """Second derivative of the gyro's signal w, (omega - w - 2 zeta T dw/dt) / T^2."""
    t = np.maximum(time_constant, 1e-3)
    return (omega - lagging - 2 * damping_ratio * t * slope) / t**2


def settled(omega):
    """Return the speed: the gyro has settled."""
    return omega


def level():
    """Return 0: nothing accelerates before the start."""
    return 0.0


gyro_lag = Effect(
    name="gyro_lag",
    parameters=(
        Parameter("time_constant", "s", 0.0, 0.012, null=0.0, note="1/(2 pi bandwidth)"),
        Parameter("damping_ratio", "1", 0.4, 1.2, nominal=0.7, note="damping over critical damping"),
    ),
    adds={"output": output},
    states=(State("lagging", "speed", lagging_rate, settled), State("slope", "speed/s", slope_rate, level)),
    note="the recorded speed lags, second order",
    source="doi:10.1049/PBRA017E",
)
