"""Pressure lost in the oil line between piston and accumulator (Merritt, Hydraulic Control Systems, chapter 3).

Turbulent flow through a line or an orifice: the loss grows with the square of the flow, and the flow with omega.
"""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def gas(omega, c):
    """Pressure at the piston over that of the gas [Pa], c omega abs(omega): the oil is pushed in as the arm lowers."""
    return c * omega * np.abs(omega)


line_loss = Effect(
    name="line_loss",
    parameters=(Parameter("c", "Pa s2/rad2", 0.0, 2e5, null=0.0, note="pressure drop per square of speed"),),
    adds={"gas": gas},
    note="pressure drop in the oil line",
    source="Merritt, Hydraulic Control Systems, Wiley 1967, chapter 3",
)
