"""Drag in proportion to the square of speed: churned oil, air (White, Fluid Mechanics, chapter 7)."""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def torque(omega, c):
    """Effort of drag, -c omega abs(omega)."""
    return -c * omega * np.abs(omega)


quadratic_drag = Effect(
    name="quadratic_drag",
    parameters=(Parameter("c", "effort/speed^2", 0.0, 0.5, null=0.0, note="drag per square of speed"),),
    adds={"torque": torque},
    note="drag in proportion to the square of speed",
    source="White, Fluid Mechanics, chapter 7 (drag of bodies)",
)
