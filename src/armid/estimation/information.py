"""How well records pin down parameters: sensitivities, Fisher information, intervals, profile likelihood."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armid.engine import simulate
from armid.errors import ArmidError
from armid.estimation.input_noise import answers, pooled_noise
from armid.estimation.least_squares import LEAST_DAMPING, LeastSquaresProblem, WeightedRecords, fit, step_in_box
from armid.estimation.noise_model import Level, known_level, level_of, level_weights
from armid.model import Array
from armid.problem.problem import Replay, by_record, samples_of
from armid.problem.space import Space

NORMAL_95 = 1.959963984540054
# Directions whose information is below this share of the strongest is rounding.
SINGULAR = 1e-13
# Parameters of a larger correlation than this are hardly separated.
CORRELATED = 0.95
# Log odds of noise of the inputs below which they were exact: 1 to 20.
ODDS_OF_EXACT = -3.0


@dataclass(frozen=True)
class Information:
    """What the records say about the free parameters at one candidate.

    deviation: standard deviation of each, SI, (n_free,), infinite where the records do not determine it. correlation:
    of the estimates, (n_free, n_free), NaN where not determined. step: how far a least-squares step inside the box
    would move each parameter, in standard deviations: far above 1 where a search has not come to the minimum. fisher:
    information matrix of the parameters in shares of their range, weighed with 1 where a record has no noise. gain:
    share of the weighted squares that this step would take away, were the model linear.
    """

    names: tuple[str, ...]
    deviation: Array
    correlation: Array
    levels: tuple[Level, ...]
    step: Array
    fisher: Array
    gain: float = 0.0

    @property
    def half_width(self) -> Array:
        """Half of the 95 % interval, SI."""
        return NORMAL_95 * self.deviation

    def widened(self, covariance: Array) -> "Information":
        """Return the information with another cause of scatter; covariance: of the estimate by it, SI, squared."""
        total = np.sqrt(self.deviation**2 + np.diag(covariance))
        with np.errstate(invalid="ignore", divide="ignore"):
            mixed = self.correlation * np.outer(self.deviation, self.deviation) + covariance
            correlation = mixed / np.outer(total, total)
        return replace(self, deviation=total, correlation=np.where(np.isfinite(correlation), correlation, np.nan))


def information_at(
    replays: tuple[Replay, ...], space: Space, x: Array, levels: tuple[Level, ...] | None = None,
    weights: Sequence[float] | None = None,
) -> Information:  # fmt: skip
    """Return intervals and correlations at a candidate, from the sensitivities and the measured noise.

    Fisher information F = sum over records of f J^T J / level^2 with f the share of samples that are independent;
    covariance = F^-1 (the Cramer-Rao bound of an unbiased estimate). The level is the noise, or the residual where that
    is far above it. A record without noise and without residual gives an interval of width 0. Where records start from
    a measured state, what its noise does to the estimate is added (see `start_changes`).

    Parameters
    ----------
    replays, space
        The records, ready to be simulated, and the box.
    x : array, SI, (n_free,)
        Free parameters.
    levels : tuple of Level
        One for each record; None: as measured, see `level_of`.
    weights : sequence of float
        What the residual of each record weighs in the sum of squares that was minimised, where that is not its level:
        with W their squares and G = J^T W J the covariance is then G^-1 J^T W S W J G^-1, S that of the noise.

    Returns
    -------
    Information
    """
    levels = tuple(level_of(r, space, x) for r in replays) if levels is None else levels
    noise_free = any(level.rms == 0.0 for level in levels)
    records = WeightedRecords(replays, space, (1.0,) * len(replays) if noise_free else level_weights(levels))
    ratios = np.ones(len(replays)) if weights is None or noise_free else np.divide(weights, level_weights(levels))
    others = np.ptp(ratios) > 1e-9 * ratios.max()
    squares = np.repeat((ratios / ratios.max()) ** 2, [r.record.n_samples for r in replays]) if others else None
    information = replace(information_of(records, records.shares(x), weighed=squares), levels=levels)
    if not noise_free:
        return information
    shown = np.where(np.isfinite(information.deviation), 0.0, information.deviation)
    return replace(information, deviation=shown, step=np.zeros(len(x)), gain=0.0)


def information_of(
    records: LeastSquaresProblem, z: Array, trust: Array | None = None, doubts: Array | None = None,
    weighed: Array | None = None,
) -> Information:  # fmt: skip
    """Return intervals and correlations at a candidate, in shares of the range, from the weights of a problem.

    trust: 1 for each sample whose residual is noise, below it where the residual is larger, (n_samples,). doubts: what
    one standard deviation of each further unknown does to the weighted signal, (n_samples, n_doubts); the estimate is
    then one of all together. weighed: what each square weighs in the estimate, times its weight here, (n_samples,);
    None: all alike.
    """
    residual, jacobian = records.residual_and_slopes(z)
    rows = np.ones(len(residual)) if trust is None else np.sqrt(trust)
    residual, jacobian = rows * residual, rows[:, np.newaxis] * jacobian
    total = jacobian.T @ jacobian
    if doubts is not None and doubts.shape[1]:
        others = rows[:, np.newaxis] * doubts
        mixed = others.T @ jacobian
        total = total - mixed.T @ np.linalg.solve(np.eye(others.shape[1]) + others.T @ others, mixed)
    # towards the estimate; of weights that are not those of the noise, doubts are not asked
    towards = jacobian if weighed is None else weighed[:, np.newaxis] * jacobian
    own = total if weighed is None else towards.T @ jacobian
    covariance = inverse(own)
    known = np.isfinite(covariance)
    determined = np.where(known, covariance, 0.0)
    if weighed is not None:
        covariance = np.where(known, determined @ (towards.T @ towards) @ determined, covariance)
    # what the box holds is held, and the others make up for that
    step = step_in_box(own, towards.T @ residual, z, LEAST_DAMPING, records.walls(z)) - z
    started = np.array([towards.T @ (rows * change) for change in start_changes(records, z)])
    started = started.reshape(len(started), len(z))
    covariance = covariance + determined @ (started.T @ started) @ determined
    deviation = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(deviation, deviation)
        steps = step / deviation
    correlation[~np.isfinite(correlation)] = np.nan
    squares = float(residual @ residual)
    left = residual - jacobian @ step
    gain = 1.0 - float(left @ left) / squares if squares > 0.0 else 0.0
    return Information(records.space.free_names, deviation * records.span, correlation, (), steps, total, gain)


def sensitivities(replay: Replay, space: Space, x: Array) -> Array:
    """Return d signal / d parameter x range in the windows of a record.

    Central differences with steps of 1e-4 of the range, moved inside the box where they would leave it; all perturbed
    candidates run as one population.

    Parameters
    ----------
    replay, space
        The record, ready to be simulated, and the box.
    x : array, SI, (n_free,)
        Free parameters.

    Returns
    -------
    array, signal's unit, (n_samples, n_free)
    """
    records = WeightedRecords((replay,), space, (1.0,))
    return records.residual_and_slopes(records.shares(x))[1]


def start_changes(records: LeastSquaresProblem, z: Array, bent: bool = False) -> Iterator[Array]:
    """Yield what one standard deviation of each measured start constant does to the weighted signal, (n_samples,).

    bent: yield half the second difference after each slope. Near an unstable rest the slope alone is too small a
    doubt (Julier, Uhlmann 2004, doi:10.1109/JPROC.2003.823141).
    """
    candidate = records.whole(z[np.newaxis])

    def change_of_piece(outputs: Sequence[Replay], index: int, response: Array) -> Array:
        """Return the change of the weighted signal where outputs of one piece of their record change so."""
        changes = [np.zeros(r.record.n_samples) for r in records.replays]
        for change, r in zip(changes, records.replays, strict=True):
            if r in outputs:
                first = sum(r.record.lengths[:index])
                change[first : first + r.record.lengths[index]] = response[r.place, r.record.samples[index]]
        return records.weighted(changes)

    for ready, outputs in by_record(records.replays).items():
        for index, (piece, calibration) in enumerate(zip(ready.record.pieces, ready.calibrations, strict=True)):
            for name, deviation in ({} if piece.shown_start else piece.start_deviation).items():
                start = piece.manoeuvre.constants.get(name, 0.0)
                moves = (deviation, -deviation, 0.0) if bent else (deviation, -deviation)
                above, below, *at = (
                    simulate(ready.model, piece.with_constants({name: start + move}).manoeuvre, candidate,
                             calibration.schedule).outputs[:, 0] for move in moves
                )  # fmt: skip
                yield change_of_piece(outputs, index, 0.5 * (above - below))
                for same in at:
                    yield change_of_piece(outputs, index, 0.5 * (above + below) - same)


def covariance_by_inputs(replays: tuple[Replay, ...], space: Space, x: Array) -> Array:
    """Return the covariance of an estimate by noise of the inputs, SI, (n_free, n_free).

    To first order, with the starts that are fitted. 0 where all inputs are commands, and where what is left denies such
    noise: the inputs are then commands. With answers W, as parameters leave them, and what is left r the odds are

        log N(r; 0, I + W W^T) - log N(r; 0, I) = (r^T W (I + W^T W)^-1 W^T r - log det(I + W^T W)) / 2
    """
    noise, levels = pooled_noise([ready.record for ready in by_record(replays)]), list(map(known_level, replays))
    if not noise or any(level.rms == 0.0 for level in levels):
        return np.zeros((len(x), len(x)))
    records = WeightedRecords(replays, space, tuple(1.0 / level.rms for level in levels))
    z = records.shares(x)
    residual, jacobian = records.residual_and_slopes(z)
    covariance = inverse(jacobian.T @ jacobian)
    covariance = np.where(np.isfinite(covariance), covariance, 0.0)
    moved, log_odds, lengths = np.zeros((len(x), len(x))), 0.0, [r.record.n_samples for r in replays]
    begins = dict(zip(replays, np.cumsum(lengths) - lengths, strict=True))
    weights = dict(zip(replays, records.weights, strict=True))
    for ready, outputs in by_record(replays).items():
        sizes = [r.record.noise.rms for r in outputs]
        for index, columns in enumerate(answers(ready, outputs, records.whole(z[np.newaxis])[0], noise, sizes)):
            rows = samples_of([int(begins[r]) for r in outputs], [r.record.lengths for r in outputs], index)
            correction = ready.record.pieces[index].correction
            seen = columns if correction is None else correction.left_of(columns)
            changes = np.vstack([weights[r] * each for r, each in zip(outputs, seen, strict=True)])
            slopes = jacobian[rows].T @ changes
            shifts = covariance @ slopes
            moved += shifts @ shifts.T
            along = residual[rows] @ changes
            widened = np.eye(changes.shape[1]) + changes.T @ changes - slopes.T @ shifts
            log_odds += 0.5 * float(along @ np.linalg.solve(widened, along) - np.linalg.slogdet(widened)[1])
    return moved * np.outer(records.span, records.span) if log_odds > ODDS_OF_EXACT else np.zeros((len(x), len(x)))


def inverse(matrix: Array) -> Array:
    scaled, seen = normalised(matrix)
    result = np.full(matrix.shape, np.nan)
    np.fill_diagonal(result, np.inf)
    if not seen.any():
        return result
    values, vectors = np.linalg.eigh(scaled)
    good = values > SINGULAR * values.max()
    part = (vectors[:, good] / values[good]) @ vectors[:, good].T
    lost = (vectors[:, ~good] ** 2).sum(axis=1) > 1e-6
    scale = np.sqrt(np.diag(matrix)[seen])
    part /= np.outer(scale, scale)
    part[lost, :], part[:, lost] = np.nan, np.nan
    part[lost, lost] = np.inf
    result[np.ix_(seen, seen)] = part
    return result


def normalised(matrix: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the information matrix of the parameters that are seen, its diagonal scaled to 1, and which they are."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    seen = np.isfinite(scale) & (scale > 0.0)
    return np.asarray(matrix[np.ix_(seen, seen)] / np.outer(scale[seen], scale[seen])), seen


def collinear(information: Information) -> list[tuple[str, str, float]]:
    """Return the pairs of parameters that the records hardly separate, strongest first: names and correlation."""
    names, correlation = information.names, information.correlation
    pairs = [(names[i], names[j], float(correlation[i, j])) for i in range(len(names)) for j in range(i)]
    return sorted((pair for pair in pairs if abs(pair[2]) > CORRELATED), key=lambda pair: -abs(pair[2]))


# chi2 of one degree of freedom at 95 %.
PROFILE_RISE = NORMAL_95**2
# The ends of an interval by curvature and by profile disagree when they differ by more than this share of its half.
AGREE = 0.15
# A profile that falls by more than this below its minimum has found a better one.
BETTER, MOST_RESTARTS = 0.01, 5
# First step along a profile: so many standard deviations, at most this share of the range.
FIRST_OF_PROFILE, LONGEST_OF_PROFILE = 0.5, 0.1
# The walk ends where the rise reaches this many thresholds: what the figure shows.
SHOWN_TO = 1.7
# Wanted change of sqrt(rise) from point to point; steps grow and shrink by at most these factors.
WANTED, PROFILE_GROWTH, PROFILE_SHRINKAGE = 0.45, 2.0, 0.4
MOST_OF_PROFILE = 60
# So many points at least stand between the minimum and the crossing, so that the curve is not guessed.
FEWEST_POINTS = 4
# How closely a crossing is found, as a share of the step in which it lies.
CLOSE = 1e-3
# Relative change of chi2 at which a fit along a profile stops: far below what the threshold could see.
PROFILE_TOLERANCE = 1e-7


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
        side = walk(held, points[0], sign * min(FIRST_OF_PROFILE * deviation, LONGEST_OF_PROFILE))
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
            whole[others] = fit(part, whole[others], PROFILE_TOLERANCE) if others.any() else whole[others]
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
    while points[-1].place != edge and points[-1].rise < SHOWN_TO * PROFILE_RISE and len(points) < MOST_OF_PROFILE:
        last = points[-1]
        place = float(np.clip(last.place + step, 0.0, 1.0))
        points.append(held(place, start_at(points, place)))
        change = abs(points[-1].height - last.height)
        if not np.isfinite(change):
            break
        step *= float(np.clip(WANTED / max(change, 1e-9), PROFILE_SHRINKAGE, PROFILE_GROWTH))
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

    above = next((k for k, p in enumerate(side) if p.rise >= PROFILE_RISE), None)
    if above is None:
        return None, []
    ends, tried, height = side[above - 1 : above + 1], [], float(np.sqrt(PROFILE_RISE))

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
    if len(inside) > FEWEST_POINTS or end == middle.place:
        return []
    path = [middle]
    for share in np.arange(1, FEWEST_POINTS + 1) / (FEWEST_POINTS + 1):
        place = middle.place + float(share) * (end - middle.place)
        path.append(held(place, start_at(path, place)))
    return path[1:]
