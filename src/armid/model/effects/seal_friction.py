"""Friction of the seals of the balance machine's piston: a force at its lever.

Source: Merritt, Hydraulic Control Systems (Wiley 1967), friction of pistons.
"""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def torque(omega, l, force, width):
    """Torque of the seals [N m], -force l sign(omega), the sign smoothed over width; l is the piston's lever [m]."""
    return -force * l * omega / np.sqrt(omega**2 + width**2)


seal_friction = Effect(
    name="seal_friction",
    parameters=(
        Parameter("force", "N", 0.0, 2000.0, null=0.0, note="friction of the seals on the piston"),
        Parameter("width", "speed", 0.0005, 0.05, fixed=0.005, note="speed over which the sign is smoothed"),
    ),
    adds={"torque": torque},
    note="friction of the piston's seals, through its lever",
    source="Merritt, Hydraulic Control Systems, Wiley 1967",
)
