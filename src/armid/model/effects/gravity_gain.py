"""The moment of gravity differs from the declared one: mass or centre of mass (Zhao and Hou, Eq 4)."""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def torque(gravity_effort, error):
    """Effort on top of the declared gravity, error times it."""
    return error * gravity_effort


gravity_gain = Effect(
    name="gravity_gain",
    parameters=(Parameter("error", "1", -0.3, 0.3, null=0.0, note="relative error of m g L"),),
    adds={"torque": torque},
    note="gravity is stronger or weaker than declared",
    source="Zhao and Hou, Eq 4",
)
