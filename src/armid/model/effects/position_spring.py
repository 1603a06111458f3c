"""Cables and hoses pull back in proportion to position; with `torque_offset` the spring rests elsewhere than at 0.

Source: Siciliano and Khatib, Springer Handbook of Robotics, doi:10.1007/978-3-319-32552-1, chapter 6.
"""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def torque(theta, stiffness):
    """Effort of the spring, -stiffness theta."""
    return -stiffness * theta


position_spring = Effect(
    name="position_spring",
    parameters=(Parameter("stiffness", "effort/speed/s", -0.5, 0.5, null=0.0, note="negative: it drives outwards"),),
    adds={"torque": torque},
    note="effort in proportion to position, as of cables",
    source="doi:10.1007/978-3-319-32552-1",
)
