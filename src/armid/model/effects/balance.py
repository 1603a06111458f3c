"""The balance machine: gas and oil."""

import numpy as np

from armid.model.effect import Effect, State
from armid.model.parameter import Parameter


def gas_heat_loss_gas(deviation):
    """Pressure [Pa] that the plant's pressure lacks."""
    return deviation


def deviation_rate(n, deviation, squeeze, loss_rate, pressure, p0, compression):
    """Rate of the deviation d [Pa/s], n d squeeze - loss_rate (p + d - p0 compression)."""
    return n * (deviation * squeeze) - loss_rate * (pressure + deviation - p0 * compression)


def none():
    """Return 0: the start is as declared."""
    return 0.0


gas_heat_loss = Effect(
    name="gas_heat_loss",
    parameters=(Parameter("loss_rate", "1/s", 0.0, 3.0, null=0.0, note="1/tau, tau the thermal time constant"),),
    adds={"gas": gas_heat_loss_gas},
    states=(State("deviation", "Pa", deviation_rate, none),),
    note="the gas loses its heat of compression to the vessel",
    source="Pourmovahed and Otis 1990, J. Dynamic Systems, Measurement, and Control 112",
)


# Pressure lost in the oil line between piston and accumulator (Merritt, Hydraulic Control Systems, chapter 3).
#
# Turbulent flow through a line or an orifice: the loss grows with the square of the flow, and the flow with omega.


def line_loss_gas(omega, c):
    """Pressure at the piston over that of the gas [Pa], c omega abs(omega): the oil is pushed in as the arm lowers."""
    return c * omega * np.abs(omega)


line_loss = Effect(
    name="line_loss",
    parameters=(Parameter("c", "Pa s2/rad2", 0.0, 2e5, null=0.0, note="pressure drop per square of speed"),),
    adds={"gas": line_loss_gas},
    note="pressure drop in the oil line",
    source="Merritt, Hydraulic Control Systems, Wiley 1967, chapter 3",
)
