"""The eight machines: their equations of motion, and the ranges from which their numbers are drawn.

Every machine has a drive signal u, an effort E(u, v) of the drive, and equations of motion with a sum T of further
efforts at the shaft. SI throughout. Arrays hold one value for each record that is simulated side by side.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = Mapping[str, Any]
G = 9.81


@dataclass(frozen=True)
class Signal:
    """Declare a recorded output: the headers that may bring it, the index of its state, and its place in the library.

    prefix: how armid's sensor effects of this output begin (`output_lag`, `angle_lag`).
    """

    name: str
    state: int
    unit: str
    headers: tuple[str, ...]
    prefix: str


@dataclass(frozen=True)
class Machine:
    """Declare a machine.

    name: of the machine and of its plant. source: of the equations. effort, speed: typical largest values, from which
    effects take their sizes. parameters: name -> range of the truth, unknown to the user. constants: name -> range,
    known to the user. exact: constants that the user knows exactly. inputs: name -> header of its column.
    command: (numbers, inputs, position) -> u. drive: (numbers, u, speed) -> E. load: (numbers, states) -> the effort
    against which the drive works. rates: (numbers, states, E and what is lost or gained of it, T) -> rates of states.
    limit: largest command. travel: largest position of a sound record. rates_hz: sample rates. seconds: of a record.
    controlled: its input is a target position. volts: u is a voltage at a winding. linear: its one
    output is linear in u. left_out: never used while tuning. extra: further ranges, of a supply.
    """

    name: str
    source: str
    effort: float
    speed: float
    parameters: Mapping[str, tuple[float, float]]
    constants: Mapping[str, tuple[float, float]]
    inputs: Mapping[str, str]
    outputs: tuple[Signal, ...]
    command: Callable[[Numbers, Numbers, Array], Array]
    drive: Callable[[Numbers, Array, Array], Array]
    load: Callable[[Numbers, Array], Array]
    rates: Callable[[Numbers, Array, Array, Array], list[Array]]
    limit: Callable[[Numbers], float]
    rates_hz: tuple[float, float]
    seconds: tuple[float, float]
    exact: tuple[str, ...] = ()
    n_states: int = 2
    travel: float = float("inf")
    controlled: bool = False
    volts: bool = False
    linear: bool = False
    left_out: bool = False
    extra: Mapping[str, Any] = field(default_factory=dict)


def first_input(p: Numbers, given: Numbers, q: Array) -> Array:
    """Return the first input: the record commands the drive directly."""
    return next(iter(given.values()))


def motor(p: Numbers, u: Array, v: Array) -> Array:
    """Return k (u - k v) / R, a DC motor without inductance (Franklin, Powell, Emami-Naeini, section 2.3)."""
    return p["motor_constant"] * (u - p["motor_constant"] * v) / p["resistance"]


def no_load(p: Numbers, x: Array) -> Array:
    """Return 0: a level shaft."""
    return np.zeros_like(x[0])


def hanging(p: Numbers, x: Array) -> Array:
    """Return -M sin q, the moment of a weight that hangs at q = 0."""
    return -p["gravity_moment"] * np.sin(x[0])


def rigid(inertia: str, load: Callable[[Numbers, Array], Array]) -> Callable[..., list[Array]]:
    """Return Newton's law J dv/dt = E + load + T - b v, b 0 where the machine has no `damping`."""

    def rates(p: Numbers, x: Array, effort: Array, further: Array) -> list[Array]:
        return [x[1], (effort + load(p, x) + further - p.get("damping", 0.0) * x[1]) / p[inertia]]

    return rates


def duty_command(p: Numbers, given: Numbers, q: Array) -> Array:
    """Return the mean voltage of a PWM bridge, duty times supply (Mohan, Power Electronics, chapter 7)."""
    return given["duty"] * given["supply"]


def servo_command(p: Numbers, given: Numbers, q: Array) -> Array:
    """Return the voltage of a servo: supply times kp (goal - q), the duty limited to 1 (arXiv:2410.08650)."""
    return given["supply"] * np.clip(p["kp"] * (given["goal"] - q), -1.0, 1.0)


def pendulum(p: Numbers, x: Array) -> Array:
    """Return -m g l sin q."""
    return -p["mass"] * G * p["length"] * np.sin(x[0])


def servo_rates(p: Numbers, x: Array, effort: Array, further: Array) -> list[Array]:
    """Return the rates of a point mass on a servo: (m l^2 + armature) dv/dt = E + load + T."""
    inertia = p["mass"] * p["length"] ** 2 + p["armature"]
    return [x[1], (effort + pendulum(p, x) + further) / inertia]


def thrust(p: Numbers, u: Array, v: Array) -> Array:
    """Return the moment c u abs(u) of a propeller: thrust grows with the square of its speed (Enikov, Campa 2012)."""
    return p["thrust"] * u * np.abs(u)


def cart_command(p: Numbers, given: Numbers, q: Array) -> Array:
    """Return the voltage of a proportional position controller, kp (target - x)."""
    return p["kp"] * (given["target"] - q)


def valve(p: Numbers, u: Array, v: Array) -> Array:
    """Return the speed G u that the flow of the valve gives to an unloaded boom."""
    return p["gain"] * u


def boom_load(p: Numbers, x: Array) -> Array:
    """Return the speed that the load takes through leakage, -d cos q, q from the level."""
    return -p["load_drop"] * np.cos(x[0])


def boom_rates(p: Numbers, x: Array, effort: Array, further: Array) -> list[Array]:
    """Return lag dv/dt = G u - v - d cos q + T, all in rad/s.

    From J dv/dt = a p - M cos q and the flow Kq u = a v + Kc p (Merritt, sections 5.3 and 6.2), a the area of the
    piston times its lever, the oil incompressible: lag = J Kc/a^2, G = Kq/a, d = M Kc/a^2.
    """
    return [x[1], (effort - x[1] + boom_load(p, x) + further) / p["lag"]]


def current_torque(p: Numbers, u: Array, v: Array) -> Array:
    """Return the torque of a motor whose current is controlled, torque_constant times current."""
    return p["torque_constant"] * u


def spring(p: Numbers, x: Array) -> Array:
    """Return the torque of the joint on the motor, K s + D s', s the twist beyond half the play."""
    half = np.abs(p["play"])
    stretch = x[2] - np.clip(x[2], -half, half)
    soft = np.maximum(0.1 * half, 1e-30)
    touching = np.where(half > 0.0, stretch**2 / (stretch**2 + soft**2), 1.0)
    return p["stiffness"] * stretch + p["joint_damping"] * x[3] * touching


def joint_rates(p: Numbers, x: Array, effort: Array, further: Array) -> list[Array]:
    """Return the rates of q1, v1, twist, twist speed (Spong 1987, equations 7 and 8, without gravity)."""
    torque = spring(p, x)
    acceleration = (effort + torque + further - p["damping"] * x[1]) / p["motor_inertia"]
    return [x[1], acceleration, x[3], -torque / p["load_inertia"] - acceleration]


SPEED = Signal("angular_velocity", 1, "rad/s", ("angular_velocity_rad_s", "angular_velocity_rpm"), "output")
ANGLE = Signal("angle", 0, "rad", ("angle_rad", "angle_deg", "angle_counts"), "angle")

motor_disc = Machine(
    name="motor_disc", source="Franklin, Powell, Emami-Naeini, Feedback Control of Dynamic Systems, section 2.3",
    effort=1.0, speed=100.0,
    parameters={"inertia": (5e-4, 3e-3), "motor_constant": (0.06, 0.16)}, constants={"resistance": (0.7, 2.5)},
    inputs={"volts": "volts_V"}, outputs=(SPEED,),
    command=first_input, drive=motor, load=no_load, rates=rigid("inertia", no_load),
    limit=lambda p: 100.0 * p["motor_constant"], rates_hz=(50.0, 2000.0), seconds=(2.0, 8.0), volts=True, linear=True,
)  # fmt: skip
wheel_pwm = Machine(
    name="wheel_pwm", source="Mohan, Undeland, Robbins, Power Electronics, chapters 7 and 13",
    effort=4.0, speed=40.0,
    parameters={"inertia": (0.005, 0.03), "motor_constant": (0.3, 0.6), "damping": (0.002, 0.02)},
    constants={"resistance": (0.8, 2.0)},
    inputs={"duty": "duty_1", "supply": "supply_V"}, outputs=(SPEED,),
    command=duty_command, drive=motor, load=no_load, rates=rigid("inertia", no_load),
    limit=lambda p: 1.0, rates_hz=(20.0, 1000.0), seconds=(3.0, 12.0), volts=True, linear=True,
    extra={"supply": (11.0, 25.0)},
)  # fmt: skip
unbalanced_disc = Machine(
    name="unbalanced_disc",
    source="Koelewijn and Toth 2019, Physical parameter estimation of an unbalanced disc system",
    effort=0.08, speed=10.0,
    parameters={"inertia": (1.5e-4, 4e-4), "motor_constant": (0.03, 0.06), "gravity_moment": (0.015, 0.04)},
    constants={"resistance": (6.0, 12.0)},
    inputs={"volts": "volts_V"}, outputs=(ANGLE,),
    command=first_input, drive=motor, load=hanging, rates=rigid("inertia", hanging),
    limit=lambda p: 0.6 * p["gravity_moment"] * p["resistance"] / p["motor_constant"],
    rates_hz=(50.0, 500.0), seconds=(4.0, 12.0), travel=2.4, volts=True, left_out=True,
)  # fmt: skip
position_servo = Machine(
    name="position_servo", source="Duclusaud, Passault, Padois, Ly 2024, arXiv:2410.08650",
    effort=0.6, speed=8.0,
    parameters={"motor_constant": (0.3, 0.6), "resistance": (2.5, 6.0), "armature": (5e-4, 4e-3)},
    constants={"mass": (0.1, 0.5), "length": (0.08, 0.15), "kp": (1.5, 8.0)}, exact=("kp",),
    inputs={"goal": "goal_rad", "supply": "supply_V"}, outputs=(ANGLE,),
    command=servo_command, drive=motor, load=pendulum, rates=servo_rates,
    limit=lambda p: 1.2, rates_hz=(50.0, 500.0), seconds=(4.0, 10.0), travel=2.4, controlled=True, volts=True,
    extra={"supply": (6.0, 9.0)},
)  # fmt: skip
propeller_pendulum = Machine(
    name="propeller_pendulum", source="Enikov and Campa 2012, doi:10.1109/TE.2012.2195496",
    effort=0.4, speed=3.0,
    parameters={"inertia": (0.008, 0.03), "thrust": (0.2, 0.5), "damping": (0.005, 0.03)},
    constants={"gravity_moment": (0.3, 0.7)},
    inputs={"throttle": "throttle_1"}, outputs=(ANGLE,),
    command=first_input, drive=thrust, load=hanging, rates=rigid("inertia", hanging),
    limit=lambda p: min(1.0, (0.6 * p["gravity_moment"] / p["thrust"]) ** 0.5),
    rates_hz=(20.0, 500.0), seconds=(6.0, 16.0), travel=2.4,
)  # fmt: skip
cart = Machine(
    name="cart",
    source="Apkarian, Lacheray, Levis 2012, Linear servo base unit (Quanser)",
    effort=10.0, speed=0.6,
    parameters={"mass": (0.4, 1.6), "motor_constant": (4.0, 9.0)},
    constants={"resistance": (2.0, 4.0), "kp": (20.0, 80.0)}, exact=("kp",),
    inputs={"target": "target_m"}, outputs=(Signal("position", 0, "m", ("position_m", "position_mm"), "position"),),
    command=cart_command, drive=motor, load=no_load, rates=rigid("mass", no_load),
    limit=lambda p: 0.15, rates_hz=(50.0, 1000.0), seconds=(3.0, 10.0), travel=0.8, controlled=True, volts=True,
)  # fmt: skip
hydraulic_boom = Machine(
    name="hydraulic_boom", source="Merritt, Hydraulic Control Systems, Wiley 1967, sections 5.3 and 6.2",
    effort=0.6, speed=0.6,
    parameters={"gain": (0.3, 0.8), "lag": (0.06, 0.3)}, constants={"load_drop": (0.01, 0.05)},
    inputs={"valve": "valve_1"}, outputs=(ANGLE,),
    command=first_input, drive=valve, load=boom_load, rates=boom_rates,
    limit=lambda p: 1.0, rates_hz=(20.0, 200.0), seconds=(8.0, 20.0), travel=2.5,
)  # fmt: skip
elastic_joint = Machine(
    name="elastic_joint", source="Spong 1987, doi:10.1115/1.3143860",
    effort=3.0, speed=8.0,
    parameters={"motor_inertia": (0.01, 0.04), "load_inertia": (0.02, 0.08), "stiffness": (15.0, 60.0),
                "damping": (0.1, 0.4), "joint_damping": (0.01, 0.1)},
    constants={"torque_constant": (0.3, 0.8)},
    inputs={"current_in": "current_A"},
    outputs=(Signal("motor_angle", 0, "rad", ("motor_angle_rad", "motor_angle_deg"), "motor_angle"),
             Signal("twist", 2, "rad", ("twist_rad", "twist_deg"), "twist")),
    command=first_input, drive=current_torque, load=spring, rates=joint_rates,
    limit=lambda p: 3.0 / p["torque_constant"], rates_hz=(100.0, 2000.0), seconds=(2.0, 6.0), n_states=4,
    left_out=True,
)  # fmt: skip
MACHINES = {m.name: m for m in (
    motor_disc, wheel_pwm, unbalanced_disc, position_servo, propeller_pendulum, cart, hydraulic_boom, elastic_joint,
)}  # fmt: skip
