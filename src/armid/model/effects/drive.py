"""Drive and gear: from the motor to the arm."""

from dataclasses import replace

import numpy as np

from armid.model.effect import Effect, State
from armid.model.effects.shared import SIGN_WIDTH, SIZE_WIDTH, zero
from armid.model.parameter import Parameter


def drive_error(drive_effort, error):
    """Effort on top of the drive's, error times the drive: the true gain is 1 + error."""
    return error * drive_effort


drive_gain = Effect(
    name="drive_gain", adds={"drive": drive_error},
    parameters=(Parameter("error", "1", -0.6, 0.6, null=0.0, note="relative error of the drive; gain 0.8 is -0.2"),),
    note="the drive is stronger or weaker than declared", source="Gautier and Briot 2014, doi:10.1115/1.4027506",
)  # fmt: skip


def drive_lag_effort(time_constant, lagging, drive_effort):
    """Effort on top of the drive's, z - E, z drives.

    Below 1 ms the filter stays at 1 ms and takes a share tau / 1 ms of the drive: the same delay, no stiff equation,
    and a derivative by tau at the null. z starts from 0, the drive being switched on at the start: a record that starts
    under drive starts too weak, by the drive's first value for a time tau.
    """
    return time_constant / np.maximum(time_constant, 1e-3) * (lagging - drive_effort)


def drive_lag_rate(time_constant, lagging, drive_effort):
    """Rate of the effort that drives, (E - lagging) / time_constant."""
    return (drive_effort - lagging) / np.maximum(time_constant, 1e-3)


drive_lag = Effect(
    name="drive_lag", adds={"drive": drive_lag_effort}, states=(State("lagging", "effort", drive_lag_rate, zero),),
    parameters=(Parameter("time_constant", "s", 0.0, 0.05, null=0.0, note="of the drive's current loop"),),
    note="the drive follows late, first order",
    source="Leonhard, Control of Electrical Drives, doi:10.1007/978-3-642-56649-3",
)  # fmt: skip


def saturation_loss(drive_effort, sharpness):
    """Effort on top of the drive's, -E x / (1 + x) with x = sharpness abs(E).

    The torque constant falls with load as the iron of the motor saturates: E / (1 + abs(E)/E_s) instead of E.
    """
    x = sharpness * np.abs(drive_effort)
    return -drive_effort * x / (1 + x)


drive_saturation = Effect(
    name="drive_saturation", adds={"drive": saturation_loss},
    parameters=(Parameter("sharpness", "1/effort", 0.0, 1.0, null=0.0, note="1/E_s, E_s the effort that saturates"),),
    note="the drive gives less per command the more it gives",
    source="Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives, doi:10.1201/9781420014235",
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

EFFECTS = (drive_gain, drive_lag, drive_saturation, worm_direction, worm_speed)
