"""Motor and supply."""

import numpy as np

from armid.model.effect import Effect, State
from armid.model.effects.shared import zero
from armid.model.parameter import Parameter


def rational_flux(current, K, sharpness):
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
    name="flux_saturation", form="arctangent", adds={"flux": arctangent_flux},
    parameters=(
        Parameter("sharpness_squared", "1/A2", 0.0, 1e-3, null=0.0, note="1/I_s^2, I_s the current that saturates"),
    ),
    note="the flux saturates (arctangent)", source="Perez-Rojas, IEEE Power Engineering Review 20(11), 2000",
)  # fmt: skip
flux_saturation = Effect(
    name="flux_saturation", form="rational", forms=(arctangent,), adds={"flux": rational_flux},
    parameters=(Parameter("sharpness", "1/A", 0.0, 0.03, null=0.0, note="1/I_s, I_s the current that saturates"),),
    note="the flux saturates (rational)",
    source="Krause, Wasynczuk, Sudhoff, Analysis of Electric Machinery, chapter 1",
)  # fmt: skip


def brush_voltage(current, drop, width):
    """Voltage at the winding [V], -drop sign(I), the sign smoothed over width."""
    return -drop * current / np.sqrt(current**2 + width**2)


brush_drop = Effect(
    name="brush_drop", adds={"winding": brush_voltage},
    parameters=(
        Parameter("drop", "V", 0.0, 5.0, null=0.0, note="both brushes together"),
        Parameter("width", "A", 0.2, 10.0, fixed=1.0, note="current over which the sign is smoothed"),
    ),
    note="voltage drop at the brushes", source="Hughes and Drury, Electric Motors and Drives, chapter 3",
)  # fmt: skip


def heating_voltage(current, R, rise, heat):
    """Voltage at the winding [V], -R rise heat I; at the start the resistance is the declared one."""
    return -R * rise * heat * current


def heat_rate(current, heat, cooling):
    """Square of the current less what is lost again [A2], I^2 - cooling heat.

    On the time of a stroke hardly any heat leaves the copper: the resistance follows the integral of I^2, unless
    `cooling` says that the heat is lost again.
    """
    return current**2 - cooling * heat


winding_heating = Effect(
    name="winding_heating", adds={"winding": heating_voltage}, states=(State("heat", "A2 s", heat_rate, zero),),
    parameters=(
        Parameter("rise", "1/(A2 s)", 0.0, 2e-4, null=0.0, note="relative growth of resistance per integral of I^2"),
        Parameter("cooling", "1/s", 0.0, 5.0, fixed=0.0, note="rate at which the heat is lost again"),
    ),
    note="the winding's resistance grows with the integral of the current squared",
    source="Hughes and Drury, Electric Motors and Drives, chapter 3; IEC 60034-1",
)  # fmt: skip


def sag_voltage(current, resistance):
    """Voltage at the motors [V], -resistance (I + I): two equal motors on one supply.

    After the clip and in both stages; the sign of the current counts, so that braking lifts the voltage.
    """
    return -resistance * 2 * current


supply_sag = Effect(
    name="supply_sag", adds={"supply": sag_voltage},
    parameters=(Parameter("resistance", "ohm", 0.0, 0.05, null=0.0, note="of the supply and its cables"),),
    note="the supply sags under the current of both motors",
    source="Hughes and Drury, Electric Motors and Drives, chapter 2",
)  # fmt: skip


def voltage_error(voltage, error):
    """Voltage at the motors on top of the declared one [V], error times it."""
    return error * voltage


supply_error = Effect(
    name="supply_error", adds={"supply": voltage_error},
    parameters=(Parameter("error", "1", -0.2, 0.2, null=0.0, note="relative error of the motor voltage"),),
    note="the motors get more or less voltage than declared",
    source="Hughes and Drury, Electric Motors and Drives, chapter 2",
)  # fmt: skip

EFFECTS = (flux_saturation, brush_drop, winding_heating, supply_sag, supply_error)
