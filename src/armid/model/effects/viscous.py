"""Viscous friction (Armstrong-Helouvry, Dupont, Canudas de Wit 1994, doi:10.1016/0005-1098(94)90209-7)."""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def torque(omega, slope):
    """Effort of viscous friction, -slope omega."""
    return -slope * omega


viscous = Effect(
    name="viscous",
    parameters=(Parameter("slope", "effort/speed", 0.0, 0.5, null=0.0, note="friction per speed"),),
    adds={"torque": torque},
    note="friction in proportion to speed",
    source="doi:10.1016/0005-1098(94)90209-7",
)
