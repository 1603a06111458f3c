"""What drives the simulated arm: flux, worm, motor torque."""

import math

from stand.arm import Arm
from stand.effects import Effects
from stand.friction import smooth_sign

State = dict[str, float]
FEET_PER_MINUTE = 0.3048 / 60.0
"""A foot per minute [m/s], the unit of AGMA's formula."""


def flux(arm: Arm, effects: Effects, now: State) -> float:
    """Give Phi = K abs(I) [Wb] (Eq 7), less when the iron saturates.

    Then K abs(I)/(1 + abs(I)/I_s), K I_s atan(abs(I)/I_s) or K abs(I)/sqrt(1 + (I/I_s)^2). A fading motor
    has Phi / (1 + c * integral of abs(I)).
    """
    ampere = abs(now["current"])
    if effects.flux_atan:
        ampere = effects.flux_atan * math.atan(ampere / effects.flux_atan)
    if effects.flux_root:
        ampere /= math.hypot(1.0, ampere / effects.flux_root)
    if effects.flux_saturation:
        ampere /= 1.0 + ampere / effects.flux_saturation
    return arm.excitation * ampere / (1.0 + effects.motor_fade * now.get("charge", 0.0))


def drive(arm: Arm, effects: Effects, now: State) -> float:
    """Give 2 T_d i1 eta1 eta2 eta3 [N m], T_d = C_T Phi I (Eqs 3, 7), times 1 + g for an error of its gain."""
    torque = arm.torque_constant * flux(arm, effects, now) * now["current"] * (1.0 + effects.drive_gain)
    return 2.0 * torque * arm.ratio_motor * arm.eta1 * arm.eta2 * worm_efficiency(arm, effects, now)


def worm_efficiency(arm: Arm, effects: Effects, now: State) -> float:
    """Give eta3 as the torque meets it: less where the worm brakes, and less where it slides slowly.

    Braking, eta3 loses the share `worm_loss` and goes toward 2 - 1/eta3, but not below 0: the efficiency of the same
    friction with the wheel driving the worm.
    """
    eta3, forward = arm.eta3, now["speed"] * math.copysign(1.0, now["current"])
    if effects.worm_loss:
        eta3 *= 1.0 - effects.worm_loss * 0.5 * (1.0 - smooth_sign(forward, effects.worm_width, effects.worm_tanh))
    if effects.worm_braking:
        braking = 0.5 * (1.0 - math.tanh(forward / effects.braking_width))
        eta3 += effects.worm_braking * braking * (max(0.0, 2.0 - 1.0 / arm.eta3) - arm.eta3)
    if effects.worm_speed:
        eta3 *= 1.0 - effects.worm_speed * _slow(arm, effects, now["speed"])
    return eta3


def _slow(arm: Arm, effects: Effects, speed: float) -> float:
    """Give the share of a worm's loss at standstill that is left at a speed of the arm [rad/s].

    exp(-abs(omega)/omega_f), or where no omega_f is given the ratio of frictions after AGMA at i3 omega r.
    """
    if effects.worm_fade:
        return math.exp(-abs(speed) / effects.worm_fade)
    return relative_friction(arm.ratio_worm * speed * effects.worm_radius)


def relative_friction(sliding: float) -> float:
    """Give the friction of a worm at a sliding speed [m/s] over that at standstill.

    mu(v) = 0.103 exp(-0.110 v^0.450) + 0.012, v in ft/min (ANSI/AGMA 6034-B92), v smoothed over 1 ft/min.
    """
    speed = math.hypot(sliding / FEET_PER_MINUTE, 1.0) - 1.0
    return (0.103 * math.exp(-0.110 * speed**0.450) + 0.012) / 0.115
