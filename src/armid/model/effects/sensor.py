"""The sensor: what is recorded of the motion."""

import numpy as np

from armid.model.effect import Effect, State
from armid.model.parameter import Parameter


def gyro_lag_output(time_constant, lagging, omega):
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
    adds={"output": gyro_lag_output},
    states=(State("lagging", "speed", lagging_rate, settled), State("slope", "speed/s", slope_rate, level)),
    note="the recorded speed lags, second order",
    source="doi:10.1049/PBRA017E",
)


def gyro_bias_output(bias):
    """Speed that is recorded less the true one, constant."""
    return bias


gyro_bias = Effect(
    name="gyro_bias",
    parameters=(Parameter("bias", "speed", -0.05, 0.05, null=0.0, note="0.3 deg/s are 0.0052 rad/s"),),
    adds={"output": gyro_bias_output},
    note="constant error of the recorded speed",
    source="doi:10.1049/PBRA017E",
)


def gyro_scale_output(omega, error):
    """Speed that is recorded less the true one, error omega."""
    return error * omega


gyro_scale = Effect(
    name="gyro_scale",
    parameters=(Parameter("error", "1", -0.1, 0.1, null=0.0, note="relative error of the scale factor"),),
    adds={"output": gyro_scale_output},
    note="error of the recorded speed in proportion to it",
    source="doi:10.1049/PBRA017E",
)


# The recorded speed lags, first order: tau dw/dt = omega - w, w is recorded.
#
# Below 1 ms the filter stays at 1 ms and takes a share tau / 1 ms of the signal: the same delay, no stiff equation,
# and a derivative by tau at the null. Source: Doebelin, Measurement Systems, chapter 3 (first-order instruments).


def output_lag_output(time_constant, lagging, omega):
    """Speed that is recorded less the true one [speed]."""
    return time_constant / np.maximum(time_constant, 1e-3) * (lagging - omega)


def output_lag_lagging_rate(time_constant, lagging, omega):
    """Rate of the recorded signal, (omega - lagging) / time_constant."""
    return (omega - lagging) / np.maximum(time_constant, 1e-3)


def output_lag_settled(omega):
    """Return the speed: the instrument has settled."""
    return omega


output_lag = Effect(
    name="output_lag",
    parameters=(Parameter("time_constant", "s", 0.0, 0.05, null=0.0, note="of the instrument or its filter"),),
    adds={"output": output_lag_output},
    states=(State("lagging", "speed", output_lag_lagging_rate, output_lag_settled),),
    note="the recorded speed lags, first order",
    source="Doebelin, Measurement Systems, chapter 3",
)
