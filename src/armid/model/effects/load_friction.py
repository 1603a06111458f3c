"""Friction in proportion to the load that a gear carries.

The load is the mean of what the drive puts in and what it works against, abs(drive - load)/2; a plant without
`load_effort` carries what the drive puts in, by half. Source: Duclusaud, Passault, Padois, Ly 2024, Extended friction
models for the physics simulation of servo actuators, arXiv:2410.08650 (their coefficient is half of `share`).
"""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def torque(omega, drive_effort, share, width, least, load_effort=0.0):
    """Effort of the friction, -share abs(load) sign(omega), load = (drive - load)/2; abs and sign smoothed."""
    load = 0.5 * (drive_effort - load_effort)
    return -share * load**2 / np.sqrt(load**2 + least**2) * omega / np.sqrt(omega**2 + width**2)


load_friction = Effect(
    name="load_friction",
    parameters=(
        Parameter("share", "1", 0.0, 1.0, null=0.0, note="friction per load"),
        Parameter("width", "speed", 0.0005, 0.05, fixed=0.005, note="speed over which the sign is smoothed"),
        Parameter("least", "effort", 0.0005, 0.05, fixed=0.005, note="load over which its size is smoothed"),
    ),
    adds={"torque": torque},
    note="friction in proportion to the load of the gear",
    source="arXiv:2410.08650",
)
