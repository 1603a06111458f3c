"""Bodies and gravity: what moves with the arm, and what pulls at it."""

import numpy as np

from armid.model.effect import Effect, State, start_speed, zero
from armid.model.parameter import Parameter


def rocking_inertia(inertia_share, shell):
    """Inertia at the arm [kg m2]: that of the rocking body is taken out."""
    return -inertia_share * shell


def rocking_torque(inertia_share, shell, frequency, damping_ratio, hardening, twist, body_speed, omega):
    """Torque on the arm [N m], J_c (a (1 + hardening a^2) + 2 zeta w0 (body_speed - omega)), a = w0^2 twist."""
    w0 = 2 * np.pi * frequency
    a = w0**2 * twist
    return inertia_share * shell * (a * (1 + hardening * a**2) + 2 * damping_ratio * w0 * (body_speed - omega))


def twist_rate(body_speed, omega):
    """Rate at which the body turns against the arm [rad/s]."""
    return body_speed - omega


def body_speed_rate(frequency, damping_ratio, hardening, twist, body_speed, omega):
    """Acceleration of the body [rad/s2], -(a (1 + hardening a^2) + 2 zeta w0 (body_speed - omega)), a = w0^2 twist."""
    w0 = 2 * np.pi * frequency
    a = w0**2 * twist
    return -a * (1 + hardening * a**2) - 2 * damping_ratio * w0 * (body_speed - omega)


shell_rocking = Effect(
    name="shell_rocking", adds={"inertia": rocking_inertia, "torque": rocking_torque},
    states=(
        State("twist", "rad", twist_rate, zero),
        State("body_speed", "rad/s", body_speed_rate, start_speed),
    ),
    parameters=(
        Parameter("inertia_share", "kg m2", 0.0, 45.0, null=0.0, note="inertia that rocks; 32.9 for the whole shell"),
        Parameter("frequency", "Hz", 2.0, 40.0, nominal=10.0, note="of the body against an arm that is held"),
        Parameter("damping_ratio", "1", 0.0, 0.3, nominal=0.05, note="damping over critical damping"),
        Parameter("hardening", "s4/rad2", 0.0, 0.1, fixed=0.0, note="stiffening per squared acceleration of the body"),
    ),
    note="the shell rocks in its tray on a spring and a damper",
    source="Zhao and Hou, section IV; Den Hartog, Mechanical Vibrations, chapter 3",
)  # fmt: skip


def tilt_angle(angle):
    """Error of the angle in m g L cos(theta + alpha + angle) [rad]."""
    return angle


tilt = Effect(
    name="tilt", adds={"gravity": tilt_angle},
    parameters=(Parameter("angle", "rad", -0.15, 0.15, null=0.0, note="5 deg are 0.087 rad"),),
    note="gravity acts at another angle than declared", source="Zhao and Hou, Eq 4",
)  # fmt: skip


def gravity_error(gravity_effort, error):
    """Effort on top of the declared gravity, error times it."""
    return error * gravity_effort


gravity_gain = Effect(
    name="gravity_gain", adds={"torque": gravity_error},
    parameters=(Parameter("error", "1", -0.3, 0.3, null=0.0, note="relative error of m g L"),),
    note="gravity is stronger or weaker than declared", source="Zhao and Hou, Eq 4",
)  # fmt: skip


def more_inertia(amount):
    """Inertia at the arm on top of the declared one [kg m2]."""
    return amount


added_inertia = Effect(
    name="added_inertia", adds={"inertia": more_inertia},
    parameters=(Parameter("amount", "kg m2", -25.0, 50.0, null=0.0, note="at the arm"),),
    note="inertia on top of the declared one", source="Zhao and Hou, Eq 2",
)  # fmt: skip

EFFECTS = (shell_rocking, tilt, gravity_gain, added_inertia)
