"""The supply sags under the current of both motors (Hughes and Drury, Electric Motors and Drives, chapter 2).

After the clip and in both stages; the sign of the current counts, so that braking lifts the voltage.
"""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def supply(current, resistance):
    """Voltage at the motors [V], -resistance (I + I): two equal motors on one supply."""
    return -resistance * 2 * current


supply_sag = Effect(
    name="supply_sag",
    parameters=(Parameter("resistance", "ohm", 0.0, 0.05, null=0.0, note="of the supply and its cables"),),
    adds={"supply": supply},
    note="the supply sags under the current of both motors",
    source="Hughes and Drury, Electric Motors and Drives, chapter 2",
)
