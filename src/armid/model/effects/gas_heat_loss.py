"""The gas exchanges heat with its vessel: its pressure falls back to the isothermal one.

dp/dt = n p S l omega/V - (p - p0 V0/V)/tau. The plant integrates the pressure without heat; what is added here is how
far the true pressure is from it. Source: Pourmovahed and Otis 1990, An experimental thermal time-constant correlation
for hydraulic accumulators, J. Dynamic Systems, Measurement, and Control 112.
"""

from armid.model.effect import Effect, State
from armid.model.parameter import Parameter


def gas(deviation):
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
    adds={"gas": gas},
    states=(State("deviation", "Pa", deviation_rate, none),),
    note="the gas loses its heat of compression to the vessel",
    source="Pourmovahed and Otis 1990, J. Dynamic Systems, Measurement, and Control 112",
)
