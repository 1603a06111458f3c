"""The sensor: what is recorded of the motion, of a speed at the port `output`, of other outputs at their own."""

from dataclasses import replace
from functools import partial
from inspect import signature

import numpy as np

from armid.model.effect import Delay, Effect, State, slope_itself, start_speed, zero
from armid.model.parameter import Parameter
from armid.model.plant import Output, Plant


def sensor_effects(plant: Plant) -> dict[str, Effect]:
    """Return name -> bias, scale, delay and lag (`hub_angle_bias`) of each output that has a port of its own.

    A speed, which is often counted, has a mean over a time as well (`hub_speed_average`).
    At `output` the library's own are added where `omega` is what is recorded. What the sensor sees is its signal
    without what is added at the port, where that is one state or quantity.
    """
    own = [o for o in plant.outputs if o.port and not (o.port == "output" and plant.records_omega)]
    effects = [e for o in own for e in effects_at(o, plant)]
    return {e.name: e for e in effects}


def effects_at(output: Output, plant: Plant) -> list[Effect]:
    name, port, scales = output.name, output.port, plant.scales
    length = scales.length_unit
    in_scales = {f"{length}/s": "speed", length: "speed*s", scales.effort_unit: "effort"}
    bias = Parameter("bias", in_scales.get(output.unit, output.unit), -0.1, 0.1, null=0.0)
    declared = partial(Effect, source="Doebelin, Measurement Systems, chapter 3")
    effects = [declared(f"{name}_bias", (bias,), {port: bias_error}, note=f"constant error of {name}")]
    asked = signature(plant.quantities[output.signal]).parameters if output.signal in plant.quantities else ()
    seen = [plant.aliases.get(a, a) for a in asked if a != port]
    if len(seen) != 1:
        return effects
    declared = partial(declared, binds={"omega": seen[0]})
    note = f"error of {name} in proportion to it"
    effects.append(declared(f"{name}_scale", gyro_scale.parameters, {port: scale_error}, note=note))
    effects.append(declared(f"{name}_delay", output_delay.parameters, {port: delay_error}, delays=output_delay.delays,
                            note=f"{name} is recorded late by a dead time"))  # fmt: skip
    states, note = (State("lagging", output.unit, lagging_rate, start_speed),), f"{name} lags, first order"
    effects.append(declared(f"{name}_lag", output_lag.parameters, {port: lag_error}, states, note=note))
    if output.unit == f"{length}/s":
        mean = replace(output_average, name=f"{name}_average", adds={port: average_error}, binds={"omega": seen[0]})
        effects.append(replace(mean, note=f"{name} is a mean over a time"))
    return effects


def lag_error(time_constant, lagging, omega):
    """Speed that an instrument reads less the true one [speed]; of a drive, the effort that acts less its own.

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


def constant_error(omega, bias):
    """Speed that is recorded less the true one, constant; it has a place only where `omega` is what is recorded."""
    return bias


gyro_bias = Effect(
    name="gyro_bias", adds={"output": constant_error},
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
    """Rate of the signal that lags, (omega - lagging) / time_constant."""
    return (omega - lagging) / np.maximum(time_constant, 1e-3)


output_lag = Effect(
    name="output_lag", adds={"output": lag_error}, states=(State("lagging", "speed", lagging_rate, start_speed),),
    parameters=(Parameter("time_constant", "s", 0.0, 0.05, null=0.0, note="of the instrument or its filter"),),
    note="the recorded speed lags, first order", source="Doebelin, Measurement Systems, chapter 3",
)  # fmt: skip


def delay_error(late, omega):
    """Speed that is recorded less the true one, w(t - T) - w(t): that of a dead time T ago; of a drive, its effort."""
    return late - omega


output_delay = Effect(
    name="output_delay", adds={"output": delay_error}, delays=(Delay("late", start_speed, "delay"),),
    parameters=(Parameter("delay", "s", 0.0, 0.1, null=0.0, note="dead time of the sensor or of its transmission"),),
    note="the recorded speed is late by a dead time", source="Doebelin, Measurement Systems, chapter 3",
)  # fmt: skip


# Below this window a part of the mean is taken, so that the null is the speed itself.
SHORTEST_WINDOW_S = 1e-6


def average_error(window, beyond, earlier, first, omega):
    """Mean speed of the last T less the present one, w(0) + (z(t) - z(t - T)) / T - w(t), dz/dt = w - w(0)."""
    return (beyond - earlier - window * (omega - first)) / np.maximum(window, SHORTEST_WINDOW_S)


def beyond_first(omega, first):
    """Rate of the way beyond that of the first speed, so that a machine in motion has a mean from the start."""
    return omega - first


def way_beyond(beyond):
    """Return the way beyond that of the first speed."""
    return beyond


output_average = Effect(
    name="output_average", adds={"output": average_error}, delays=(Delay("earlier", way_beyond, "window"),),
    states=(State("beyond", "speed*s", beyond_first, zero), State("first", "speed", zero, start_speed)),
    parameters=(Parameter("window", "s", 0.0, 0.2, null=0.0, note="over which counts or readings are taken"),),
    note="the recorded speed is a mean over a time", source="doi:10.1109/41.161471",
)  # fmt: skip

EFFECTS = (gyro_lag, gyro_bias, gyro_scale, output_lag, output_delay, output_average)
