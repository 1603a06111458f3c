"""The plants of the eight machines, plain and without any undeclared effect.

    armid close-loop CAMPAIGN --plugin studies/machines/plants.py:NAME

The simulator never reads this file. Sources of the equations: `source` of each machine in catalogue.py.
"""

import numpy as np

from armid import Constant, Guard, Input, Output, Parameter, Plant, Scales, State
from armid.model.effect import zero
from armid.model.plants.driven_axis import gravity_effort, recorded_speed, rotary_speed_rate
from armid.model.plants.flexible_link import CONTACTS
from armid.model.plants.rotary_arm import recorded_angle

G = 9.81


def current(voltage, winding, motor_constant, v, resistance):
    """Current of the motor [A]; effects add to the voltage at `winding`."""
    return (voltage + winding - motor_constant * v) / resistance


def motor_voltage(duty, supply):
    """Mean voltage of the bridge [V]."""
    return duty * supply


def wanted_duty(kp, goal, q):
    """Duty that the position controller asks for [1]."""
    return kp * (goal - q)


def servo_voltage(wanted_duty, supply):
    """Voltage at the motor [V], the duty limited to 1."""
    return np.minimum(np.maximum(wanted_duty, -1.0), 1.0) * supply


def cart_voltage(kp, target, q):
    """Voltage that the position controller asks for [V]."""
    return kp * (target - q)


def hanging_mass(mass, length, q):
    """Torque of gravity [N m], q = 0 hanging."""
    return -mass * G * length * np.sin(q)


def propeller_moment(thrust, throttle):
    """Moment of the propeller [N m], with the square of its speed."""
    return thrust * throttle * np.abs(throttle)


def valve_speed(gain, valve):
    """Speed that the flow of the valve gives without load [rad/s]."""
    return gain * valve


def boom_drop(load_drop, q):
    """Speed that the load takes through leakage [rad/s], q = 0 level."""
    return -load_drop * np.cos(q)


def joint_torque(twist, twist_speed, stiffness, joint_damping, series_compliance, play_half, coupling):
    """Torque of the joint on the motor [N m]."""
    stretch = twist - np.maximum(np.minimum(twist, play_half), -play_half)
    touching = np.where(play_half > 0.0, stretch**2 / (stretch**2 + np.maximum(0.1 * play_half, 1e-30) ** 2), 1.0)
    spring = stiffness / (1 + stiffness * series_compliance) * stretch
    return spring + (joint_damping * twist_speed + coupling) * touching


def motor_acceleration(drive_effort, drive, joint_torque, torque, damping, v, motor_inertia):
    """Acceleration of the motor [rad/s2]."""
    return (drive_effort + drive + joint_torque + torque - damping * v) / motor_inertia


def level_rate(drive_effort, drive, torque, inertia):
    """Acceleration of a level shaft [rad/s2]."""
    return (drive_effort + drive + torque) / inertia


def damped_rate(drive_effort, drive, torque, damping, v, inertia):
    """Acceleration of a damped wheel [rad/s2]."""
    return (drive_effort + drive + torque - damping * v) / inertia


def servo_rate(drive_effort, drive, gravity_effort, torque, mass, length, armature):
    """Acceleration of a point mass on a servo [rad/s2]."""
    return (drive_effort + drive + gravity_effort + torque) / (mass * length**2 + armature)


def propeller_rate(drive_effort, drive, gravity_effort, torque, damping, v, inertia):
    """Acceleration of the arm [rad/s2]."""
    return (drive_effort + drive + gravity_effort + torque - damping * v) / inertia


def cart_rate(drive_effort, drive, torque, mass):
    """Acceleration of the cart [m/s2]."""
    return (drive_effort + drive + torque) / mass


def boom_rate(drive_effort, drive, gravity_effort, torque, v, lag):
    """Acceleration of the boom [rad/s2]."""
    return (drive_effort + drive + gravity_effort + torque - v) / lag


def twist_speed_rate(joint_torque, load_inertia, motor_acceleration):
    """Acceleration of the twist [rad/s2]."""
    return -joint_torque / load_inertia - motor_acceleration


def turning(rate, first=lambda start_position: start_position, unit="rad"):
    """Return position and speed as states; first: the position at the first sample."""
    return (State("q", unit, lambda v: v, first, f"position_state_{unit}"),
            State("v", f"{unit}/s", rate, lambda start_speed: start_speed, f"speed_state_{unit}_s"))  # fmt: skip


def starts(unit="rad"):
    """Return the constants of the start."""
    return (Constant("start_position", 0.0, unit, "set from the record"),
            Constant("start_speed", 0.0, f"{unit}/s", "set from the record"))  # fmt: skip


SPEED = Constant("start_speed", 0.0, "rad/s", "set from the record")
ALIASES = {"omega": "v", "theta": "q", "speed": "v", "position": "q"}
MOTOR = {"current": current, "drive_effort": lambda motor_constant, current: motor_constant * current}
INERTIA = Parameter("inertia", "kg m2", 5e-5, 0.02, nominal=1e-3, note="of everything that turns")
MOTOR_CONSTANT = Parameter("motor_constant", "N m/A", 0.01, 0.5, nominal=0.1, note="also in V s/rad")
RESISTANCE = Constant("resistance", 1.5, "ohm", "of winding and leads")
SUPPLY = Input("supply", "V", ("supply_V",), typical=(6.0, 24.0))
ANGLE = (Output("angle", "recorded_angle", "rad", port="angle_sensor"),)

motor_disc = Plant(
    name="motor_disc", note="DC motor with a disc: J dv/dt = k (u - k v) / R",
    parameters=(INERTIA, MOTOR_CONSTANT), states=turning(level_rate, zero),
    quantities={**MOTOR, "recorded_speed": recorded_speed}, constants=(RESISTANCE, SPEED),
    inputs=(Input("volts", "V", ("volts_V",), typical=(-12.0, 12.0)),),
    ports={"torque": "N m", "drive": "N m", "winding": "V", "output": "rad/s"},
    aliases={**ALIASES, "voltage": "volts"}, output="recorded_speed", output_unit="rad/s",
    scales=Scales(effort=1.0, speed=100.0), from_rest=False,
)  # fmt: skip
wheel_pwm = Plant(
    name="wheel_pwm", note="wheel motor behind a PWM bridge: J dv/dt = k (duty supply - k v) / R - b v",
    parameters=(
        Parameter("inertia", "kg m2", 1e-3, 0.2, nominal=0.012, note="of the wheel and what it moves"),
        Parameter("motor_constant", "N m/A", 0.05, 2.0, nominal=0.45, note="also in V s/rad"),
        Parameter("damping", "N m s/rad", 0.0, 0.2, nominal=0.01, note="viscous"),
    ),
    states=turning(damped_rate, zero),
    quantities={**MOTOR, "voltage": motor_voltage, "recorded_speed": recorded_speed}, constants=(RESISTANCE, SPEED),
    inputs=(Input("duty", "1", ("duty_1",), typical=(-1.0, 1.0)), SUPPLY),
    ports={"torque": "N m", "drive": "N m", "winding": "V", "output": "rad/s"}, aliases=ALIASES,
    output="recorded_speed", output_unit="rad/s", scales=Scales(effort=4.0, speed=40.0), from_rest=False,
)  # fmt: skip
unbalanced_disc = Plant(
    name="unbalanced_disc", note="disc with an eccentric weight on a DC motor: J dv/dt = k (u - k v) / R - M sin q",
    parameters=(INERTIA, MOTOR_CONSTANT,
                Parameter("gravity_moment", "N m", 1e-3, 0.2, nominal=0.03, note="weight times its distance")),
    states=turning(rotary_speed_rate),
    quantities={**MOTOR, "gravity_effort": gravity_effort, "recorded_angle": recorded_angle},
    constants=(RESISTANCE, *starts()), inputs=(Input("volts", "V", ("volts_V",), typical=(-6.0, 6.0)),),
    ports={"torque": "N m", "drive": "N m", "winding": "V", "angle_sensor": "rad"},
    aliases={**ALIASES, "voltage": "volts", "load_effort": "gravity_effort"}, outputs=ANGLE,
    scales=Scales(effort=0.08, speed=10.0), from_rest=False,
)  # fmt: skip
position_servo = Plant(
    name="position_servo", note="position servo with a pendulum: (m l^2 + A) dv/dt = k (u - k v) / R - m g l sin q",
    parameters=(
        Parameter("motor_constant", "N m/A", 0.05, 2.0, nominal=0.45, note="behind the gear; also in V s/rad"),
        Parameter("resistance", "ohm", 0.5, 30.0, nominal=4.0, note="of winding and leads"),
        Parameter("armature", "kg m2", 5e-5, 0.02, nominal=2e-3, note="inertia of rotor and gear at the output"),
    ),
    states=turning(servo_rate),
    quantities={**MOTOR, "wanted_duty": wanted_duty, "voltage": servo_voltage, "gravity_effort": hanging_mass,
                "recorded_angle": recorded_angle},
    constants=(Constant("mass", 0.3, "kg", "of the pendulum"), Constant("length", 0.1, "m", "of the pendulum"),
               Constant("kp", 4.0, "1/rad", "gain of the servo", tolerance=0.0), *starts()),
    inputs=(Input("goal", "rad", ("goal_rad",), typical=(-1.0, 1.0)), SUPPLY),
    ports={"torque": "N m", "drive": "N m", "winding": "V", "angle_sensor": "rad"},
    guards=(Guard("upper_limit", lambda wanted_duty: wanted_duty - 1.0),
            Guard("lower_limit", lambda wanted_duty: wanted_duty + 1.0)),
    aliases={**ALIASES, "load_effort": "gravity_effort"}, outputs=ANGLE, scales=Scales(effort=0.6, speed=8.0),
    from_rest=False,
)  # fmt: skip
propeller_pendulum = Plant(
    name="propeller_pendulum", note="pendulum under a propeller: J dv/dt = c u |u| - M sin q - b v",
    parameters=(
        Parameter("inertia", "kg m2", 1e-3, 0.2, nominal=0.015, note="about the axis"),
        Parameter("thrust", "N m", 0.02, 3.0, nominal=0.3, note="moment at full throttle"),
        Parameter("damping", "N m s/rad", 0.0, 0.3, nominal=0.015, note="viscous"),
    ),
    states=turning(propeller_rate),
    quantities={"drive_effort": propeller_moment, "gravity_effort": gravity_effort, "recorded_angle": recorded_angle},
    constants=(Constant("gravity_moment", 0.5, "N m", "weight times its distance"), *starts()),
    inputs=(Input("throttle", "1", ("throttle_1",), typical=(-1.0, 1.0)),),
    ports={"torque": "N m", "drive": "N m", "angle_sensor": "rad"},
    aliases={**ALIASES, "load_effort": "gravity_effort"}, outputs=ANGLE, scales=Scales(effort=0.4, speed=3.0),
    from_rest=False,
)  # fmt: skip
cart = Plant(
    name="cart", note="cart on a rail under a position controller: m dv/dt = k (kp (target - x) - k v) / R",
    parameters=(
        Parameter("mass", "kg", 0.05, 10.0, nominal=0.8, note="of cart and rotor"),
        Parameter("motor_constant", "N/A", 0.5, 50.0, nominal=6.0, note="at the rail; also in V s/m"),
    ),
    states=turning(cart_rate, unit="m"),
    quantities={**MOTOR, "voltage": cart_voltage,
                "recorded_position": lambda q, position_sensor: q + position_sensor},
    constants=(RESISTANCE, Constant("kp", 50.0, "V/m", "gain of the controller", tolerance=0.0), *starts("m")),
    inputs=(Input("target", "m", ("target_m",), typical=(-0.15, 0.15)),),
    ports={"torque": "N", "drive": "N", "winding": "V", "position_sensor": "m"}, aliases=ALIASES,
    outputs=(Output("position", "recorded_position", "m", port="position_sensor"),),
    scales=Scales(effort=10.0, speed=0.6, effort_unit="N", length_unit="m"), from_rest=False,
)  # fmt: skip
hydraulic_boom = Plant(
    name="hydraulic_boom", note="boom on a cylinder behind a valve: lag dv/dt = G u - v - d cos q",
    parameters=(
        Parameter("gain", "rad/s", 0.05, 3.0, nominal=0.5, note="speed at full valve, unloaded"),
        Parameter("lag", "s", 0.01, 1.5, nominal=0.15, note="time constant of the speed"),
    ),
    states=turning(boom_rate),
    quantities={"drive_effort": valve_speed, "gravity_effort": boom_drop, "recorded_angle": recorded_angle},
    constants=(Constant("load_drop", 0.03, "rad/s", "speed that the load takes through leakage, level"), *starts()),
    inputs=(Input("valve", "1", ("valve_1",), typical=(-1.0, 1.0)),),
    ports={"torque": "rad/s", "drive": "rad/s", "angle_sensor": "rad"},
    aliases={**ALIASES, "load_effort": "gravity_effort"}, outputs=ANGLE,
    scales=Scales(effort=0.6, speed=0.6, effort_unit="rad/s"), from_rest=False,
)  # fmt: skip
elastic_joint = Plant(
    name="elastic_joint",
    note="motor and load with a spring between them: J1 dv/dt = c i - b v + K s, J2 (dv/dt + s'') = -K s",
    parameters=(
        Parameter("motor_inertia", "kg m2", 1e-3, 0.2, nominal=0.02, note="of the motor and its gear"),
        Parameter("load_inertia", "kg m2", 1e-3, 0.5, nominal=0.04, note="behind the joint"),
        Parameter("stiffness", "N m/rad", 2.0, 400.0, nominal=30.0, note="of the joint"),
        Parameter("damping", "N m s/rad", 0.0, 3.0, nominal=0.2, note="viscous, of the motor"),
        Parameter("joint_damping", "N m s/rad", 0.0, 1.0, nominal=0.03, note="viscous, of the joint"),
    ),
    states=(*turning(lambda motor_acceleration: motor_acceleration),
            State("twist", "rad", lambda twist_speed: twist_speed, lambda start_twist: start_twist, "twist_state_rad"),
            State("twist_speed", "rad/s", twist_speed_rate, lambda start_twist_speed: start_twist_speed,
                  "twist_speed_state_rad_s")),
    quantities={
        "drive_effort": lambda torque_constant, current_in: torque_constant * current_in,
        "motor_acceleration": motor_acceleration, "play_half": lambda play: play, "joint_torque": joint_torque,
        "recorded_motor_angle": lambda q, motor_angle_sensor: q + motor_angle_sensor,
        "recorded_twist": lambda twist, twist_sensor: twist + twist_sensor,
    },
    constants=(
        Constant("torque_constant", 0.5, "N m/A", "of the motor, at the joint"), *starts(),
        Constant("start_twist", 0.0, "rad", "set from the record"),
        Constant("start_twist_speed", 0.0, "rad/s", "set from the record"),
    ),
    inputs=(Input("current_in", "A", ("current_A",), typical=(-5.0, 5.0)),),
    ports={"torque": "N m", "drive": "N m", "play": "rad", "series_compliance": "rad/(N m)", "coupling": "N m",
           "motor_angle_sensor": "rad", "twist_sensor": "rad"},
    guards=CONTACTS,
    aliases={**ALIASES, "load_effort": "joint_torque"},
    outputs=(Output("motor_angle", "recorded_motor_angle", "rad", port="motor_angle_sensor"),
             Output("twist", "recorded_twist", "rad", port="twist_sensor")),
    scales=Scales(effort=3.0, speed=8.0), from_rest=False,
)  # fmt: skip
PLANTS = (motor_disc, wheel_pwm, unbalanced_disc, position_servo, propeller_pendulum, cart, hydraulic_boom,
          elastic_joint)  # fmt: skip
