"""The sensor: what is recorded of the motion."""

import numpy as np

from armid.model.effect import Effect, State
from armid.model.effects.shared import slope_itself, start_speed, zero
from armid.model.parameter import Parameter


def lag_error(time_constant, lagging, omega):
    """Speed that an instrument reads less the true one [speed].

    Below 1 ms its filter stays at 1 ms and takes a share tau / 1 ms of the signal: the same delay, no stiff equation,
    and a derivative by tau at the null.
    """
    return time_constant / np.maximum(time_constant, 1e-3) * (lagging - omega)


def gyro_slope_rate(time_constant, damping_ratio, lagging, slope, omega):
    """Second derivative of the gyro's signal w, (omega - w - 2 zeta T dw/dt) / T^2."""
    t = np.maximum(time_constant, 1e-3)
    return (omega - lagging - 2 * damping_ratio * t * slope) / t**2


gyro_lag = Effect(
    name="gyro_lag", adds={"output": lag_error},
    states=(State("lagging", "speed", slope_itself, start_speed), State("slope", "speed/s", gyro_slope_rate, zero)),
    parameters=(
        Parameter("time_constant", "s", 0.0, 0.012, null=0.0, note="1/(2 pi bandwidth)"),
        Parameter("damping_ratio", "1", 0.4, 1.2, nominal=0.7, note="damping over critical damping"),
    ),
    note="the recorded speed lags, second order", source="doi:10.1049/PBRA017E",
)  # fmt: skip


def bias_error(bias):
    """Speed that is recorded less the true one, constant."""
    return bias


gyro_bias = Effect(
    name="gyro_bias", adds={"output": bias_error},
    parameters=(Parameter("bias", "speed", -0.05, 0.05, null=0.0, note="0.3 deg/s are 0.0052 rad/s"),),
    note="constant error of the recorded speed", source="doi:10.1049/PBRA017E",
)  # fmt: skip


def scale_error(omega, error):
    """Speed that is recorded less the true one, error omega."""
    return error * omega


gyro_scale = Effect(
    name="gyro_scale", adds={"output": scale_error},
    parameters=(Parameter("error", "1", -0.1, 0.1, null=0.0, note="relative error of the scale factor"),),
    note="error of the recorded speed in proportion to it", source="doi:10.1049/PBRA017E",
)  # fmt: skip


def lagging_rate(time_constant, lagging, omega):
    """Rate of the recorded signal, (omega - lagging) / time_constant."""
    return (omega - lagging) / np.maximum(time_constant, 1e-3)


output_lag = Effect(
    name="output_lag", adds={"output": lag_error}, states=(State("lagging", "speed", lagging_rate, start_speed),),
    parameters=(Parameter("time_constant", "s", 0.0, 0.05, null=0.0, note="of the instrument or its filter"),),
    note="the recorded speed lags, first order", source="Doebelin, Measurement Systems, chapter 3",
)  # fmt: skip

EFFECTS = (gyro_lag, gyro_bias, gyro_scale, output_lag)
