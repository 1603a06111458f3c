"""Motor and supply."""

import numpy as np

from armid.model.effect import Effect, State
from armid.model.parameter import Parameter


def flux_saturation_flux(current, K, sharpness):
    """Flux that is missing [Wb], -K abs(I) x / (1 + x) with x = sharpness abs(I)."""
    return -K * sharpness * current**2 / (1 + sharpness * np.abs(current))


def missing_share(y):
    """Return 1 - atan(x)/x with y = x^2; a series where x < 0.1, where the difference would cancel."""
    x = np.sqrt(np.maximum(y, 0.01))
    series = y * (1 / 3 - y * (1 / 5 - y * (1 / 7 - y * (1 / 9 - y * (1 / 11 - y / 13)))))
    return np.where(y < 0.01, series, 1 - np.arctan(x) / x)


def arctangent_flux(current, K, sharpness_squared):
    """Flux that is missing [Wb], -K abs(I) (1 - atan(x)/x) with x^2 = sharpness_squared I^2."""
    return -K * np.abs(current) * missing_share(sharpness_squared * current**2)


arctangent = Effect(
    name="flux_saturation",
    form="arctangent",
    parameters=(
        Parameter("sharpness_squared", "1/A2", 0.0, 1e-3, null=0.0, note="1/I_s^2, I_s the current that saturates"),
    ),
    adds={"flux": arctangent_flux},
    note="the flux saturates (arctangent)",
    source="Perez-Rojas, IEEE Power Engineering Review 20(11), 2000",
)

flux_saturation = Effect(
    name="flux_saturation",
    form="rational",
    forms=(arctangent,),
    parameters=(Parameter("sharpness", "1/A", 0.0, 0.03, null=0.0, note="1/I_s, I_s the current that saturates"),),
    adds={"flux": flux_saturation_flux},
    note="the flux saturates (rational)",
    source="Krause, Wasynczuk, Sudhoff, Analysis of Electric Machinery, chapter 1",
)


def brush_drop_winding(current, drop, width):
    """Voltage at the winding [V], -drop sign(I), the sign smoothed over width."""
    return -drop * current / np.sqrt(current**2 + width**2)


brush_drop = Effect(
    name="brush_drop",
    parameters=(
        Parameter("drop", "V", 0.0, 5.0, null=0.0, note="both brushes together"),
        Parameter("width", "A", 0.2, 10.0, fixed=1.0, note="current over which the sign is smoothed"),
    ),
    adds={"winding": brush_drop_winding},
    note="voltage drop at the brushes",
    source="Hughes and Drury, Electric Motors and Drives, chapter 3",
)


# The winding warms up and its resistance grows (Hughes and Drury, Electric Motors and Drives, chapter 3; IEC 60034-1).
#
# On the time of a stroke hardly any heat leaves the copper: the resistance follows the integral of the current squared,
# unless `cooling` says that the heat is lost again.


def winding_heating_winding(current, R, rise, heat):
    """Voltage at the winding [V], -R rise heat I."""
    return -R * rise * heat * current


def heat_rate(current, heat, cooling):
    """Square of the current less what is lost again [A2], I^2 - cooling heat."""
    return current**2 - cooling * heat


def cold():
    """Return 0: the declared resistance is that at the start."""
    return 0.0


winding_heating = Effect(
    name="winding_heating",
    parameters=(
        Parameter("rise", "1/(A2 s)", 0.0, 2e-4, null=0.0, note="relative growth of resistance per integral of I^2"),
        Parameter("cooling", "1/s", 0.0, 5.0, fixed=0.0, note="rate at which the heat is lost again"),
    ),
    adds={"winding": winding_heating_winding},
    states=(State("heat", "A2 s", heat_rate, cold),),
    note="the winding's resistance grows with the integral of the current squared",
    source="Hughes and Drury, Electric Motors and Drives, chapter 3; IEC 60034-1",
)


# The supply sags under the current of both motors (Hughes and Drury, Electric Motors and Drives, chapter 2).
#
# After the clip and in both stages; the sign of the current counts, so that braking lifts the voltage.


def supply_sag_supply(current, resistance):
    """Voltage at the motors [V], -resistance (I + I): two equal motors on one supply."""
    return -resistance * 2 * current


supply_sag = Effect(
    name="supply_sag",
    parameters=(Parameter("resistance", "ohm", 0.0, 0.05, null=0.0, note="of the supply and its cables"),),
    adds={"supply": supply_sag_supply},
    note="the supply sags under the current of both motors",
    source="Hughes and Drury, Electric Motors and Drives, chapter 2",
)


def supply_error_supply(voltage, error):
    """Voltage at the motors on top of the declared one [V], error times it."""
    return error * voltage


supply_error = Effect(
    name="supply_error",
    parameters=(Parameter("error", "1", -0.2, 0.2, null=0.0, note="relative error of the motor voltage"),),
    adds={"supply": supply_error_supply},
    note="the motors get more or less voltage than declared",
    source="Hughes and Drury, Electric Motors and Drives, chapter 2",
)
