"""The plant `my_plant`: the declared equations of a machine, here a pendulum on a motor whose current is measured.

    armid check my_plant.py:my_plant
    armid identify CAMPAIGN --plugin my_plant.py:my_plant

CAMPAIGN is a folder whose campaign.toml says plant = "my_plant", with CSV files of the columns time_s,
angular_velocity_rad_s, angle_rad and current_A. studies/your_own_machine of armid explains a larger plant line by line.
"""

import numpy as np

from armid import Constant, Input, Parameter, Plant, Scales, State


# An equation is a plain function of numbers; its argument names say what it gets: parameters, states, constants,
# inputs, ports and other quantities, each under the name that is declared below. Everything is SI.
def drive_effort(motor_constant, current):
    """Torque of the motor [N m]."""
    return motor_constant * current


def gravity_effort(gravity_moment, q):
    """Torque of gravity [N m]; at q = 0 the pendulum hangs."""
    return -gravity_moment * np.sin(q)


def recorded_speed(v, output):
    """Speed as recorded [rad/s]; `output` is a port: the sum of what effects add there, 0 without any."""
    return v + output


def position_rate(v):
    """Rate of the angle [rad/s]."""
    return v


def speed_rate(drive_effort, drive, gravity_effort, torque, inertia):
    """Acceleration [rad/s2]; `drive` and `torque` are ports."""
    return (drive_effort + drive + gravity_effort + torque) / inertia


def first_position(start_position):
    """Angle at the first sample [rad]."""
    return start_position


def first_speed(start_speed):
    """Speed at the first sample [rad/s]."""
    return start_speed


my_plant = Plant(
    name="my_plant",
    note="pendulum on a motor whose current is measured",
    # What is searched: name, unit, bounds. nominal is what `armid simulate` takes when nothing is set.
    parameters=(
        Parameter("inertia", "kg m2", 0.02, 0.5, nominal=0.1, note="of pendulum and rotor about the axis"),
        Parameter("motor_constant", "N m/A", 0.1, 1.0, nominal=0.4, note="torque per current, behind the gear"),
        Parameter("gravity_moment", "N m", 0.5, 5.0, nominal=2.0, note="weight times its distance from the axis"),
    ),
    # What is integrated: name, unit, its rate, its value at the start, its column in what `armid simulate` writes.
    states=(
        State("q", "rad", position_rate, first_position, "angle_rad"),
        State("v", "rad/s", speed_rate, first_speed, "shaft_speed_rad_s"),
    ),
    quantities={"drive_effort": drive_effort, "gravity_effort": gravity_effort, "recorded_speed": recorded_speed},
    # What is known. start_position and start_speed come from the columns of a record, as from_rest is False.
    constants=(
        Constant("start_position", 0.0, "rad", "set from the record"),
        Constant("start_speed", 0.0, "rad/s", "set from the record"),
    ),
    # Measured columns that drive it, taken in the unit of the column. Straight between samples; hold="zero" keeps the
    # last value, as a switch does. required=False, default=0.0: a record may lack the column. typical: the range in
    # which `armid check` moves it.
    inputs=(Input("current", "A", ("current_A",), typical=(-4.0, 4.0)),),
    # Where effects can add something: without ports nothing can be found missing.
    ports={"torque": "N m", "drive": "N m", "output": "rad/s"},
    # What the effects of armid call it.
    aliases={"omega": "v", "theta": "q", "load_effort": "gravity_effort"},
    # What the speed column recorded.
    output="recorded_speed",
    output_unit="rad/s",
    # Typical largest torque [N m] and speed [rad/s]: effects give their bounds as multiples of them.
    scales=Scales(effort=2.0, speed=5.0),
    from_rest=False,
)
