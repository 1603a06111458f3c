"""The best that the four parameters can do about effects that the model lacks, reckoned by the stand alone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from stand.arm import Arm
from stand.blind.lanes import declared_speeds
from stand.manoeuvre import Manoeuvre

FloatArray = npt.NDArray[np.float64]
Ranges = Mapping[str, tuple[float, float]]
DIFFERENCE = 1e-4
"""Step of the derivatives, as a share of a parameter's search range."""


@dataclass(frozen=True)
class Shown:
    """Hold what the gyro shows of strokes without noise: manoeuvres, and speeds [rad/s], (n_strokes, n_samples)."""

    manoeuvres: Sequence[Manoeuvre]
    speeds: FloatArray

    def misses(self, arms: Sequence[Arm]) -> FloatArray:
        """Give what declared arms depart from it [rad/s], (n_arms, n_strokes, n_samples)."""
        pairs = [(arm, manoeuvre) for arm in arms for manoeuvre in self.manoeuvres]
        found = declared_speeds(pairs, self.speeds.shape[1])
        return found.reshape(len(arms), *self.speeds.shape) - self.speeds


def fit_declared(train: Shown, truth: Arm, ranges: Ranges) -> Arm:
    """Fit p0, k, eta3, n of the declared model by least squares, inside their ranges and from the truth on.

    Each parameter runs from 0 to 1 over its search range.
    """
    low = np.array([edges[0] for edges in ranges.values()])
    width = np.array([edges[1] for edges in ranges.values()]) - low

    def arm_at(point: FloatArray) -> Arm:
        return replace(truth, **dict(zip(ranges, (low + point * width).tolist(), strict=True)))

    @lru_cache(maxsize=2)
    def tried(point: tuple[float, ...]) -> tuple[FloatArray, FloatArray]:
        """Give misses and their derivatives; both take one pass, since a pass costs little more with more lanes."""
        shifts = DIFFERENCE * np.vstack((np.zeros(width.size), np.eye(width.size), -np.eye(width.size)))
        found = train.misses([arm_at(np.array(point) + shift) for shift in shifts]).reshape(len(shifts), -1)
        forward, backward = found[1 : 1 + width.size], found[1 + width.size :]
        return found[0], (forward - backward).T / (2.0 * DIFFERENCE)

    def misses(point: FloatArray) -> FloatArray:
        return tried(tuple(point.tolist()))[0]

    def slopes(point: FloatArray) -> FloatArray:
        return tried(tuple(point.tolist()))[1]

    start = (np.array([getattr(truth, name) for name in ranges]) - low) / width
    best = least_squares(misses, start, slopes, bounds=(0.0, 1.0), ftol=1e-4, xtol=1e-4, max_nfev=20)
    return arm_at(best.x)
