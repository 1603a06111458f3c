"""Torque that repeats with position: cogging, pole pairs, teeth, an eccentric wheel, the pitch of a screw.

Source: Holtz and Springob 1996, Identification and compensation of torque ripple in high-precision permanent magnet
motor drives, IEEE Trans. Industrial Electronics 43(2).
"""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def torque(theta, sine, cosine, waves):
    """Effort of one harmonic, sine sin(waves theta) + cosine cos(waves theta)."""
    return sine * np.sin(waves * theta) + cosine * np.cos(waves * theta)


# A wave as long as the motion is no ripple, and could stand for anything that depends on position: hence from 20.
torque_ripple = Effect(
    name="torque_ripple",
    parameters=(
        Parameter("sine", "effort", -0.2, 0.2, null=0.0, note="amplitude of the sine"),
        Parameter("cosine", "effort", -0.2, 0.2, null=0.0, note="amplitude of the cosine"),
        Parameter("waves", "1/speed/s", 20.0, 500.0, nominal=50.0, note="2 pi per period of position"),
    ),
    adds={"torque": torque},
    note="torque that repeats with position",
    source="Holtz and Springob 1996, IEEE Trans. Industrial Electronics 43(2)",
)
