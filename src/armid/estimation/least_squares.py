"""Least squares inside the box: the problem, its Jacobian, Levenberg-Marquardt from several starts, the set of starts.

Free parameters stand as shares z of their range, in 0 to 1; residuals are measured minus simulated, weighted. The
engine runs eight candidates in the time of one, so that whatever can be asked at once is one population.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from threading import Lock
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from armid.engine import probes
from armid.errors import ArmidError
from armid.estimation.noise_model import by_sensor, sensor_of
from armid.model import Array, Model
from armid.problem.problem import Replay, output_sizes, signals_of
from armid.problem.space import Space
from armid.problem.starts import fits_starts, likely_candidate, with_starts

S = TypeVar("S")
T = TypeVar("T")
# Step of the differences, as a share of the range: above rounding, below curvature. Ranges of strengths are wide.
STEP = 1e-6
# A parameter this close to its bound, as a share of the range, is held by the bound and not by the records.
AT_BOUND = 1e-5
# Relative fall of chi2 in one step at which a fit has arrived.
TOLERANCE = 1e-9
# A delay this close to a jump of chi2 does not step over it, and lies at least so far from it, in sample intervals.
NEXT_TO_JUMP, OFF_JUMP = 1e-2, 1e-6
# A signal jumps on a side of a point where it changes by more than the residual, and so many times more than on the
# other side.
JUMPS = 10.0


def held_by_bound(space: Space, x: Array) -> NDArray[np.bool_]:
    low, high = space.low[space.free], space.high[space.free]
    margin = AT_BOUND * (high - low)
    return np.asarray((x <= low + margin) | (x >= high - margin))


@dataclass(frozen=True, eq=False)
class LeastSquaresProblem:
    """Pose records and a model as min chi2(z), chi2 = |measured - signals(z)|^2 over the box 0 <= z <= 1.

    A subclass says how signals are weighted.
    """

    replays: tuple[Replay, ...]
    space: Space

    @property
    def model(self) -> Model:
        return self.replays[0].model

    @property
    def span(self) -> Array:
        return self.space.high[self.space.free] - self.space.low[self.space.free]

    def shares(self, x: Array) -> Array:
        return np.asarray((x - self.space.low[self.space.free]) / self.span)

    def values(self, z: Array) -> Array:
        """Return shares of the range as free parameters, SI, never outside the box by rounding."""
        low, high = self.space.low[self.space.free], self.space.high[self.space.free]
        return np.clip(low + z * self.span, low, high)

    def weighted(self, signals: Sequence[Array]) -> Array:
        raise NotImplementedError

    @cached_property
    def measured(self) -> Array:
        return self.weighted([r.measured for r in self.replays])

    def whole(self, Z: Array) -> Array:
        """Return candidates in shares with all their parameters, SI, (n_candidates, n_parameters)."""
        return self.space.complete(self.values(Z))

    def simulated(self, Z: Array) -> list[Array]:
        return signals_of(self.replays, self.whole(Z))

    def signals(self, Z: Array) -> Array:
        """Return weighted simulated signals of candidates in shares, shape (n_candidates, n_samples)."""
        return self.weighted(self.simulated(Z))

    def residuals(self, Z: Array) -> Array:
        """Return measured minus simulated of candidates, (n_candidates, n_samples); NaN where one diverges."""
        return np.asarray(self.measured - self.signals(np.atleast_2d(Z)))

    def chi2(self, Z: Array) -> Array:
        total = np.sum(self.residuals(Z) ** 2, axis=1)
        return np.where(np.isfinite(total), total, np.inf)

    @cached_property
    def jumps(self) -> list[tuple[int, Array, float]]:
        """Where chi2 jumps: place of a free delay, shares inside its range, (n_jumps,), and how far these are apart.

        A held input that is late by whole samples jumps at a sample, which shows it or not.
        """
        late = self.model.delays if self.replays else []
        delays = [i for i, n in enumerate(self.space.free_names) if n in late]
        grids = [piece.manoeuvre for r in self.replays for piece in r.pieces] if delays else []
        held = {m.interval for m in grids if any((i.hold or m.hold) == "zero" for i in self.model.plant.inputs)}
        low, high = self.space.low[self.space.free], self.space.high[self.space.free]
        jumps = []
        for i, interval in product(delays, held):
            late_by = interval * np.arange(low[i] // interval + 1.0, np.ceil(high[i] / interval))
            if late_by.size:
                jumps.append((i, (late_by - low[i]) / self.span[i], float(interval / self.span[i])))
        return jumps

    def nearest_jumps(self, z: Array) -> list[tuple[int, float, float]]:
        """Return the place of each delay, the jump that is next to it, and how far these are apart."""
        return [(i, float(edges[np.argmin(np.abs(edges - z[i]))]), apart) for i, edges, apart in self.jumps]

    def walls(self, z: Array) -> tuple[Array, Array]:
        """Return the shares between which a step stays, (n_free,) each: no delay steps over a jump next to it."""
        low, high = np.zeros(len(z)), np.ones(len(z))
        for i, edge, apart in self.nearest_jumps(z):
            if 0.0 < edge - z[i] + OFF_JUMP * apart < NEXT_TO_JUMP * apart:
                high[i] = min(high[i], edge - OFF_JUMP * apart)
            elif 0.0 < z[i] - edge < NEXT_TO_JUMP * apart:
                low[i] = max(low[i], edge + OFF_JUMP * apart)
        return low, np.maximum(high, low)

    def across(self, z: Array) -> Array:
        """Return the candidates on both sides of the jump that is next to each delay of one, (n_candidates, n_free)."""
        ends = [(i, edge + off * apart) for i, edge, apart in self.nearest_jumps(z) for off in (-OFF_JUMP, OFF_JUMP)]
        sides = np.tile(z, (len(ends), 1))
        for side, (i, end) in zip(sides, ends, strict=True):
            side[i] = end
        return sides

    def residual_and_slopes(self, z: Array) -> tuple[Array, Array]:
        """Return the residual (n_samples,) and d signal / d z (n_samples, n_free), all in one population.

        Where one side of a central difference diverges, or lies over a jump, the other stands alone; where both diverge
        the slope is 0.
        """
        signals = self.signals(np.concatenate([z[np.newaxis], stencil(z)]))
        here, slopes, n = signals[0], slopes_of(signals[1:]), len(z)
        low, high = self.walls(z)
        shifts = np.clip(z, STEP, 1.0 - STEP) - z
        ahead, behind = jumps_of(self.measured - here, signals[1 : 1 + n] - here, signals[1 + n :] - here)
        ahead, behind = ahead & (shifts == 0.0) | (high < 1.0), behind & (shifts == 0.0) | (low > 0.0)
        for i in np.flatnonzero(~np.isfinite(slopes).all(axis=1) | ahead | behind):
            sides = ((signals[1 + i], shifts[i] + STEP, ahead[i]), (signals[1 + n + i], shifts[i] - STEP, behind[i]))
            quotients = [(signal - here) / step for signal, step, is_over in sides
                         if step != 0.0 and not is_over and np.isfinite(signal).all()]  # fmt: skip
            slopes[i] = quotients[0] if quotients and np.isfinite(here).all() else 0.0
        return np.asarray(self.measured - here), np.ascontiguousarray(slopes.T)


def stencil(z: Array) -> Array:
    """Return the candidates of central differences about z, moved inside the box, (2 n_free, n_free)."""
    centre, moves = np.clip(z, STEP, 1.0 - STEP), STEP * np.eye(len(z))
    return np.concatenate([centre + moves, centre - moves])


def jumps_of(residual: Array, ahead: Array, behind: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell of the changes of a signal on both sides of a point, (n, n_samples), which lie over a jump, (n,) each.

    A sampled control acts a whole period later where it misses its sample.
    """
    left = float(np.linalg.norm(residual))
    one, other = (np.linalg.norm(change, axis=-1) for change in (ahead, behind))
    return (one > left) & (one > JUMPS * other), (other > left) & (other > JUMPS * one)


def slopes_of(signals: Array) -> Array:
    """Return d signal / d z from the signals of a stencil, (n_free, n_samples)."""
    n = len(signals) // 2
    return np.asarray((signals[:n] - signals[n:]) / (2.0 * STEP))


@dataclass(frozen=True, eq=False)
class WeightedRecords(LeastSquaresProblem):
    """Weigh the records: chi2(z) = sum over records of weight^2 |residual|^2."""

    weights: tuple[float, ...]

    def weighted(self, signals: Sequence[Array]) -> Array:
        return np.concatenate([w * s for w, s in zip(self.weights, signals, strict=True)], axis=-1)


def weighted_records(
    replays: tuple[Replay, ...], space: Space, weights: Sequence[float] | None = None
) -> WeightedRecords:
    """Return records with weights; None: 1/noise rms, or alike for all where a record has no noise to weigh by.

    The noise of a record is that of all records of its sensor. Alike: 1, or where records hold several outputs 1 over
    the size of the output.
    """
    if weights is None:
        records = [r.record for r in replays]
        levels = [r.noise.rms for r in records]
        groups = by_sensor(records, levels)
        pooled = np.array([np.sqrt(np.mean(np.square(groups[sensor_of(r)]))) for r in records])
        weights = list(1.0 / (pooled if all(levels) else output_sizes(replays)))
    return WeightedRecords(replays, space, tuple(map(float, weights)))


# Starts and parameters are fitted in turn, at most so often, until none moves by more than this share of its range.
MOST_ROUNDS, SETTLED_CHI2 = 12, 1e-4
# How many candidates are spread over the box, and from how many of the best a fit starts.
N_SPREAD, N_STARTS = 512, 4


def refine(
    replays: tuple[Replay, ...],
    space: Space,
    x0: Array,
    weights: Sequence[float] | None = None,
    tolerance: float = 1e-9,
) -> Array:
    """Return the candidate near x0 that minimises sum over records of weight^2 |measured - simulated|^2 in the box.

    Levenberg-Marquardt, see `descend`. A step into a region that diverges is shortened; an estimate that the box holds
    ends on the box exactly.

    Parameters
    ----------
    replays, space
        The records, ready to be simulated, and the box.
    x0 : array, SI, (n_free,)
        Free parameters, moved into the box.
    weights : (n_records,), 1/unit of the record
        None: 1/noise rms, or 1 for all where a record has no noise.
    tolerance : float
        Relative fall of the sum of squares in one step at which to stop.

    Returns
    -------
    array, SI, (n_free,)

    Raises
    ------
    ArmidError
        When the start diverges.
    """
    if not space.free.any():
        return np.empty(0)
    records = weighted_records(replays, space, weights)
    return records.values(fit(records, records.shares(np.asarray(x0, dtype=np.float64)), tolerance))


def estimate(replays: tuple[Replay, ...], space: Space, weights: Sequence[float] | None = None) -> Array:
    """Return the least-squares estimate without a start: the best of fits from the best of candidates over the box.

    Deterministic: see `spread_starts`.

    Parameters
    ----------
    replays, space, weights
        See `refine`.

    Returns
    -------
    array, SI, (n_free,)
        Free parameters.

    Raises
    ------
    ArmidError
        When every candidate diverges.
    """
    if not space.free.any():
        return np.empty(0)
    records = weighted_records(replays, space, weights)
    return records.values(descend(records, spread_starts(records), TOLERANCE, central=True))


def with_fitted_starts(replays: tuple[Replay, ...], space: Space) -> tuple[Replay, ...]:
    """Return replays whose pieces in motion start where the least-squares estimate starts them, others as they are."""
    if not fits_starts(replays):
        return replays
    ready = with_starts(replays, likely_candidate(replays, space))
    x = estimate(ready, space)
    for _ in range(MOST_ROUNDS):
        last, ready = x, with_starts(ready, space.complete(x[np.newaxis])[0])
        x = refine(ready, space, x)
        if np.all(np.abs(x - last) <= SETTLED_CHI2 * (space.high - space.low)[space.free]):
            break
    return ready


def fit(records: LeastSquaresProblem, z0: Array, tolerance: float = TOLERANCE) -> Array:
    """Return the local least-squares estimate from a start, both as shares of the range."""
    start = np.clip(z0, 0.0, 1.0)
    if not np.isfinite(records.chi2(start)[0]):
        raise ArmidError("a fit cannot start where the simulation diverges: another start is expected")
    return descend(records, [start], tolerance, central=True)


def spread_starts(records: LeastSquaresProblem) -> list[Array]:
    """Return from where to look for the estimate: the best 4 of 512 candidates of a Kronecker sequence over the box."""
    n = int(records.space.free.sum())
    spread = probes(np.zeros(n), np.ones(n), N_SPREAD)
    chi2 = records.chi2(spread)
    starts = [spread[i] for i in np.argsort(chi2, kind="stable")[:N_STARTS] if np.isfinite(chi2[i])]
    if not starts:
        raise ArmidError(f"each of {N_SPREAD} candidates spread over the box diverged: other bounds are expected")
    return starts


MOST_ITERATIONS = 50
# Dampings that are tried, as factors of the last best one; where no step helps, all are raised so much.
LADDER, RAISED = (1e-3, 0.1, 1.0, 10.0), 1e3
FIRST_DAMPING, LEAST_DAMPING, LARGEST_DAMPING = 1e-3, 1e-9, 1e6
# A push from an end of the box back inside counts from this share of all slopes on.
LEAST_PUSH = 1e-9
# Two starts that have come this close to each other, in shares of the range, are one.
SAME_POINT = 1e-3
# A path is given up that would not come to a limit with so many times the fall that its slopes promise.
REACH_OF_PATH = 10.0


@dataclass(eq=False)
class Descent:
    """One start on its way down: shares of the range, residual there and its square, damping of the last step."""

    z: Array
    residual: Array
    chi2: float
    damping: float = FIRST_DAMPING
    done: bool = False


def descend(
    records: LeastSquaresProblem, starts: Sequence[Array], tolerance: float, central: bool = False,
    limit: float = np.inf, most: int = MOST_ITERATIONS,
) -> Array:  # fmt: skip
    """Return the best of the least-squares estimates in the box from some starts that do not diverge, (n_free,).

    Levenberg-Marquardt with steps cut at the box, which hold what the box holds (More 1978, doi:10.1007/BFb0067700).
    tolerance: relative fall of chi2 in one step at which a start has arrived. central: take slopes from central
    differences, at twice the price. limit: chi2 that must be in reach, see REACH_OF_PATH; what gives
    up is where it was then. most: steps.
    """
    best = descended(records, np.clip(np.array(starts), 0.0, 1.0), tolerance, central, limit, most)
    while len(sides := records.across(best.z)):
        chi2 = records.chi2(sides)
        if not chi2.min() < best.chi2 * (1.0 - tolerance):
            break
        best = descended(records, sides[[int(np.argmin(chi2))]], tolerance, central, limit, most)
    return best.z


def descended(
    records: LeastSquaresProblem, first: Array, tolerance: float, central: bool, limit: float, most: int
) -> "Descent":  # fmt: skip
    paths = [Descent(z, r, float(r @ r)) for z, r in zip(first, records.residuals(first), strict=True)]
    for _ in range(most):
        moving = [p for p in paths if not p.done]
        if not moving:
            break
        advance(records, moving, tolerance, central, limit)
        apart: list[Descent] = []
        for path in sorted(paths, key=lambda p: p.chi2):
            if all(np.max(np.abs(path.z - better.z), initial=0.0) > SAME_POINT for better in apart):
                apart.append(path)
        paths = apart
    return min(paths, key=lambda p: p.chi2)


def advance(
    records: LeastSquaresProblem, paths: Sequence[Descent], tolerance: float, central: bool, limit: float
) -> None:
    slopes = [records.residual_and_slopes(p.z)[1] for p in paths] if central else forward_slopes(records, paths)
    left = [(p, j.T @ j, j.T @ p.residual, records.walls(p.z)) for p, j in zip(paths, slopes, strict=True)]
    for path, square, slope, walls in left if not central else ():
        falls = promised_fall(square, slope, path.z, walls)
        path.done = falls <= tolerance * path.chi2 or path.chi2 - REACH_OF_PATH * falls > limit
    left = [one for one in left if not one[0].done]
    while left:
        dampings = [[max(f * p.damping, LEAST_DAMPING) for f in LADDER] for p, *_ in left]
        tried = [[step_in_box(square, slope, p.z, d, walls) for d in ds]
                 for (p, square, slope, walls), ds in zip(left, dampings, strict=True)]  # fmt: skip
        residuals = records.residuals(np.concatenate(tried)).reshape(len(left), len(LADDER), -1)
        left = [one for one, z, r, d in zip(left, tried, residuals, dampings, strict=True)
                if not taken(one[0], z, r, d, tolerance)]  # fmt: skip


def taken(path: Descent, tried: Sequence[Array], residuals: Array, dampings: Sequence[float], tolerance: float) -> bool:
    """Move a path to the best of the trials, or raise its damping; tell whether this step is over."""
    chi2 = np.sum(residuals**2, axis=1)
    best = int(np.argmin(np.where(np.isfinite(chi2), chi2, np.inf)))
    before = path.chi2
    if chi2[best] < before:
        path.z, path.residual, path.damping = tried[best], residuals[best].copy(), dampings[best]
        path.chi2 = float(path.residual @ path.residual)
        path.done = before - chi2[best] <= tolerance * before
        return True
    moved = max(float(np.max(np.abs(z - path.z), initial=0.0)) for z in tried)
    path.damping *= RAISED
    path.done = path.damping > LARGEST_DAMPING or moved < tolerance
    return path.done


def promised_fall(square: Array, slope: Array, z: Array, walls: tuple[Array, Array]) -> float:
    """Return by how much a step without damping would lower chi2, to second order.

    square: J^T J, slope: J^T residual.
    """
    step = step_in_box(square, slope, z, LEAST_DAMPING, walls) - z
    return float(2.0 * slope @ step - step @ square @ step)


def step_in_box(square: Array, slope: Array, z: Array, damping: float, walls: tuple[Array, Array]) -> Array:
    """Return the candidate to which a damped step leads.

    The step goes on until a parameter meets an end of the box, and from there with the others; one that is pushed back
    inside goes along again. So each part of it leads down. walls: the ends of the box, see
    `LeastSquaresProblem.walls`; unknowns behind the parameters have none.
    """
    scale = np.diag(square)
    damped = square + np.diag(damping * scale + 1e-12 * max(float(scale.max(initial=0.0)), 1e-300))
    n_others = len(z) - len(walls[0])
    low, high = (np.append(wall, np.full(n_others, end)) for wall, end in zip(walls, (-np.inf, np.inf), strict=True))
    step, sizes = np.zeros(len(z)), np.sqrt(np.diag(damped))
    free = ~((z <= low) & (slope < 0.0) | (z >= high) & (slope > 0.0))
    for _ in range(3 * len(z)):
        known = slope[free] - damped[np.ix_(free, ~free)] @ step[~free]
        more = np.zeros(len(z))
        more[free] = np.linalg.solve(damped[np.ix_(free, free)], known) - step[free]
        end = np.where(more < 0.0, low, high) - z
        shares = np.divide(end - step, more, out=np.full(len(z), np.inf), where=more != 0.0)
        share = max(float(shares.min(initial=np.inf)), 0.0)
        if share < 1.0:
            met = shares <= share
            step = np.where(met, end, step + share * more)
            free &= ~met
            continue
        step += more
        push = np.where(free, 0.0, slope - damped @ step)
        inwards = np.where(z + step <= low, push, -push) / sizes
        if not inwards.max(initial=0.0) > LEAST_PUSH * np.linalg.norm(slope / sizes):
            break
        free[int(np.argmax(inwards))] = True
    return np.clip(z + step, low, high)


def forward_slopes(records: LeastSquaresProblem, paths: Sequence[Descent]) -> list[Array]:
    """Return d signal / d z of every path, (n_samples, n_free), from differences towards the middle of the box.

    Half the price of central differences, and exact enough for a step. A side that diverges is replaced by the other;
    where both do, the slope is 0.
    """
    n = len(paths[0].z)
    walls = [records.walls(p.z) for p in paths]
    signs = np.array([np.where(((p.z > 0.5) | (high < 1.0)) & (low == 0.0), -1.0, 1.0)
                      for p, (low, high) in zip(paths, walls, strict=True)])  # fmt: skip
    points = np.concatenate([p.z + np.diag(STEP * s) for p, s in zip(paths, signs, strict=True)])
    residuals = records.residuals(points)
    slopes = []
    for i, (path, sign) in enumerate(zip(paths, signs, strict=True)):
        columns = (path.residual - residuals[i * n :][:n]) / (STEP * sign)[:, np.newaxis]
        for k in np.flatnonzero(~np.isfinite(columns).all(axis=1)):
            z = path.z.copy()
            z[k] -= sign[k] * STEP
            other = records.residuals(z)[0]
            inside = 0.0 <= z[k] <= 1.0 and bool(np.isfinite(other).all())
            columns[k] = (path.residual - other) / (-sign[k] * STEP) if inside else 0.0
        slopes.append(np.ascontiguousarray(columns.T))
    return slopes


def side_by_side(work: Callable[[S], T], items: Iterable[S], threads: int) -> list[T]:
    """Return the work of each item, in order; the same for any number of threads.

    Fits of several candidates side by side keep two threads busier than the lanes of one fit do.
    """
    tasks = list(items)
    if threads < 2 or len(tasks) < 2:
        return [work(item) for item in tasks]
    # A pool of its own: work that waited for the engine's lanes in the same pool would wait for itself.
    with ThreadPoolExecutor(threads, thread_name_prefix="armid") as pool:
        return list(pool.map(work, tasks))


class Estimates:
    """Keep estimates in a file, one a line, so that a second start of the same search goes on from them."""

    def __init__(self, path: Path) -> None:
        self.path, self._lock = path, Lock()
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else []
        self._known: dict[str, list[float]] = {}
        for line in lines:
            with suppress(ValueError, TypeError):  # the last one may have been cut off
                key, estimate = json.loads(line)
                self._known[key] = [float(value) for value in estimate]

    def __len__(self) -> int:
        return len(self._known)

    def recalled(self, asked: Sequence[object], make: Callable[[], Array]) -> Array:
        """Return the estimate that was made for the same question, else make it and keep it.

        asked: arrays and numbers that stand for records, model and start: sums of squares at the starts are enough, as
        no two problems share all digits.
        """
        parts = (one.tobytes() if isinstance(one, np.ndarray) else repr(one).encode() for one in asked)
        key = hashlib.sha256(b"/".join(parts)).hexdigest()[:32]
        if key in self._known:
            return np.array(self._known[key])
        estimate = make()
        self._known[key] = estimate.tolist()
        # On a disk that is full the search goes on; saving its result says so.
        with self._lock, suppress(OSError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps([key, self._known[key]]) + "\n")
        return estimate
