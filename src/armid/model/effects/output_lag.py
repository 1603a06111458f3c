"""The recorded speed lags, first order: tau dw/dt = omega - w, w is recorded.

Below 1 ms the filter stays at 1 ms and takes a share tau / 1 ms of the signal: the same delay, no stiff equation, and a
derivative by tau at the null. Source: Doebelin, Measurement Systems, chapter 3 (first-order instruments).
"""

import numpy as np

from armid.model.effect import Effect, State
from armid.model.parameter import Parameter


def output(time_constant, lagging, omega):
    """Speed that is recorded less the true one [speed]."""
    return time_constant / np.maximum(time_constant, 1e-3) * (lagging - omega)


def lagging_rate(time_constant, lagging, omega):
    """Rate of the recorded signal, (omega - lagging) / time_constant."""
    return (omega - lagging) / np.maximum(time_constant, 1e-3)


def settled(omega):
    """Return the speed: the instrument has settled."""
    return omega


output_lag = Effect(
    name="output_lag",
    parameters=(Parameter("time_constant", "s", 0.0, 0.05, null=0.0, note="of the instrument or its filter"),),
    adds={"output": output},
    states=(State("lagging", "speed", lagging_rate, settled),),
    note="the recorded speed lags, first order",
    source="Doebelin, Measurement Systems, chapter 3",
)
