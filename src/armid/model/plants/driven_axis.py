"""An axis with a measured drive: J dv/dt = gain x u - m g l sin q + ports.

Linear (a mass in kg, speed in m/s) or rotary (an inertia in kg m2, speed in rad/s); a record starts at its first
sample from the measured position and speed. Its scales stand for 1 until a campaign sets them from its train records.
"""

import numpy as np

from armid.model.effect import Equation, State
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


def linear_speed_rate(drive_effort, drive, gravity_effort, torque, mass):
    return (drive_effort + drive + gravity_effort + torque) / mass


def rotary_speed_rate(drive_effort, drive, gravity_effort, torque, inertia):
    return (drive_effort + drive + gravity_effort + torque) / inertia


def axis(
    inertia: Parameter, speed_rate: Equation, unit: str, effort_unit: str, variants: tuple[Plant, ...] = ()
) -> Plant:
    """Return the axis for one unit of its position, rad or m."""
    return Plant(
        name="driven_axis",
        note="axis with a measured drive, linear or rotary: J dv/dt = gain u - m g l sin q",
        parameters=(inertia,),
        states=(
            State("q", unit, lambda v: v, lambda start_position: start_position,
                  f"{'angle' if unit == 'rad' else 'position'}_{unit}"),
            State("v", f"{unit}/s", speed_rate, lambda start_speed: start_speed, f"speed_{unit}_s"),
        ),
        quantities={"drive_effort": drive_effort, "gravity_effort": gravity_effort, "recorded_speed": recorded_speed},
        constants=(
            Constant("gain", 1.0, "effort per unit of the drive column",
                     "1 when the drive is recorded as force or torque"),
            Constant("gravity_moment", 0.0, "N m", "m g l of a pendulum, 0 for a level axis"),
            Constant("start_position", 0.0, unit, "set from the record"),
            Constant("start_speed", 0.0, f"{unit}/s", "set from the record"),
        ),
        inputs=(Input("u", "V, N or N m", ("drive_V", "drive_N", "drive_N_m", "current_A")),),
        ports={"torque": effort_unit, "drive": effort_unit, "output": f"{unit}/s"},
        aliases={"omega": "v", "theta": "q", "speed": "v", "position": "q", "load_effort": "gravity_effort"},
        output="recorded_speed",
        output_unit=f"{unit}/s",
        scales=Scales(1.0, 1.0, effort_unit, unit),
        from_rest=False,
        scales_from_records=True,
        variants=variants,
    )  # fmt: skip


rotary_axis = axis(Parameter("inertia", "inertia", 0.001, 5.0, note="moving inertia"), rotary_speed_rate, "rad", "N m")
driven_axis = axis(Parameter("mass", "inertia", 0.001, 5.0, note="moving mass"), linear_speed_rate, "m", "N",
                   variants=(rotary_axis,))  # fmt: skip
