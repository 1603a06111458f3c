"""The shell transfer arm with a torsion spring and play between its drive and the arm.

The parts of the inertia of Eq 2 that turn with the motors stand on the side of the drive, worm wheel, arm and shell on
the other; friction, gravity and gas act on the arm. Motor and tachometer turn with the drive. Stiffness, damping and
play are engineering estimates; with a stiff spring and no play it moves as `shell_transfer_arm`.
"""

from dataclasses import replace

from armid.model.effect import State, zero
from armid.model.plant import Constant
from armid.model.plants import shell_transfer_arm as arm
from armid.model.plants.flexible_link import CONTACTS, coupling_torque, play_half
from armid.model.plants.shell_transfer_arm import demand as rigid_demand
from armid.units import DEGREE


def drive_inertia(I01, I23, I45, i1, i2, i3, eta1, eta2, eta3):
    """Inertia of motors, gears and worm at the arm [kg m2] (Eq 2)."""
    return 2 * I01 * i1**2 * eta1 * eta2 * eta3 + I23 * i2**2 * eta2 * eta3 + I45 * i3**2 * eta3


def load_inertia(arm_inertia, inertia):
    """Inertia of worm wheel, arm and shell [kg m2]."""
    return arm_inertia + inertia


def drive_speed(omega, twist_speed):
    """Speed of the drive at the arm [rad/s]."""
    return omega + twist_speed


def demand(closed, K_p, theta_D, theta, damping, drive_speed, feedback, command, direction, U, u_th):
    """Voltage that the control asks for [V], its tachometer on the drive."""
    return rigid_demand(closed, K_p, theta_D, theta, damping, drive_speed, feedback, command, direction, U, u_th)


def back_emf(C_e, i1, field_flux, drive_speed):
    """Voltage induced in the armature [V] (Eq 7)."""
    return C_e * i1 * (field_flux * drive_speed)


def arm_acceleration(gravity_torque, balance_torque, coupling_torque, torque, load_inertia):
    """Acceleration of the arm [rad/s2]."""
    return (gravity_torque - balance_torque + coupling_torque + torque) / load_inertia


def twist_speed_rate(drive_effort, drive, coupling_torque, drive_inertia, arm_acceleration):
    return (drive_effort + drive - coupling_torque) / drive_inertia - arm_acceleration


RIGID = arm.shell_transfer_arm
OWN = (
    drive_inertia, load_inertia, drive_speed, demand, back_emf, play_half, coupling_torque, arm_acceleration,
)  # fmt: skip

shell_transfer_arm_elastic = replace(
    RIGID,
    name="shell_transfer_arm_elastic",
    note="shell transfer arm with a torsion spring and play between drive and arm",
    states=(
        *(replace(s, rate=lambda arm_acceleration: arm_acceleration) if s.name == "omega" else s for s in RIGID.states),
        State("twist", "rad", lambda twist_speed: twist_speed, zero, "twist_rad"),
        State("twist_speed", "rad/s", twist_speed_rate, zero, "twist_speed_rad_s"),
    ),
    quantities={n: f for n, f in RIGID.quantities.items() if n != "total_inertia"} | {f.__name__: f for f in OWN},
    constants=(
        *RIGID.constants,
        Constant("stiffness", 1e6, "N m/rad", arm.ESTIMATE),
        Constant("link_damping", 500.0, "N m s/rad", arm.ESTIMATE),
        Constant("half_play", 0.05 * DEGREE, "rad", arm.ESTIMATE),
    ),
    ports={**RIGID.ports, "play": "rad", "series_compliance": "rad/(N m)", "coupling": "N m"},
    guards=(*RIGID.guards, *CONTACTS),
)
