"""The shell rocks in its tray: a second body on a spring and a damper (Den Hartog, Mechanical Vibrations, chapter 3).

Zhao and Hou see it in their records and cut them at 0.7 s. The inertia that rocks is taken out of the arm's; with all
of the shell it is 45.5 kg x (0.85 m)^2 = 32.9 kg m2 (REF), less where a part of the shell is held. Gravity stays on the
arm, where it is declared: at rest the spring carries the shell in either reading. A spring that hardens (Duffing) has
the stiffness of the linear one times 1 + hardening a^2, a = w0^2 twist the acceleration that the linear spring gives.
"""

import numpy as np

from armid.model.effect import Effect, State
from armid.model.parameter import Parameter


def inertia(inertia_share, shell):
    """Inertia at the arm [kg m2]: that of the rocking body is taken out."""
    return -inertia_share * shell


def torque(inertia_share, shell, frequency, damping_ratio, hardening, twist, body_speed, omega):
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
    adds={"inertia": inertia, "torque": torque},
    states=(
        State("twist", "rad", twist_rate, untwisted),
        State("body_speed", "rad/s", body_speed_rate, with_the_arm),
    ),
    note="the shell rocks in its tray on a spring and a damper",
    source="Zhao and Hou, section IV; Den Hartog, Mechanical Vibrations, chapter 3",
)
