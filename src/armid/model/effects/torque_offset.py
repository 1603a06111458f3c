"""Constant effort: an unbalanced weight, an offset of the drive, unequal Coulomb friction in the two directions.

Source: Janot, Gautier, Brunot 2019, Workshop on Nonlinear System Identification Benchmarks (the term `offset`).
"""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def torque(level):
    """Effort that does not depend on the motion, +level."""
    return level


torque_offset = Effect(
    name="torque_offset",
    parameters=(Parameter("level", "effort", -0.2, 0.2, null=0.0, note="constant effort"),),
    adds={"torque": torque},
    note="constant effort on the shaft",
    source="Janot, Gautier, Brunot 2019, Nonlinear System Identification Benchmarks",
)
