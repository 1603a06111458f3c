"""A boom on a geared motor, with its position controller: a plant written outside of armid."""

import numpy as np

from armid import Constant, Guard, Input, Parameter, Plant, Scales, State


def demand(kp, kd, target, q, v):
    """Voltage that the controller asks for [V]: proportional to the error of position, less a share of the speed."""
    return kp * (target - q) - kd * v


def voltage(demand, supply):
    """Voltage at the motor [V]: no more than the supply has at this moment."""
    return np.minimum(np.maximum(demand, -supply), supply)


def current(voltage, winding, motor_constant, v, resistance, drive_on):
    """Current of the motor [A]; none while the drive is switched off. Effects add to the voltage at `winding`."""
    return drive_on * (voltage + winding - motor_constant * v) / resistance


def drive_effort(motor_constant, current):
    """Torque of the motor behind its gear [N m]."""
    return motor_constant * current


def gravity_effort(boom_moment, q):
    """Torque of gravity [N m]; at q = 0 the boom hangs."""
    return -boom_moment * np.sin(q)


def recorded_speed(v, output):
    """Speed as recorded [rad/s]; what effects add at the port `output` comes on top."""
    return v + output


def position_rate(v):
    """Rate of the position [rad/s]."""
    return v


def speed_rate(drive_effort, drive, gravity_effort, torque, inertia):
    """Acceleration [rad/s2]; what effects add at the ports `drive` and `torque` comes on top."""
    return (drive_effort + drive + gravity_effort + torque) / inertia


def first_position(start_position):
    """Position at the first sample [rad]."""
    return start_position


def first_speed(start_speed):
    """Speed at the first sample [rad/s]."""
    return start_speed


def to_upper_limit(demand, supply):
    """Change its sign where the voltage comes to its upper limit [V]."""
    return demand - supply


def to_lower_limit(demand, supply):
    """Change its sign where the voltage comes to its lower limit [V]."""
    return demand + supply


boom = Plant(
    name="boom",
    note="boom on a geared DC motor under a known position controller",
    parameters=(
        Parameter("inertia", "kg m2", 0.2, 2.0, nominal=0.7, note="of boom, gear and rotor, at the boom"),
        Parameter("motor_constant", "N m/A", 0.8, 2.5, nominal=1.5, note="behind the gear; also in V s/rad"),
        Parameter("boom_moment", "N m", 1.0, 8.0, nominal=3.5, note="weight times its distance from the axis"),
    ),
    states=(
        State("q", "rad", position_rate, first_position, "angle_rad"),
        State("v", "rad/s", speed_rate, first_speed, "shaft_speed_rad_s"),
    ),
    quantities={f.__name__: f for f in (demand, voltage, current, drive_effort, gravity_effort, recorded_speed)},
    constants=(
        Constant("kp", 60.0, "V/rad", "of the controller; differs between the records"),
        Constant("kd", 2.0, "V s/rad", "of the controller; differs between the records"),
        Constant("resistance", 2.0, "ohm", "of winding and leads, measured at standstill"),
        Constant("start_position", 0.0, "rad", "set from the record"),
        Constant("start_speed", 0.0, "rad/s", "set from the record"),
    ),
    inputs=(
        Input("target", "rad", ("target_deg",), typical=(-1.0, 1.0)),
        Input("supply", "V", ("supply_V",), typical=(20.0, 24.0)),
        Input("drive_on", "1", ("drive_on",), required=False, default=1.0, hold="zero", typical=(0.0, 1.0)),
    ),
    ports={"torque": "N m", "drive": "N m", "winding": "V", "output": "rad/s"},
    guards=(Guard("upper_limit", to_upper_limit), Guard("lower_limit", to_lower_limit)),
    aliases={"omega": "v", "theta": "q", "load_effort": "gravity_effort"},
    output="recorded_speed",
    output_unit="rad/s",
    scales=Scales(effort=15.0, speed=4.0),
    from_rest=False,
)  # fmt: skip
