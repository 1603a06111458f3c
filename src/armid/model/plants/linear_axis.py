"""A carriage on a straight guide whose position, speed or both are recorded: M dv/dt = gain u - b v + ports.

Its scales stand for 1 until a campaign sets them from its train records.
"""

from armid.model.effect import State
from armid.model.parameter import Parameter, Scales
from armid.model.plant import Constant, Input, Output, Plant
from armid.model.plants.driven_axis import drive_effort, recorded_speed


def recorded_position(q, position_sensor):
    """Position that is recorded [m]."""
    return q + position_sensor


def speed_rate(drive_effort, drive, damping, v, torque, mass):
    return (drive_effort + drive - damping * v + torque) / mass


linear_axis = Plant(
    name="linear_axis",
    note="carriage on a straight guide, with an actuator: M dv/dt = gain u - b v",
    parameters=(
        Parameter("mass", "inertia", 0.001, 5.0, note="of carriage and actuator"),
        Parameter("damping", "effort/speed", 0.0, 3.0, note="viscous, of a motor its back EMF too"),
        Parameter("gain", "1", 0.0, 10.0, fixed=1.0, note="force per unit of the command"),
    ),
    states=(
        State("q", "m", lambda v: v, lambda start_position: start_position, "position_state_m"),
        State("v", "m/s", speed_rate, lambda start_speed: start_speed, "speed_state_m_s"),
    ),
    quantities={
        "drive_effort": drive_effort, "recorded_position": recorded_position, "recorded_speed": recorded_speed,
    },
    constants=(
        Constant("start_position", 0.0, "m", "set from the record"),
        Constant("start_speed", 0.0, "m/s", "set from the record"),
    ),
    inputs=(Input("u", "unit of the command", ("command", "drive_N", "drive_V", "current_A")),),
    ports={"torque": "N", "drive": "N", "position_sensor": "m", "output": "m/s"},
    aliases={"omega": "v", "theta": "q", "speed": "v", "position": "q"},
    outputs=(
        Output("position", "recorded_position", "m", port="position_sensor"),
        Output("velocity", "recorded_speed", "m/s", port="output"),
    ),
    scales=Scales(1.0, 1.0, "N", "m"),
    from_rest=False,
    scales_from_records=True,
)  # fmt: skip
