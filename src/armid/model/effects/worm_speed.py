"""Friction of a worm gear falls with sliding speed, so that its efficiency rises.

Two published shapes: an exponential approach, and the power 0.45 of sliding speed of ANSI/AGMA 6034, where the
coefficient of friction is 0.103 exp(-0.110 v^0.450) + 0.012, v in ft/min. At speed the declared efficiency is left.
"""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def drive(omega, drive_effort, loss, fade, width):
    """Effort lost at low speed, -loss E exp(-abs(omega)/fade) with E the drive; abs smoothed over width."""
    return -loss * drive_effort * np.exp(-np.sqrt(omega**2 + width**2) / fade)


def agma_drive(omega, drive_effort, loss, fade, width):
    """Effort lost at low speed, -loss E exp(-(abs(omega)/fade)^0.45) with E the drive; abs smoothed over width."""
    return -loss * drive_effort * np.exp(-(((omega**2 + width**2) / fade**2) ** 0.225))


PARAMETERS = (
    Parameter("loss", "1", 0.0, 0.5, null=0.0, note="share of the drive that is lost at standstill"),
    Parameter("fade", "speed", 0.03, 2.0, nominal=0.3, note="speed at which the loss has faded to 1/e"),
    Parameter("width", "speed", 0.0005, 0.05, fixed=0.005, note="speed over which the size of speed is smoothed"),
)
SOURCE = "ANSI/AGMA 6034-B92; Budynas and Nisbett, Shigley's Mechanical Engineering Design, chapter 15"

agma = Effect(
    name="worm_speed", form="agma", parameters=PARAMETERS, adds={"drive": agma_drive}, source=SOURCE,
    note="the drive is less efficient at low speed (AGMA's power of sliding speed)",
)  # fmt: skip

worm_speed = Effect(
    name="worm_speed",
    form="exponential",
    forms=(agma,),
    parameters=PARAMETERS,
    adds={"drive": drive},
    note="the drive is less efficient at low speed",
    source=SOURCE,
)
