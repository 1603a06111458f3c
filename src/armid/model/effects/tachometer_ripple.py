"""The tachometer's voltage ripples with the turn of the motor (Doebelin, Measurement Systems, chapter 4).

The ripple of a commutator or of an eccentric coupling is a share of the voltage, so that it grows with the speed.
"""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def feedback(omega, theta, i1, sine, cosine, order):
    """Speed that the control sees less the true one [rad/s], omega (sine sin a + cosine cos a), a = order i1 theta."""
    return omega * (sine * np.sin(order * i1 * theta) + cosine * np.cos(order * i1 * theta))


tachometer_ripple = Effect(
    name="tachometer_ripple",
    parameters=(
        Parameter("sine", "1", -0.15, 0.15, null=0.0, note="amplitude of the sine, as a share of the speed"),
        Parameter("cosine", "1", -0.15, 0.15, null=0.0, note="amplitude of the cosine, as a share of the speed"),
        Parameter("order", "1", 0.5, 4.5, nominal=1.0, note="waves in a turn of the motor"),
    ),
    adds={"feedback": feedback},
    note="the speed that is fed back ripples with the turn of the motor",
    source="Doebelin, Measurement Systems, chapter 4 (tachometer generators)",
)
