"""The shell transfer arm of Zhao and Hou (Eqs 1-7).

The paper prints no constants: every default below is an engineering estimate that gives a sensible machine (REF).
Angles are positive in lowering, with gravity; the current is signed, its sign says which of the two opposed field
windings is in use. The gas pressure is integrated together with the compression V0/V, and the sine and cosine of the
angle are integrated too: the same as p0 (V0/V)**n and cos(theta), but without powers and cosines in the loop.
"""

import numpy as np

from armid.model.effect import Guard, State, zero
from armid.model.parameter import Parameter, Scales
from armid.model.plant import Constant, ManoeuvreKey, Plant
from armid.units import DEGREE


def arm_inertia(I6_empty, I6_loaded, shell):
    """Inertia of worm wheel, arm and shell [kg m2]."""
    return I6_empty + shell * (I6_loaded - I6_empty)


def total_inertia(I01, I23, I45, arm_inertia, i1, i2, i3, eta1, eta2, eta3, inertia):
    """Inertia at the arm [kg m2] (Eq 2)."""
    return 2 * I01 * i1**2 * eta1 * eta2 * eta3 + I23 * i2**2 * eta2 * eta3 + I45 * i3**2 * eta3 + arm_inertia + inertia


def gravity_moment(m_empty, m_loaded, L_empty, L_loaded, shell, g):
    """Product m g L of the arm, with or without the shell [N m]."""
    return g * (m_empty * L_empty + shell * (m_loaded * L_loaded - m_empty * L_empty))


def gravity_level(gravity_moment, alpha, gravity):
    """Part of gravity along the cosine of the angle [N m]; `gravity` is an error of the angle."""
    return gravity_moment * np.cos(alpha + gravity)


def gravity_upright(gravity_moment, alpha, gravity):
    """Part of gravity along the sine of the angle [N m]."""
    return gravity_moment * np.sin(alpha + gravity)


def gravity_torque(gravity_level, cosine, gravity_upright, sine):
    """Torque of gravity, m g L cos(theta + alpha) [N m] (Eq 4)."""
    return gravity_level * cosine - gravity_upright * sine


def piston_moment(l, S):
    """Torque per pressure of the gas [m3]."""
    return l * S


def balance_torque(piston_moment, pressure, gas):
    """Torque of the balance machine [N m] (Eqs 5, 6)."""
    return piston_moment * (pressure + gas)


def direction(theta_C, theta_D):
    """Direction of the stroke: +1 lowering, -1 raising."""
    return np.sign(theta_D - theta_C)


def damping(K_d, k):
    """Voltage per angular velocity that the tachometer feeds back [V s/rad]."""
    return K_d * k


def demand(closed, K_p, theta_D, theta, damping, omega, feedback, command, direction, U, u_th):
    """Voltage that the control asks for [V]: full until the switch E, then proportional and derivative."""
    return np.where(
        closed, K_p * (theta_D - theta) + command - damping * (omega + feedback), 2 * (U + u_th) * direction
    )


def voltage(demand, u_th, U):
    """Motor voltage [V]: the demand shrunk toward 0 by the threshold circuit, then clipped to the supply.

    The sum of a positive and a negative part: one of them is 0.
    """
    return np.maximum(np.minimum(demand - u_th, U), 0.0) + np.minimum(np.maximum(demand + u_th, -U), 0.0)


def field_flux(K, current, flux):
    """Flux of one motor's field winding [Wb]."""
    return K * np.abs(current) + flux


def back_emf(C_e, i1, field_flux, omega):
    """Voltage induced in the armature [V] (Eq 7)."""
    return C_e * i1 * (field_flux * omega)


def motor_torque(C_T, field_flux, current):
    """Torque of one motor [N m] (Eq 7)."""
    return C_T * (field_flux * current)


def drive_ratio(C_T, i1, eta1, eta2, eta3):
    """Torque at the arm of both motors per product of flux and current."""
    return 2 * C_T * i1 * eta1 * eta2 * eta3


def drive_effort(field_flux, current, drive_ratio):
    """Torque of both motors at the arm [N m]: 2 T_d i1 eta1 eta2 eta3."""
    return field_flux * current * drive_ratio


def load_effort(gravity_torque, balance_torque):
    """Torque of what the drive works against, gravity less balance [N m]; only effects ask for it."""
    return gravity_torque - balance_torque


def recorded_speed(omega, output):
    """Angular velocity that the gyro records [rad/s]."""
    return omega + output


def speed_rate(drive_effort, drive, balance_torque, gravity_torque, torque, total_inertia):
    return (gravity_torque - balance_torque + drive_effort + drive + torque) / total_inertia


def current_rate(voltage, supply, R, current, back_emf, winding, L_a):
    # The voltage comes last: it is known last, and lanes wait for it.
    return voltage / L_a + (supply + winding - R * current - back_emf) / L_a


def squeeze(S, l, V0, omega, compression):
    """Rate at which the gas is compressed, -dV/dt / V [1/s]."""
    return S * l / V0 * (omega * compression)


def start_sine(theta_C):
    return np.sin(theta_C)


def start_cosine(theta_C):
    return np.cos(theta_C)


def start_compression(V0, S, l, theta_C, theta_A):
    return V0 / (V0 - S * l * (theta_C - theta_A))


def start_pressure(p0, n, V0, S, l, theta_C, theta_A):
    return p0 * (V0 / (V0 - S * l * (theta_C - theta_A))) ** n


ARM_QUANTITIES = (
    arm_inertia, total_inertia, gravity_moment, gravity_level, gravity_upright, gravity_torque, squeeze, piston_moment,
    balance_torque, direction, damping, demand, voltage, field_flux, back_emf, motor_torque, drive_ratio, drive_effort,
    load_effort, recorded_speed,
)  # fmt: skip
PORTS = {
    "torque": "N m", "gravity": "rad", "inertia": "kg m2", "drive": "N m", "flux": "Wb", "winding": "V", "supply": "V",
    "gas": "Pa", "feedback": "rad/s", "command": "V", "output": "rad/s",
}  # fmt: skip
ALIASES = {
    "I": "current", "speed": "omega", "angle": "theta", "position": "theta", "gravity_effort": "gravity_torque",
    "T_d": "motor_torque",
}  # fmt: skip
# Value and unit of every constant that the paper does not print.
MECHANICAL = {
    "I01": (2.0e-3, "kg m2"), "I23": (4.0e-3, "kg m2"), "I45": (1.2e-2, "kg m2"),
    "I6_loaded": (64.0, "kg m2"), "I6_empty": (31.1, "kg m2"), "i1": (120.0, "1"), "i2": (60.0, "1"),
    "i3": (24.0, "1"), "eta1": (0.97, "1"), "eta2": (0.97, "1"), "m_loaded": (118.0, "kg"),
    "m_empty": (72.5, "kg"), "L_loaded": (0.58, "m"), "L_empty": (0.4106, "m"),
    "alpha": (5.0 * DEGREE, "rad"),
}  # fmt: skip
GAS_AND_DRIVE = {
    "l": (0.060, "m"), "S": (1.9635e-3, "m2"), "V0": (0.40e-3, "m3"), "theta_A": (-55.0 * DEGREE, "rad"),
    "R": (0.40, "ohm"), "L_a": (2.0e-3, "H"), "K": (4.5e-5, "Wb/A"), "C_e": (20.0, "1"), "C_T": (20.0, "1"),
    "K_p": (280.0, "V/rad"), "K_d": (70.0, "V s/rad"), "u_th": (0.5, "V"), "delta_E": (25.0 * DEGREE, "rad"),
}  # fmt: skip
ESTIMATE, ARM_TOLERANCE = "estimate (REF), not published", 0.02
# What a constant of such a machine can be at all, so that a forgotten factor of its unit is noticed.
POSSIBLE = {
    "kg m2": (0.0, 1e4), "kg": (0.0, 1e4), "m": (0.0, 10.0), "m2": (0.0, 0.1), "m3": (0.0, 0.1), "m/s2": (0.0, 30.0),
    "rad": (-np.pi, np.pi), "ohm": (0.0, 100.0), "H": (0.0, 1.0), "Wb/A": (0.0, 1.0), "1": (0.0, 1e4),
}  # fmt: skip


def possible(name, unit):
    """Return least and largest possible value of a constant; an efficiency is at most 1."""
    return (0.0, 1.0) if name.startswith("eta") else POSSIBLE.get(unit, (0.0, np.inf))


def estimated(declared):
    """Return constants that are estimates, from name -> (value, unit)."""
    return (Constant(name, value, unit, ESTIMATE, ARM_TOLERANCE, *possible(name, unit))
            for name, (value, unit) in declared.items())  # fmt: skip


shell_transfer_arm = Plant(
    name="shell_transfer_arm",
    note="shell transfer arm with two series motors, worm gear and gas balance (Zhao & Hou, Eqs 1-7)",
    parameters=(
        Parameter("p0", "Pa", 2.6e6, 3.5e6, nominal=3.05e6, note="initial pressure of the accumulator"),
        Parameter("k", "1", 0.6, 1.1, nominal=1.0, note="relative sensitivity of the tachometer generator"),
        Parameter("eta3", "1", 0.45, 0.70, nominal=0.55, note="efficiency of the worm gear"),
        Parameter("n", "1", 0.9, 1.5, nominal=1.4, note="polytropic exponent of the gas"),
    ),
    states=(
        State("theta", "rad", lambda omega: omega, lambda theta_C: theta_C, "angle_rad"),
        State("omega", "rad/s", speed_rate, zero, "shaft_speed_rad_s"),
        State("current", "A", current_rate, zero, "current_A"),
        State("sine", "1", lambda cosine, omega: cosine * omega, start_sine),
        State("cosine", "1", lambda sine, omega: -sine * omega, start_cosine),
        State("compression", "1", lambda squeeze, compression: squeeze * compression, start_compression),
        State("pressure", "Pa", lambda n, pressure, squeeze: n * (pressure * squeeze), start_pressure),
    ),
    quantities={f.__name__: f for f in ARM_QUANTITIES},
    constants=(
        *estimated(MECHANICAL),
        Constant("g", 9.81, "m/s2", "", 0.0, *POSSIBLE["m/s2"]),
        *estimated(GAS_AND_DRIVE),
        Constant("theta_C", -48.0 * DEGREE, "rad", "start angle of the manoeuvre", None, *POSSIBLE["rad"]),
        Constant("theta_D", 22.0 * DEGREE, "rad", "target angle of the manoeuvre", None, *POSSIBLE["rad"]),
        Constant("shell", 1.0, "1", "1 with the shell, 0 without"),
        Constant("U", 28.0, "V", "supply voltage of the manoeuvre"),
    ),
    ports=PORTS,
    guards=(
        Guard("closed", lambda theta_D, theta, delta_E: np.abs(theta_D - theta) - delta_E, latch=True),
        Guard("dead_zone_low", lambda demand, u_th: demand + u_th),
        Guard("dead_zone_high", lambda demand, u_th: demand - u_th),
        Guard("saturation_low", lambda demand, U, u_th: demand + U + u_th),
        Guard("saturation_high", lambda demand, U, u_th: demand - U - u_th),
        Guard("current_sign", lambda current: current),
    ),
    keys=(
        ManoeuvreKey("start_angle_deg", "theta_C", DEGREE, -55.0, 45.0, required=True),
        ManoeuvreKey("target_angle_deg", "theta_D", DEGREE, -55.0, 45.0, required=True, unlike="theta_C"),
        ManoeuvreKey("shell", "shell", boolean=True, required=True),
        ManoeuvreKey("supply_V", "U", 1.0, 1.0, 100.0, required=True),
    ),
    aliases=ALIASES,
    output="recorded_speed",
    output_unit="rad/s",
    scales=Scales(effort=1000.0, speed=2.0, effort_unit="N m", length_unit="rad"),
)
