"""The arm's inertia differs from the declared one (Zhao and Hou, Eq 2)."""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def inertia(amount):
    """Inertia at the arm on top of the declared one [kg m2]."""
    return amount


added_inertia = Effect(
    name="added_inertia",
    parameters=(Parameter("amount", "kg m2", -25.0, 50.0, null=0.0, note="at the arm"),),
    adds={"inertia": inertia},
    note="inertia on top of the declared one",
    source="Zhao and Hou, Eq 2",
)
