"""Bodies and gravity: what moves with the arm, and what pulls at it."""

import numpy as np

from armid.model.effect import Effect, State
from armid.model.parameter import Parameter


def shell_rocking_inertia(inertia_share, shell):
    """Inertia at the arm [kg m2]: that of the rocking body is taken out."""
    return -inertia_share * shell


def shell_rocking_torque(inertia_share, shell, frequency, damping_ratio, hardening, twist, body_speed, omega):
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


def untwisted():
    """Return 0: the body lies straight in its tray."""
    return 0.0


def with_the_arm(omega):
    """Return the arm's speed: the body moves with it."""
    return omega


shell_rocking = Effect(
    name="shell_rocking",
    parameters=(
        Parameter("inertia_share", "kg m2", 0.0, 45.0, null=0.0, note="inertia that rocks; 32.9 for the whole shell"),
        Parameter("frequency", "Hz", 2.0, 40.0, nominal=10.0, note="of the body against an arm that is held"),
        Parameter("damping_ratio", "1", 0.0, 0.3, nominal=0.05, note="damping over critical damping"),
        Parameter("hardening", "s4/rad2", 0.0, 0.1, fixed=0.0, note="stiffening per squared acceleration of the body"),
    ),
    adds={"inertia": shell_rocking_inertia, "torque": shell_rocking_torque},
    states=(
        State("twist", "rad", twist_rate, untwisted),
        State("body_speed", "rad/s", body_speed_rate, with_the_arm),
    ),
    note="the shell rocks in its tray on a spring and a damper",
    source="Zhao and Hou, section IV; Den Hartog, Mechanical Vibrations, chapter 3",
)


def tilt_gravity(angle):
    """Error of the angle in m g L cos(theta + alpha + angle) [rad]."""
    return angle


tilt = Effect(
    name="tilt",
    parameters=(Parameter("angle", "rad", -0.15, 0.15, null=0.0, note="5 deg are 0.087 rad"),),
    adds={"gravity": tilt_gravity},
    note="gravity acts at another angle than declared",
    source="Zhao and Hou, Eq 4",
)


def gravity_gain_torque(gravity_effort, error):
    """Effort on top of the declared gravity, error times it."""
    return error * gravity_effort


gravity_gain = Effect(
    name="gravity_gain",
    parameters=(Parameter("error", "1", -0.3, 0.3, null=0.0, note="relative error of m g L"),),
    adds={"torque": gravity_gain_torque},
    note="gravity is stronger or weaker than declared",
    source="Zhao and Hou, Eq 4",
)


def declared_inertia_inertia(amount):
    """Inertia at the arm on top of the declared one [kg m2]."""
    return amount


added_inertia = Effect(
    name="added_inertia",
    parameters=(Parameter("amount", "kg m2", -25.0, 50.0, null=0.0, note="at the arm"),),
    adds={"inertia": declared_inertia_inertia},
    note="inertia on top of the declared one",
    source="Zhao and Hou, Eq 2",
)
