"""An axis with a measured drive: J dv/dt = gain x u - m g l sin q + ports.

Linear (a mass in kg, speed in m/s) or rotary (an inertia in kg m2, speed in rad/s); a record starts at its first
sample from the measured position and speed. Its scales stand for 1 until a campaign sets them from its train records.
"""

from dataclasses import replace

import numpy as np

from armid.model.effect import State
from armid.model.parameter import Parameter, Scales
from armid.model.plant import Constant, Input, Plant


def drive_effort(gain, u):
    """Effort of the drive as measured [N or N m]."""
    return gain * u


def gravity_effort(gravity_moment, q):
    """Effort of gravity, q = 0 hanging [N or N m]."""
    return -gravity_moment * np.sin(q)


def recorded_speed(v, output):
    """Speed that is recorded [m/s or rad/s]."""
    return v + output


def position_rate(v):
    return v


def first_position(start_position):
    return start_position


def linear_speed_rate(drive_effort, drive, gravity_effort, torque, mass):
    return (drive_effort + drive + gravity_effort + torque) / mass


def rotary_speed_rate(drive_effort, drive, gravity_effort, torque, inertia):
    return (drive_effort + drive + gravity_effort + torque) / inertia


def first_speed(start_speed):
    return start_speed


linear_axis = Plant(
    name="driven_axis",
    note="axis with a measured drive, linear or rotary: J dv/dt = gain u - m g l sin q",
    parameters=(Parameter("mass", "inertia", 0.001, 5.0, note="moving mass"),),
    states=(
        State("q", "m", position_rate, first_position, "position_m"),
        State("v", "m/s", linear_speed_rate, first_speed, "speed_m_s"),
    ),
    quantities={"drive_effort": drive_effort, "gravity_effort": gravity_effort, "recorded_speed": recorded_speed},
    constants=(
        Constant("gain", 1.0, "effort per unit of the drive column", "1 when the drive is recorded as force or torque"),
        Constant("gravity_moment", 0.0, "N m", "m g l of a pendulum, 0 for a level axis"),
        Constant("start_position", 0.0, "m", "set from the record"),
        Constant("start_speed", 0.0, "m/s", "set from the record"),
    ),
    inputs=(Input("u", "V, N or N m", ("drive_V", "drive_N", "drive_N_m", "current_A")),),
    ports={"torque": "N", "drive": "N", "output": "m/s"},
    aliases={"omega": "v", "theta": "q", "speed": "v", "position": "q", "load_effort": "gravity_effort"},
    output="recorded_speed",
    output_unit="m/s",
    scales=Scales(effort=1.0, speed=1.0, effort_unit="N", length_unit="m"),
    from_rest=False,
    scales_from_records=True,
)

rotary_axis = replace(
    linear_axis,
    parameters=(Parameter("inertia", "inertia", 0.001, 5.0, note="moving inertia"),),
    states=(
        State("q", "rad", position_rate, first_position, "angle_rad"),
        State("v", "rad/s", rotary_speed_rate, first_speed, "speed_rad_s"),
    ),
    constants=(
        *linear_axis.constants[:2],
        Constant("start_position", 0.0, "rad", "set from the record"),
        Constant("start_speed", 0.0, "rad/s", "set from the record"),
    ),
    ports={"torque": "N m", "drive": "N m", "output": "rad/s"},
    output_unit="rad/s",
    scales=Scales(effort=1.0, speed=1.0),
)

driven_axis = replace(linear_axis, variants=(rotary_axis,))
