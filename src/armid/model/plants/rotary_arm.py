"""An arm that turns about a level axis, driven by an actuator whose law is a function.

J dv/dt = law(u) - m g l sin q - b v + ports. Its scales stand for 1 until a campaign sets them from its train records.
"""

from dataclasses import replace

from armid.model.effect import Equation, State
from armid.model.parameter import Parameter, Scales
from armid.model.plant import Constant, Input, Output, Plant
from armid.model.plants.driven_axis import drive_effort, gravity_effort, recorded_speed


def propeller_effort(gain, u):
    """Torque of a propeller at the end of the arm [N m], its thrust with the square of the command."""
    return gain * u**2


def recorded_angle(q, angle_sensor):
    """Angle that is recorded [rad]."""
    return q + angle_sensor


def speed_rate(drive_effort, drive, gravity_effort, damping, v, torque, inertia):
    return (drive_effort + drive + gravity_effort - damping * v + torque) / inertia


rotary_arm = Plant(
    name="rotary_arm",
    note="arm on a level axis, q = 0 hanging, with an actuator: J dv/dt = gain u - m g l sin q - b v",
    parameters=(
        Parameter("inertia", "inertia", 0.001, 5.0, note="of arm and actuator"),
        Parameter("gravity_moment", "effort", 0.0, 5.0, note="m g l"),
        Parameter("damping", "effort/speed", 0.0, 3.0, note="viscous, of a motor its back EMF too"),
        Parameter("gain", "1", 0.0, 10.0, fixed=1.0, note="torque per unit of the command, as the actuator's law says"),
    ),
    states=(
        State("q", "rad", lambda v: v, lambda start_angle: start_angle, "angle_state_rad"),
        State("v", "rad/s", speed_rate, lambda start_speed: start_speed, "speed_state_rad_s"),
    ),
    quantities={
        "drive_effort": drive_effort, "gravity_effort": gravity_effort, "recorded_angle": recorded_angle,
        "recorded_speed": recorded_speed,
    },
    constants=(
        Constant("start_angle", 0.0, "rad", "set from the record"),
        Constant("start_speed", 0.0, "rad/s", "set from the record"),
    ),
    inputs=(Input("u", "unit of the command", ("command", "drive_N_m", "drive_V", "current_A")),),
    ports={"torque": "N m", "drive": "N m", "angle_sensor": "rad", "output": "rad/s"},
    aliases={"omega": "v", "theta": "q", "speed": "v", "position": "q", "load_effort": "gravity_effort"},
    outputs=(
        Output("angle", "recorded_angle", "rad", port="angle_sensor"),
        Output("angular_velocity", "recorded_speed", "rad/s", port="output"),
    ),
    scales=Scales(effort=1.0, speed=1.0),
    from_rest=False,
    scales_from_records=True,
)  # fmt: skip


def driven_by(law: Equation, name: str = "rotary_arm", **changes: object) -> Plant:
    """Return the rotary arm with another actuator.

    law: function of parameters, constants, states and the input `u` that gives the torque [N m], as `propeller_effort`.
    name: of the plant. changes: fields of Plant that are others than the rotary arm's.
    """
    return replace(rotary_arm, name=name, quantities={**rotary_arm.quantities, "drive_effort": law}, **changes)  # type: ignore[arg-type]
