"""The torque constant falls with load as the iron of the motor saturates: E / (1 + abs(E)/E_s) instead of E.

Source: Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives, doi:10.1201/9781420014235 (saturation).
"""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def drive(drive_effort, sharpness):
    """Effort on top of the drive's, -E x / (1 + x) with x = sharpness abs(E)."""
    x = sharpness * np.abs(drive_effort)
    return -drive_effort * x / (1 + x)


drive_saturation = Effect(
    name="drive_saturation",
    parameters=(Parameter("sharpness", "1/effort", 0.0, 1.0, null=0.0, note="1/E_s, E_s the effort that saturates"),),
    adds={"drive": drive},
    note="the drive gives less per command the more it gives",
    source="Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives, doi:10.1201/9781420014235",
)
