"""What moves the arm: drive and gear, motor and supply, and the balance machine with its gas and oil."""

from dataclasses import replace

import numpy as np

from armid.model.effect import SIGN_WIDTH, SIZE_WIDTH, Effect, Guard, State, start_speed, zero
from armid.model.effects.sensor import delay_error, lag_error, lagging_rate, output_delay
from armid.model.parameter import Parameter


def drive_error(drive_effort, error):
    """Effort on top of the drive's, error times the drive: the true gain is 1 + error."""
    return error * drive_effort


drive_gain = Effect(
    name="drive_gain", adds={"drive": drive_error},
    parameters=(Parameter("error", "1", -0.6, 0.6, null=0.0, note="relative error of the drive; gain 0.8 is -0.2"),),
    note="the drive is stronger or weaker than declared", source="Gautier and Briot 2014, doi:10.1115/1.4027506",
)  # fmt: skip


def difference_of_directions(drive_effort, difference):
    """Effort on top of the drive's, difference times abs(E).

    The gain is 1 + difference one way and 1 - difference the other way.
    """
    return difference * np.abs(drive_effort)


def drive_sign(drive_effort):
    """Effort of the drive, whose gain changes where it is 0."""
    return drive_effort


drive_asymmetry = Effect(
    name="drive_asymmetry", adds={"drive": difference_of_directions}, guards=(Guard("direction", drive_sign),),
    parameters=(Parameter("difference", "1", -0.6, 0.6, null=0.0, note="half the difference of the two gains"),),
    note="the drive is stronger one way than the other",
    source="Merritt, Hydraulic Control Systems, chapter 6 (cylinders with a rod)",
)  # fmt: skip


# What lags or is late is the effort of the drive, as in a sensor the speed: both have settled before the start.
actuator_lag = Effect(
    name="drive_lag", form="actuator", adds={"drive": lag_error}, binds={"omega": "drive_effort"},
    states=(State("lagging", "effort", lagging_rate, start_speed),),
    parameters=(Parameter("time_constant", "s", 0.0, 0.5, null=0.0, note="of a propeller, a valve, a cylinder"),),
    note="the actuator follows late, first order, up to half a second",
    source="Mahony, Kumar, Corke 2012, doi:10.1109/MRA.2012.2206474 (rotors)",
)  # fmt: skip
# Behind a motor that induces a voltage of its own a lagging voltage is not a lagging torque: taken for one it bends the
# inertia. Where the plant computes its own command, the port of that command takes the lag.
voltage_lag = replace(
    actuator_lag, form="voltage", unless="command", adds={"winding": lag_error},
    states=(State("lagging", "V", lagging_rate, start_speed),), binds={"omega": "voltage"},
    parameters=(Parameter("time_constant", "s", 0.0, 0.05, null=0.0, note="of the amplifier"),),
    note="the voltage at the motor follows late, first order",
)  # fmt: skip
drive_lag = replace(
    actuator_lag, form="current_loop", forms=(actuator_lag, voltage_lag),
    parameters=(Parameter("time_constant", "s", 0.0, 0.05, null=0.0, note="of the drive's current loop"),),
    note="the drive follows late, first order",
    source="Leonhard, Control of Electrical Drives, doi:10.1007/978-3-642-56649-3",
)  # fmt: skip


torque_delay = Effect(
    name="drive_delay", form="effort", adds={"drive": delay_error}, binds={"omega": "drive_effort"},
    delays=output_delay.delays,
    parameters=(Parameter("delay", "s", 0.0, 0.1, null=0.0, note="dead time of the drive"),),
    note="the force or torque of the drive is late by a dead time",
    source="Astrom and Murray, Feedback Systems, chapter 9",
)  # fmt: skip
voltage_delay = replace(
    torque_delay, form="voltage", unless="command", adds={"winding": delay_error}, binds={"omega": "voltage"},
    note="the voltage at the motor is late by a dead time",
)  # fmt: skip
drive_delay = replace(torque_delay, forms=(voltage_delay,))


def saturation_loss(drive_effort, sharpness):
    """Effort on top of the drive's, -E x / (1 + x) with x = sharpness abs(E).

    The torque constant falls with load as the iron of the motor saturates: E / (1 + abs(E)/E_s) instead of E.
    """
    x = sharpness * np.abs(drive_effort)
    return -drive_effort * x / (1 + x)


def limit_loss(drive_effort, sharpness):
    """Effort lost above a hard limit, -E (1 - 1/x) where x = sharpness abs(E) is above 1: the drive gives 1/sharpness.

    Nothing is lost below the limit.
    """
    return -drive_effort * (1 - 1 / np.maximum(sharpness * np.abs(drive_effort), 1.0))


def to_upper_limit(drive_effort, sharpness):
    """Effort above the limit, as a share of it."""
    return sharpness * drive_effort - 1


def to_lower_limit(drive_effort, sharpness):
    """Effort above the limit of the other sign, as a share of it."""
    return sharpness * drive_effort + 1


hard = Effect(
    name="drive_saturation", form="hard", adds={"drive": limit_loss},
    guards=(Guard("upper", to_upper_limit), Guard("lower", to_lower_limit)),
    parameters=(Parameter("sharpness", "1/effort", 0.0, 4.0, null=0.0, note="1/E_s, E_s the most that is given"),),
    note="the drive gives no more than a limit", source="Tao and Kokotovic 1994, IEEE Trans. Automatic Control 39(1)",
)  # fmt: skip


def bend_loss(drive_effort, sharpness_squared, knee):
    """Effort lost, -E (1 - (1 + x^knee)^(-1/knee)) with x^2 = sharpness_squared E^2; a larger knee bends sharper.

    A knee of 1 is the rational form, 2.5 close to tanh, and a large one the hard limit.
    """
    bent = (sharpness_squared * drive_effort**2) ** (0.5 * knee)
    return -drive_effort * (1 - (1 + bent) ** (-1 / knee))


rapp = Effect(
    name="drive_saturation", form="rapp", adds={"drive": bend_loss},
    parameters=(
        Parameter(
            "sharpness_squared", "1/effort^2", 0.0, 16.0, null=0.0, note="1/E_s^2, E_s the most that is given"
        ),
        Parameter("knee", "1", 1.0, 8.0, fixed=2.0, note="how sharply the answer bends at the limit"),
    ),
    note="the drive comes close to a limit along a bend",
    source="Rapp 1991, Proc. 2nd European Conference on Satellite Communications (soft limiter)",
)  # fmt: skip
drive_saturation = Effect(
    name="drive_saturation", form="rational", forms=(hard, rapp), adds={"drive": saturation_loss},
    parameters=(Parameter("sharpness", "1/effort", 0.0, 1.0, null=0.0, note="1/E_s, E_s the effort that saturates"),),
    note="the drive gives less per command the more it gives",
    source="Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives, doi:10.1201/9781420014235",
)  # fmt: skip


def droop_loss(drive_effort, sharpness_squared):
    """Effort lost, -E x / (1 + x) with x = sharpness_squared E^2: the torque per current falls as 1 / (1 + x).

    Flat at no current, as a field that the current weakens; a core that saturates bends at once (`drive_saturation`).
    """
    x = sharpness_squared * drive_effort**2
    return -drive_effort * x / (1 + x)


torque_constant_droop = Effect(
    name="torque_constant_droop", adds={"drive": droop_loss},
    parameters=(
        Parameter("sharpness_squared", "1/effort^2", 0.0, 2.0, null=0.0, note="1/E_d^2, E_d the effort that halves it"),
    ),
    note="the torque constant falls with the current",
    source="Hanselman, Brushless Permanent Magnet Motor Design, chapter 4 (armature reaction)",
)  # fmt: skip


def dead_zone_loss(drive_effort, zone):
    """Effort lost, -E cut to +-zone: a drive answers nothing below a command, and by so much less above it."""
    return -np.minimum(np.maximum(drive_effort, -zone), zone)


def to_upper_edge(drive_effort, zone):
    """Effort of the command above the zone."""
    return drive_effort - zone


def to_lower_edge(drive_effort, zone):
    """Effort of the command above the other edge of the zone."""
    return drive_effort + zone


dead_zone = Effect(
    name="dead_zone", adds={"drive": dead_zone_loss},
    guards=(Guard("upper", to_upper_edge), Guard("lower", to_lower_edge)),
    parameters=(Parameter("zone", "effort", 0.0, 0.5, null=0.0, note="effort of the command that is not answered"),),
    note="the drive answers no small command", source="Tao and Kokotovic 1994, IEEE Trans. Automatic Control 39(1)",
)  # fmt: skip


def play_width(width):
    """Half the play of the coupling [rad or m]."""
    return width


backlash = Effect(
    name="backlash", adds={"play": play_width},
    parameters=(Parameter("width", "speed*s", 0.0, 0.02, null=0.0, note="to either side of the middle"),),
    note="play between the two inertias", source="Nordin and Gutman 2002, doi:10.1016/S0005-1098(02)00047-X",
)  # fmt: skip


def coupling_compliance(compliance):
    """Compliance in series with the coupling [rad/(N m) or m/N]."""
    return compliance


elastic_drive = Effect(
    name="elastic_drive", adds={"series_compliance": coupling_compliance},
    parameters=(Parameter("compliance", "speed*s/effort", 0.0, 0.1, null=0.0, note="1 over the stiffness that is in "
                          "series with the declared one"),),
    note="the drive between the two inertias twists more than declared",
    source="Spong 1987, doi:10.1115/1.3143860",
)  # fmt: skip


def coupling_damper(twist_speed, slope):
    """Torque of the damper on top of the coupling's, slope times the speed of twisting."""
    return slope * twist_speed


coupling_damping = Effect(
    name="coupling_damping", adds={"coupling": coupling_damper},
    parameters=(Parameter("slope", "effort/speed", 0.0, 5.0, null=0.0, note="torque per speed of twisting"),),
    note="the coupling damps its own oscillation", source="Den Hartog, Mechanical Vibrations, chapter 3",
)  # fmt: skip


def worm_direction_loss(omega, drive_effort, loss, width, least):
    """Effort lost where the drive brakes, -loss (E - abs(E) sign(omega))/2 with E the drive: -loss E where E omega < 0.

    A worm gear is less efficient when its wheel drives it: eta_b = 2 - 1/eta for equal friction both ways. abs and
    sign are smoothed over least and width.
    """
    size = drive_effort**2 / np.sqrt(drive_effort**2 + least**2)
    return -0.5 * loss * (drive_effort - size * omega / np.sqrt(omega**2 + width**2))


worm_direction = Effect(
    name="worm_direction", adds={"drive": worm_direction_loss},
    parameters=(
        Parameter("loss", "1", 0.0, 1.0, null=0.0, note="share of the drive that is lost when it is driven backwards"),
        SIGN_WIDTH,
        Parameter("least", "effort", 0.0001, 0.05, fixed=0.002, note="drive over which its size is smoothed"),
    ),
    note="the drive is less efficient when it is driven backwards; the inertia is as declared",
    source="Budynas and Nisbett, Shigley's Mechanical Engineering Design, chapter 13",
)  # fmt: skip


def worm_speed_loss(omega, drive_effort, loss, fade, width):
    """Effort lost at low speed, -loss E exp(-abs(omega)/fade) with E the drive; abs smoothed over width.

    Friction of a worm gear falls with sliding speed. At speed the declared efficiency is left.
    """
    return -loss * drive_effort * np.exp(-np.sqrt(omega**2 + width**2) / fade)


def agma_loss(omega, drive_effort, loss, fade, width):
    """Effort lost at low speed, -loss E exp(-(abs(omega)/fade)^0.45) with E the drive; abs smoothed over width.

    The coefficient of friction of ANSI/AGMA 6034 is 0.103 exp(-0.110 v^0.450) + 0.012, v in ft/min.
    """
    return -loss * drive_effort * np.exp(-(((omega**2 + width**2) / fade**2) ** 0.225))


agma = Effect(
    name="worm_speed", form="agma", adds={"drive": agma_loss},
    parameters=(
        Parameter("loss", "1", 0.0, 0.5, null=0.0, note="share of the drive that is lost at standstill"),
        Parameter("fade", "speed", 0.03, 2.0, nominal=0.3, note="speed at which the loss has faded to 1/e"),
        SIZE_WIDTH,
    ),
    note="the drive is less efficient at low speed (AGMA's power of sliding speed)",
    source="ANSI/AGMA 6034-B92; Budynas and Nisbett, Shigley's Mechanical Engineering Design, chapter 15",
)  # fmt: skip
worm_speed = replace(
    agma,
    form="exponential",
    forms=(agma,),
    adds={"drive": worm_speed_loss},
    note="the drive is less efficient at low speed",
)


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


def missing_pressure(deviation):
    """Pressure [Pa] that the plant's pressure lacks."""
    return deviation


def deviation_rate(n, deviation, squeeze, loss_rate, pressure, p0, compression):
    """Rate of the deviation d [Pa/s], n d squeeze - loss_rate (p + d - p0 compression)."""
    return n * (deviation * squeeze) - loss_rate * (pressure + deviation - p0 * compression)


gas_heat_loss = Effect(
    name="gas_heat_loss", adds={"gas": missing_pressure}, states=(State("deviation", "Pa", deviation_rate, zero),),
    parameters=(Parameter("loss_rate", "1/s", 0.0, 3.0, null=0.0, note="1/tau, tau the thermal time constant"),),
    note="the gas loses its heat of compression to the vessel",
    source="Pourmovahed and Otis 1990, J. Dynamic Systems, Measurement, and Control 112",
)  # fmt: skip


def line_pressure(omega, c):
    """Pressure at the piston over that of the gas [Pa], c omega abs(omega): the oil is pushed in as the arm lowers.

    Turbulent flow: the loss grows with the square of the flow, and the flow with omega.
    """
    return c * omega * np.abs(omega)


line_loss = Effect(
    name="line_loss", adds={"gas": line_pressure},
    parameters=(Parameter("c", "Pa s2/rad2", 0.0, 2e5, null=0.0, note="pressure drop per square of speed"),),
    note="pressure drop in the oil line", source="Merritt, Hydraulic Control Systems, Wiley 1967, chapter 3",
)  # fmt: skip

EFFECTS = (
    drive_gain, drive_asymmetry, drive_lag, drive_delay, drive_saturation, torque_constant_droop, dead_zone, backlash,
    elastic_drive, coupling_damping, worm_direction, worm_speed, flux_saturation, brush_drop, winding_heating,
    supply_sag, supply_error, gas_heat_loss, line_loss,
)  # fmt: skip
