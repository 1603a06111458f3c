"""A worm gear is less efficient when its wheel drives it: eta_b = 2 - 1/eta for equal friction both ways.

Source: Budynas and Nisbett, Shigley's Mechanical Engineering Design, chapter 13 (efficiency of worm gears).
"""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def drive(omega, drive_effort, loss, width, least):
    """Effort lost where the drive brakes, -loss (E - abs(E) sign(omega))/2 with E the drive: -loss E where E omega < 0.

    abs and sign are smoothed over least and width.
    """
    size = drive_effort**2 / np.sqrt(drive_effort**2 + least**2)
    return -0.5 * loss * (drive_effort - size * omega / np.sqrt(omega**2 + width**2))


worm_direction = Effect(
    name="worm_direction",
    parameters=(
        Parameter("loss", "1", 0.0, 1.0, null=0.0, note="share of the drive that is lost when it is driven backwards"),
        Parameter("width", "speed", 0.0005, 0.05, fixed=0.005, note="speed over which the sign is smoothed"),
        Parameter("least", "effort", 0.0001, 0.05, fixed=0.002, note="drive over which its size is smoothed"),
    ),
    adds={"drive": drive},
    note="the drive is less efficient when it is driven backwards; the inertia is as declared",
    source="Budynas and Nisbett, Shigley's Mechanical Engineering Design, chapter 13",
)
