"""Profile likelihood: what remains possible when one parameter is held and the others make up for it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from armid.errors import ArmidError
from armid.estimation.information import NORMAL_95, inverse
from armid.estimation.least_squares import LeastSquaresProblem, fit
from armid.model import Array

# chi2 of one degree of freedom at 95 %.
THRESHOLD = NORMAL_95**2
# The ends of an interval by curvature and by profile disagree when they differ by more than this share of its half.
AGREE = 0.15
# A profile that falls by more than this below its minimum has found a better one.
BETTER, MOST_RESTARTS = 0.01, 5
# First step along a profile: so many standard deviations, at most this share of the range.
FIRST_STEP, LONGEST_STEP = 0.5, 0.1
# The walk ends where the rise reaches this many thresholds: what the figure shows.
SHOWN_TO = 1.7
# Wanted change of sqrt(rise) from point to point; steps grow and shrink by at most these factors.
WANTED, GROWTH, SHRINKAGE = 0.45, 2.0, 0.4
MOST_POINTS = 60
# So many points at least stand between the minimum and the crossing, so that the curve is not guessed.
FEWEST = 4
# How closely a crossing is found, as a share of the step in which it lies.
CLOSE = 1e-3
# Relative change of chi2 at which a fit along a profile stops: far below what the threshold could see.
TOLERANCE = 1e-7


@dataclass(frozen=True, eq=False)
class Profile:
    """The profile of one parameter.

    values: where it was held, SI, increasing, (n_points,). rise: chi2 above its minimum there, the other free
    parameters fitted again. candidates: those fits, SI. estimate: SI, where the rise is 0. low, high: the 95 %
    interval, the end of the box where it is not bounded inside. deviation: by the curvature, SI, infinite where not
    determined.
    """

    name: str
    unit: str
    values: Array
    rise: Array
    candidates: Array
    estimate: float
    low: float
    high: float
    bounded: tuple[bool, bool]
    deviation: float
    box: tuple[float, float]

    @property
    def curvature(self) -> tuple[float, float]:
        """The 95 % interval by the curvature at the minimum, SI, whatever the box."""
        half = NORMAL_95 * self.deviation
        return self.estimate - half, self.estimate + half

    @property
    def agrees(self) -> bool:
        """Whether curvature and profile give the same interval, as far as it lies in the box."""
        half = NORMAL_95 * self.deviation
        if not np.isfinite(half):
            return not any(self.bounded)
        ends = zip((self.low, self.high), self.curvature, strict=True)
        return bool(max(abs(end - float(np.clip(other, *self.box))) for end, other in ends) <= AGREE * half)


@dataclass(frozen=True, eq=False)
class Point:
    """One point of a profile: place (share of the range), rise of chi2, whole candidate (shares)."""

    place: float
    rise: float
    z: Array

    @property
    def height(self) -> float:
        return float(np.sqrt(max(self.rise, 0.0)))


# Fits the others with the parameter at a place (share of its range), from a start.
HeldFit = Callable[[float, Array], Point]


def profiles(
    records: LeastSquaresProblem, z: Array, progress: Callable[[str], None] = lambda _: None
) -> tuple[Array, tuple[Profile, ...]]:
    """Return the least-squares minimum and the profile of each free parameter about it.

    Where a profile comes upon a lower minimum, all start again from there. records: weighted so that chi2 is that of
    effective samples. z: a start, as shares of the range; the minimum is returned so, too. progress: called with
    a sentence before each profile.
    """
    best, names, profiles = fit(records, z), records.space.free_names, list[Profile]()
    for _ in range(MOST_RESTARTS):
        profiles = []
        for i, name in enumerate(names):
            progress(f"profile of {name}, {i + 1} of {len(names)}")
            profiles.append(profile(records, best, i))
        lowest = min(profiles, key=lambda p: float(p.rise.min()))
        if lowest.rise.min() > -BETTER:
            break
        best = fit(records, records.shares(lowest.candidates[int(lowest.rise.argmin())]))
    return best, tuple(profiles)


def profile(records: LeastSquaresProblem, z: Array, i: int) -> Profile:
    """Return the profile of one free parameter about the least-squares minimum.

    rise(v) = min over the other free parameters of chi2, given that parameter i is v, minus chi2 at the minimum; the
    interval holds where rise < 3.84, the 95 % point of chi2 with one degree of freedom. Each point starts from the last
    ones along the curve. Source: Raue et al. 2009, doi:10.1093/bioinformatics/btp358.
    """
    residual, slopes = records.residual_and_slopes(z)
    deviation = float(np.sqrt(inverse(slopes.T @ slopes)[i, i]))
    held = held_fit(records, z, i, float(residual @ residual))
    points, ends, bounded = [Point(float(z[i]), 0.0, z)], [], []
    for sign, edge in ((-1.0, 0.0), (1.0, 1.0)):
        side = walk(held, points[0], sign * min(FIRST_STEP * deviation, LONGEST_STEP))
        end, tried = crossing(held, side)
        bounded.append(end is not None)
        ends.append(edge if end is None else end)
        tried = [*side, *tried]
        points += [*tried[1:], *between_points(held, tried, ends[-1])]
    points = sorted((p for p in points if np.isfinite(p.rise)), key=lambda p: p.place)
    where = np.array([records.values(p.z) for p in points])
    low, high = (float(records.values(np.full(len(z), edge))[i]) for edge in (0.0, 1.0))
    units = np.array(records.space.units)[records.space.free]
    return Profile(
        records.space.free_names[i], str(units[i]), where[:, i], np.array([p.rise for p in points]), where,
        float(records.values(z)[i]), low + ends[0] * (high - low), low + ends[1] * (high - low),
        (bounded[0], bounded[1]), deviation * (high - low), (low, high),
    )  # fmt: skip


def held_fit(records: LeastSquaresProblem, z: Array, i: int, least: float) -> HeldFit:
    """Return the function that fits the others with parameter i held at a place; its rise is infinite if that fails."""
    name, others = records.space.free_names[i], np.arange(len(z)) != i

    def at(place: float, start: Array) -> Point:
        whole = start.copy()
        whole[i] = place
        part = replace(records, space=records.space.with_fixed(name, float(records.values(whole)[i])))
        try:
            whole[others] = fit(part, whole[others], TOLERANCE) if others.any() else whole[others]
        except ArmidError:
            return Point(place, np.inf, whole)
        return Point(place, float(records.chi2(whole)[0]) - least, whole)

    return at


def walk(held: HeldFit, middle: Point, step: float) -> list[Point]:
    """Return points from the minimum outwards until the rise is well above the threshold, or the box ends.

    step: the first, signed; it grows where the profile is flatter than expected and shrinks where it is steeper.
    """
    points = [middle]
    edge = 1.0 if step > 0.0 else 0.0
    while points[-1].place != edge and points[-1].rise < SHOWN_TO * THRESHOLD and len(points) < MOST_POINTS:
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


def crossing(held: HeldFit, side: list[Point]) -> tuple[float | None, list[Point]]:
    """Return where a side reaches the threshold (None: nowhere inside the box), and the points tried to find it.

    Brent's method on the square root of the rise, which is next to straight; where the simulation diverges it is large.
    """
    from scipy.optimize import brentq

    above = next((k for k, p in enumerate(side) if p.rise >= THRESHOLD), None)
    if above is None:
        return None, []
    ends, tried, height = side[above - 1 : above + 1], [], float(np.sqrt(THRESHOLD))

    def beyond(place: float) -> float:
        point = next((p for p in ends if p.place == place), None)
        if point is None:
            tried.append(point := held(place, ends[0].z))
        return min(point.height, 2.0 * height) - height

    low, high = (p.place for p in ends)
    return float(brentq(beyond, low, high, xtol=CLOSE * abs(high - low))), tried


def between_points(held: HeldFit, points: list[Point], end: float) -> list[Point]:
    """Return further points between the minimum (the first) and the end of the interval, where few were tried there."""
    middle = points[0]
    inside = [p for p in points if abs(p.place - middle.place) < abs(end - middle.place)]
    if len(inside) > FEWEST or end == middle.place:
        return []
    path = [middle]
    for share in np.arange(1, FEWEST + 1) / (FEWEST + 1):
        place = middle.place + float(share) * (end - middle.place)
        path.append(held(place, start_at(path, place)))
    return path[1:]
