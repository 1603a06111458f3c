"""What resists the simulated arm."""

import math

from stand.arm import Arm
from stand.effects import Effects

State = dict[str, float]


def smooth_sign(value: float, width: float, tanh: float = 0.0) -> float:
    """Give the sign of a value, smoothed over a width of the same unit: x / sqrt(x^2 + w^2), or tanh(x / w)."""
    return math.tanh(value / width) if tanh else value / math.hypot(value, width)


def friction(arm: Arm, effects: Effects, now: State) -> float:
    """Give all friction [N m], positive against a positive speed.

    T_c sgn + T_s exp(-(abs(omega)/omega_s)^d) sgn + b omega + c omega abs(omega) + F l sgn + T_a (1 + a sgn) sgn
    """
    speed = now["speed"]
    coulomb = effects.coulomb * smooth_sign(speed, effects.coulomb_width, effects.coulomb_tanh)
    fading = effects.stribeck * math.exp(-((abs(speed) / effects.stribeck_speed) ** effects.stribeck_exponent))
    stribeck = fading * smooth_sign(speed, effects.stribeck_width, effects.stribeck_tanh)
    total = coulomb + stribeck + effects.viscous * speed + effects.drag * speed * abs(speed)
    if effects.seal_friction:
        total += effects.seal_friction * arm.piston_lever * math.tanh(speed / effects.seal_width)
    if effects.asymmetric_friction:
        sign = math.tanh(speed / effects.seal_width)
        total += effects.asymmetric_friction * (1.0 + effects.asymmetric_share * sign) * sign
    return total
