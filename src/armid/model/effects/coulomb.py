"""Coulomb friction (Armstrong-Helouvry, Dupont, Canudas de Wit 1994, doi:10.1016/0005-1098(94)90209-7)."""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def torque(omega, level, width):
    """Effort of Coulomb friction, -level sign(omega), the sign smoothed over width."""
    return -level * omega / np.sqrt(omega**2 + width**2)


coulomb = Effect(
    name="coulomb",
    parameters=(
        Parameter("level", "effort", 0.0, 0.5, null=0.0, note="friction at any speed"),
        Parameter("width", "speed", 0.0005, 0.05, fixed=0.005, note="speed over which the sign is smoothed"),
    ),
    adds={"torque": torque},
    note="friction of constant size against the motion",
    source="doi:10.1016/0005-1098(94)90209-7",
)
