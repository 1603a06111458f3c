"""The test stand's integrator as an oracle: scipy on equations that share no code with the package."""

import sys
from pathlib import Path

import numpy as np
from arm_cases import Array

STUDIES = str(Path(__file__).parents[2] / "studies")
if STUDIES not in sys.path:
    sys.path.insert(0, STUDIES)

from stand.arm import Arm  # noqa: E402 - found on the path above
from stand.effects import Effects  # noqa: E402
from stand.manoeuvre import KNOWN  # noqa: E402
from stand.motion import Motion  # noqa: E402
from stand.refusal import RefusalError  # noqa: E402
from stand.trajectory import simulate  # noqa: E402


def stand_speed(manoeuvre: str, candidate: Array, **effects: float) -> tuple[Array, float | None] | None:
    """Speed at 1 kHz over 1.2 s, (1201,), and the time of the switch; None where the arm would leave its travel."""
    try:
        found = simulate(Motion(Arm(*map(float, candidate)), KNOWN[manoeuvre], Effects(**effects)), 1.2)
    except RefusalError:
        return None
    return np.asarray(found.gyro), found.switch_s
