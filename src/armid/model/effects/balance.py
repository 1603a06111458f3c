"""The balance machine: gas and oil."""

import numpy as np

from armid.model.effect import Effect, State
from armid.model.effects.shared import zero
from armid.model.parameter import Parameter


def missing_pressure(deviation):
    """Pressure [Pa] that the plant's pressure lacks."""
    return deviation


def deviation_rate(n, deviation, squeeze, loss_rate, pressure, p0, compression):
    """Rate of the deviation d [Pa/s], n d squeeze - loss_rate (p + d - p0 compression)."""
    return n * (deviation * squeeze) - loss_rate * (pressure + deviation - p0 * compression)


gas_heat_loss = Effect(
    name="gas_heat_loss", adds={"gas": missing_pressure}, states=(State("deviation", "Pa", deviation_rate, zero),),
    parameters=(Parameter("loss_rate", "1/s", 0.0, 3.0, null=0.0, note="1/tau, tau the thermal time constant"),),
    note="the gas loses its heat of compression to the vessel",
    source="Pourmovahed and Otis 1990, J. Dynamic Systems, Measurement, and Control 112",
)  # fmt: skip


def line_pressure(omega, c):
    """Pressure at the piston over that of the gas [Pa], c omega abs(omega): the oil is pushed in as the arm lowers.

    Turbulent flow: the loss grows with the square of the flow, and the flow with omega.
    """
    return c * omega * np.abs(omega)


line_loss = Effect(
    name="line_loss", adds={"gas": line_pressure},
    parameters=(Parameter("c", "Pa s2/rad2", 0.0, 2e5, null=0.0, note="pressure drop per square of speed"),),
    note="pressure drop in the oil line", source="Merritt, Hydraulic Control Systems, Wiley 1967, chapter 3",
)  # fmt: skip

EFFECTS = (gas_heat_loss, line_loss)
