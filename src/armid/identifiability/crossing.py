"""Walk along a profile to where it crosses a threshold."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# The walk ends where the rise comes to this many thresholds: what the figure shows.
SHOWN_TO = 1.7
# Wanted change of sqrt(rise) from point to point; steps grow and shrink by at most these factors.
WANTED, GROWTH, SHRINKAGE = 0.45, 2.0, 0.4
MOST_POINTS, MOST_SECANTS = 60, 12
# So many points at least stand between the minimum and the crossing, so that the curve is not guessed.
FEWEST = 4
# How closely the rise is brought to the threshold.
CLOSE = 0.01


@dataclass(frozen=True, eq=False)
class Point:
    """Hold one point of a profile: place (share of the range), rise of chi2, whole candidate (shares)."""

    place: float
    rise: float
    z: Array

    @property
    def height(self) -> float:
        """Square root of the rise: straight along a parabola."""
        return float(np.sqrt(max(self.rise, 0.0)))


Held = Callable[[float, Array], Point]


def walk(held: Held, middle: Point, step: float, threshold: float) -> list[Point]:
    """Return points from the minimum outwards until the rise is well above the threshold, or the box ends.

    held: fits the others with the parameter at a place, from a start. step: the first, signed, share of the range; it
    grows where the profile is flatter than expected and shrinks where it is steeper.
    """
    points = [middle]
    edge = 1.0 if step > 0.0 else 0.0
    while points[-1].place != edge and points[-1].rise < SHOWN_TO * threshold and len(points) < MOST_POINTS:
        last = points[-1]
        place = float(np.clip(last.place + step, 0.0, 1.0))
        points.append(held(place, start_at(points, place)))
        change = abs(points[-1].height - last.height)
        if not np.isfinite(change):
            break
        step *= float(np.clip(WANTED / max(change, 1e-9), SHRINKAGE, GROWTH))
    return points


def start_at(points: list[Point], place: float) -> Array:
    """Return where to start a fit: the last two fits drawn on to the place, inside the box."""
    last = points[-1]
    if len(points) < 2 or last.place == points[-2].place:
        return last.z
    along = (place - last.place) / (last.place - points[-2].place)
    return np.clip(last.z + along * (last.z - points[-2].z), 0.0, 1.0)


def crossing(held: Held, side: list[Point], threshold: float) -> tuple[float | None, list[Point]]:
    """Return where a side comes to the threshold (None: nowhere inside the box), and the points tried to find it.

    A secant on the square root of the rise, halved where the simulation diverges.
    """
    above = next((k for k, p in enumerate(side) if p.rise >= threshold), None)
    if above is None:
        return None, []
    low, high = side[above - 1], side[above]
    goal, tried = float(np.sqrt(threshold)), []
    for _ in range(MOST_SECANTS):
        place = between(low, high, goal)
        tried.append(held(place, low.z))
        if abs(tried[-1].rise - threshold) < CLOSE:
            break
        low, high = (tried[-1], high) if tried[-1].rise < threshold else (low, tried[-1])
    return between(low, high, goal), tried


def between(low: Point, high: Point, goal: float) -> float:
    """Return the place at which the straight line through two points comes to a height."""
    if not np.isfinite(high.rise):
        return 0.5 * (low.place + high.place)
    share = (goal - low.height) / (high.height - low.height)
    return low.place + float(np.clip(share, 0.05, 0.95)) * (high.place - low.place)


def between_points(held: Held, points: list[Point], end: float) -> list[Point]:
    """Return further points between the minimum (the first) and the end of the interval, where few were tried there."""
    middle = points[0]
    inside = [p for p in points if abs(p.place - middle.place) < abs(end - middle.place)]
    if len(inside) > FEWEST or end == middle.place:
        return []
    found = [middle]
    for share in np.arange(1, FEWEST + 1) / (FEWEST + 1):
        place = middle.place + float(share) * (end - middle.place)
        found.append(held(place, start_at(found, place)))
    return found[1:]
