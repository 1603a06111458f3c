"""What effects do to a campaign, reckoned by the stand alone: the best fit of the declared model, without noise."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from stand.arm import Arm
from stand.blind.draw import TOLERANCE, Drawn
from stand.blind.fit import Ranges, Shown, fit_declared
from stand.effects import Effects
from stand.motion import Motion
from stand.refusal import RefusalError
from stand.trajectory import simulate

FloatArray = npt.NDArray[np.float64]
Entry = dict[str, Any]
MATTERS = 1.2
"""Effects matter when they raise the held-out error to this multiple of its noise."""


@dataclass(frozen=True)
class Weight:
    """Hold a noise-free fit of the declared model: the arm found, and what it leaves in each role [rad/s].

    `raw` is what the effects change in each stroke at the true parameters [rad/s].
    """

    arm: Arm
    left: dict[str, float | None]
    raw: tuple[float, ...]

    def told(self, floor: float | None) -> Entry:
        """Tell what is left, and the held-out error over its noise that comes of it (None without holdout)."""
        holdout = self.left["holdout"]
        ratio = None if holdout is None or not floor else brief(math.hypot(holdout, floor) / floor)
        left = {"left_train": brief(self.left["train"]), "left_holdout": brief(holdout)}
        return left | {"holdout_ratio": ratio, "matters": None if ratio is None else ratio > MATTERS}


def weigh(drawn: Drawn, speeds: FloatArray, ranges: Ranges) -> Weight:
    """Fit the declared model to true speeds [rad/s], (n_strokes, n_samples); the train strokes alone decide."""
    roles = [role for _, role in drawn.strokes]
    shown = {}
    for wanted in ("train", "holdout"):
        kept = [place for place, role in enumerate(roles) if role == wanted]
        shown[wanted] = Shown([drawn.strokes[place][0] for place in kept], speeds[kept])
    arm = fit_declared(shown["train"], drawn.arm, ranges)
    left = {role: _rms(each.misses([arm])) if each.manoeuvres else None for role, each in shown.items()}
    every = Shown([manoeuvre for manoeuvre, _ in drawn.strokes], speeds)
    return Weight(arm, left, tuple(_rms(miss) for miss in every.misses([drawn.arm])[0]))


def weigh_alone(drawn: Drawn, effects: Effects, ranges: Ranges) -> Weight | None:
    """Weigh one effect of several, as if the arm had it alone; None where that arm would leave its travel."""
    try:
        motions = [Motion(drawn.arm, manoeuvre, effects) for manoeuvre, _ in drawn.strokes]
        speeds = [simulate(motion, drawn.duration_s, TOLERANCE).gyro for motion in motions]
    except RefusalError:
        return None
    return weigh(drawn, np.array(speeds), ranges)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def brief(value: float | None) -> float | None:
    """Round to 6 digits."""
    return None if value is None else float(f"{value:.6g}")
