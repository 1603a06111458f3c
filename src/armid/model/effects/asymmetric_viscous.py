"""Viscous friction that differs between the directions of motion; `torque_offset` is its Coulomb half.

Source: Janot, Gautier, Brunot 2019, Workshop on Nonlinear System Identification Benchmarks (asymmetric friction).
"""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def torque(omega, slope, width):
    """Effort of the difference, -slope abs(omega): slopes are b + slope forwards, b - slope backwards; abs smoothed."""
    return -slope * omega**2 / np.sqrt(omega**2 + width**2)


asymmetric_viscous = Effect(
    name="asymmetric_viscous",
    parameters=(
        Parameter("slope", "effort/speed", -0.3, 0.3, null=0.0, note="half the difference of the two slopes"),
        Parameter("width", "speed", 0.0005, 0.05, fixed=0.005, note="speed over which the size of speed is smoothed"),
    ),
    adds={"torque": torque},
    note="viscous friction that differs between the directions",
    source="Janot, Gautier, Brunot 2019, Nonlinear System Identification Benchmarks",
)
