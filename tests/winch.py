"""A plug-in of a user: a winch on a DC motor, the voltage recorded; and its exact motion under a late held voltage."""

from itertools import pairwise

import numpy as np

from armid import Constant, Input, Parameter, Plant, Scales, State

OHMS, K_T, DRUM, FRICTION, INTERVAL = 1.4, 0.21, 3.2e-3, 2.5e-3, 0.004


winch = Plant(
    name="winch",
    parameters=(Parameter("drum", "kg m2", 5e-4, 2e-2, nominal=3e-3, note="inertia of drum and rotor"),),
    states=(State("w", "rad/s", lambda motor_torque, torque, drum: (motor_torque + torque) / drum,
                  lambda start_speed: start_speed, "shaft_speed_rad_s"),),
    quantities={"motor_torque": lambda volts, winding, k_t, w, ohms: k_t * (volts + winding - k_t * w) / ohms,
                "recorded_speed": lambda w, output: w + output},
    constants=(
        Constant("ohms", OHMS, "ohm", "data sheet", tolerance=0.0),
        Constant("k_t", K_T, "N m/A", "data sheet", tolerance=0.0),
        Constant("start_speed", 0.0, "rad/s", "set from the record"),
    ),
    inputs=(Input("volts", "V", ("volts_V",), hold="zero", typical=(-24.0, 24.0)),),
    ports={"torque": "N m", "winding": "V", "output": "rad/s"}, aliases={"omega": "w"}, output="recorded_speed",
    output_unit="rad/s", scales=Scales(effort=3.0, speed=80.0), from_rest=False,
)  # fmt: skip


def held_voltage(rng, n_levels=24):
    """Voltage with steps at samples, at rest at first [V]."""
    return np.concatenate([np.zeros(40), np.repeat(rng.choice([-20.0, -6.0, 6.0, 20.0], n_levels), 30)])


def exact_speed(volts, delay, times=None):
    """Speed of the drum at the samples [rad/s]: the exact solution between the jumps of the late voltage.

    times: of the samples, at which the voltage jumps [s]; None: even ones from 0.
    """
    times = INTERVAL * np.arange(len(volts)) if times is None else times
    rate, gain = -(FRICTION + K_T**2 / OHMS) / DRUM, K_T / OHMS / DRUM
    jumps = times[1:] + delay
    w = np.zeros(len(volts))
    for k in range(len(volts) - 1):
        begin, end = times[k], times[k + 1]
        inside = jumps[np.searchsorted(jumps, begin, "right") : np.searchsorted(jumps, end, "left")]
        edges = np.concatenate([[begin], inside, [end]])
        w[k + 1] = w[k]
        for a, b in pairwise(edges):
            grown = np.exp(rate * (b - a))
            level = volts[np.searchsorted(jumps, 0.5 * (a + b))]
            w[k + 1] = w[k + 1] * grown + gain * level * (grown - 1.0) / rate
    return w
