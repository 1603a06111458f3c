"""The tachometer tells a speed when there is none (Doebelin, Measurement Systems, chapter 4).

An offset of the angle that the control measures does the same to the demand: K_p times the angle is K_d k times this.
"""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def feedback(offset):
    """Speed that the control sees less the true one [rad/s], constant."""
    return offset


tachometer_offset = Effect(
    name="tachometer_offset",
    parameters=(Parameter("offset", "speed", -0.1, 0.1, null=0.0, note="1 deg/s is 0.0175 rad/s"),),
    adds={"feedback": feedback},
    note="constant error of the speed that is fed back",
    source="Doebelin, Measurement Systems, chapter 4 (tachometer generators)",
)
