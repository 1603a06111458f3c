"""Friction builds up over a short way after each reversal (Dahl 1968; Olsson et al. 1998, section 3).

z is the share of the full friction: dz/dt = (omega - abs(omega) z) / way, so that z goes to sign(omega) over the way.
It is Coulomb friction with hysteresis instead of a jump.
"""

import numpy as np

from armid.model.effect import Effect, State
from armid.model.parameter import Parameter


def torque(level, share):
    """Effort of the friction, -level share."""
    return -level * share


def share_rate(omega, share, way, width):
    """Rate of the share of the full friction [1/s], (omega - abs(omega) share) / way; abs smoothed over width."""
    return (omega - omega**2 / np.sqrt(omega**2 + width**2) * share) / way


def strained(omega, width):
    """Return sign(omega), smoothed: what moves at the start has done so for longer than the way; at rest 0."""
    return omega / np.sqrt(omega**2 + width**2)


presliding = Effect(
    name="presliding",
    parameters=(
        Parameter("level", "effort", 0.0, 0.5, null=0.0, note="friction after the way"),
        Parameter("way", "speed*s", 0.001, 0.1, nominal=0.01, note="over which friction builds up to 63 %"),
        Parameter("width", "speed", 0.0005, 0.05, fixed=0.005, note="speed over which the size of speed is smoothed"),
    ),
    adds={"torque": torque},
    states=(State("share", "1", share_rate, strained),),
    note="friction that builds up after each reversal",
    source="doi:10.1016/S0947-3580(98)70113-X",
)
