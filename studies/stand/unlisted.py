"""What the simulated arm may have and no library of effects lists."""

import math

from stand.arm import Arm
from stand.effects import Effects

State = dict[str, float]
STICTION_WIDTH = 0.002
"""Speed over which the signs of these frictions are smoothed [rad/s]."""


def unlisted_torque(arm: Arm, effects: Effects, now: State, start: float, balance: float) -> float:
    """Give the torque of the effects without a name [N m]; `start` is theta_C [rad], `balance` T_R [N m].

    -T_b exp(-((theta - theta_b)/w)^2) sgn - F l exp(-abs(theta - theta_C)/s) sgn - mu T_R sgn
    - c max(0, theta - theta_s) + A sin(i3 theta + 2 pi f t) + B sin(2 pi f t + phase)
    """
    angle, sign = now["angle"], math.tanh(now["speed"] / STICTION_WIDTH)
    total = -effects.pressure_friction * balance * sign
    if effects.cam_bump:
        away = (angle - math.radians(effects.cam_angle_deg)) / math.radians(effects.cam_width_deg)
        total -= effects.cam_bump * math.exp(-(away**2)) * sign
    if effects.piston_stiction:
        gone = abs(angle - start) / math.radians(effects.stiction_fade_deg)
        total -= effects.piston_stiction * arm.piston_lever * math.exp(-gone) * sign
    if effects.cable_spring:
        total -= effects.cable_spring * max(0.0, angle - math.radians(effects.cable_angle_deg))
    if "clock" in now:
        total += _in_time(arm, effects, now)
    return total


def _in_time(arm: Arm, effects: Effects, now: State) -> float:
    """Give the torques that depend on the time since the brake opened [N m]."""
    turn = 2.0 * math.pi * now["clock"]
    ripple = effects.slipping_ripple * math.sin(arm.ratio_worm * now["angle"] + effects.slip_hz * turn)
    return ripple + effects.sway * math.sin(effects.sway_hz * turn + math.radians(effects.sway_phase_deg))


def base_rate(effects: Effects, now: State, reaction: float) -> float:
    """Give the acceleration of the base's tilt [rad/s2]: w^2 (c M - beta) - 2 z w beta', M the reaction [N m]."""
    natural = 2.0 * math.pi * effects.base_hz
    pull = effects.base_compliance * reaction - now["base"]
    return natural * (natural * pull - 2.0 * effects.base_damping * now["base_speed"])
