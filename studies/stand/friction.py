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

    T_c sgn + T_s f sgn + b omega + c omega abs(omega) + F l sgn + T_a (1 + a sgn) sgn
    """
    speed = now["speed"]
    coulomb = effects.coulomb * smooth_sign(speed, effects.coulomb_width, effects.coulomb_tanh)
    sign = smooth_sign(speed, effects.stribeck_width, effects.stribeck_tanh)
    stribeck = effects.stribeck * _left(effects, speed) * sign
    total = coulomb + stribeck + effects.viscous * speed + effects.drag * speed * abs(speed)
    if effects.seal_friction:
        total += effects.seal_friction * arm.piston_lever * math.tanh(speed / effects.seal_width)
    if effects.asymmetric_friction:
        sign = math.tanh(speed / effects.seal_width)
        total += effects.asymmetric_friction * (1.0 + effects.asymmetric_share * sign) * sign
    return total


def _left(effects: Effects, speed: float) -> float:
    """Give the share f of Stribeck's excess that is left at a speed [rad/s].

    exp(-(abs(omega)/omega_s)^d), or 1/(1 + (omega/omega_s)^2) (Hess and Soom 1990).
    """
    ratio = abs(speed) / effects.stribeck_speed
    return 1.0 / (1.0 + ratio**2) if effects.stribeck_rational else math.exp(-(ratio**effects.stribeck_exponent))
