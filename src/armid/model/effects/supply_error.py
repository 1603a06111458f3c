"""The supply, or the amplifier's gain, differs from the declared one (Hughes and Drury, Electric Motors and Drives)."""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def supply(voltage, error):
    """Voltage at the motors on top of the declared one [V], error times it."""
    return error * voltage


supply_error = Effect(
    name="supply_error",
    parameters=(Parameter("error", "1", -0.2, 0.2, null=0.0, note="relative error of the motor voltage"),),
    adds={"supply": supply},
    note="the motors get more or less voltage than declared",
    source="Hughes and Drury, Electric Motors and Drives, chapter 2",
)
