"""Voltage that drops at the brushes, nearly whatever the current (Hughes and Drury, Electric Motors and Drives)."""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def winding(current, drop, width):
    """Voltage at the winding [V], -drop sign(I), the sign smoothed over width."""
    return -drop * current / np.sqrt(current**2 + width**2)


brush_drop = Effect(
    name="brush_drop",
    parameters=(
        Parameter("drop", "V", 0.0, 5.0, null=0.0, note="both brushes together"),
        Parameter("width", "A", 0.2, 10.0, fixed=1.0, note="current over which the sign is smoothed"),
    ),
    adds={"winding": winding},
    note="voltage drop at the brushes",
    source="Hughes and Drury, Electric Motors and Drives, chapter 3",
)
