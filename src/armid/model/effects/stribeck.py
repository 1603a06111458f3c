"""The excess of friction at low speed (Stribeck 1902; Armstrong-Helouvry, Dupont, Canudas de Wit 1994).

The excess alone: it composes with `coulomb`, which is the friction that stays. Published exponents of the speed reach
from 1/2 (Bo and Pavelescu 1982) over 1 (Tustin 1947) to 2 (Armstrong-Helouvry).
"""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def torque(omega, level, fade, exponent, width):
    """Effort of the excess, -level exp(-abs(omega/fade)^exponent) sign(omega), the sign smoothed over width."""
    return -level * np.exp(-(((omega / fade) ** 2) ** (0.5 * exponent))) * omega / np.sqrt(omega**2 + width**2)


stribeck = Effect(
    name="stribeck",
    parameters=(
        Parameter("level", "effort", 0.0, 0.5, null=0.0, note="excess of friction at rest over friction in motion"),
        Parameter("fade", "speed", 0.02, 0.5, nominal=0.08, note="speed at which the excess has faded to 1/e"),
        Parameter("exponent", "1", 0.5, 2.0, fixed=2.0, note="power of the speed in the exponential"),
        Parameter("width", "speed", 0.0005, 0.05, fixed=0.005, note="speed over which the sign is smoothed"),
    ),
    adds={"torque": torque},
    note="friction that is higher at low speed",
    source="doi:10.1016/0005-1098(94)90209-7",
)
