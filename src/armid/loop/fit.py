"""A model fitted to the evidence."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from armid.engine import STANDARD, Calibration, Schedule, probes, simulate
from armid.engine.calibrate import ALLOWED, MARGIN, difference, switch_weights
from armid.errors import ArmidError
from armid.estimation.least_squares import STEP, WeightedRecords
from armid.loop.whitening import WhiteRecords
from armid.model import Manoeuvre, Model
from armid.problem.replay import Replay
from armid.problem.space import Space
from armid.record import Record

# Least squares of the evidence from several starts at once, every call of the engine a whole population.
#
# The engine runs eight candidates in the time of one. So the slopes of all starts are one population, and a step is
# tried with several dampings, all starts together, as another.

Array = NDArray[np.float64]
MOST_STEPS = 50
# Dampings that are tried beside the last that was best, as factors of it; where none helps, all are raised so much.
LADDER, RAISED = (1e-3, 0.1, 1.0, 10.0), 1e3
FIRST, LEAST, LARGEST = 1e-3, 1e-9, 1e6
# Two starts that have come this close to each other, in shares of the range, are one.
SAME = 1e-3


@dataclass(eq=False)
class Descent:
    """Hold one start on its way down.

    z: shares of the range, (n_free,). residual: simulated minus measured, (n_samples,). damping: of the last step.
    """

    z: Array
    residual: Array
    damping: float = FIRST
    done: bool = False

    @property
    def chi2(self) -> float:
        """Sum of squares."""
        return float(self.residual @ self.residual)


def descend(records: WeightedRecords, starts: Sequence[Array], tolerance: float) -> Array:
    """Return the best of the least-squares estimates in the box from some starts that hold, (n_free,).

    Levenberg-Marquardt with steps cut at the box, which hold what the box holds (More 1978, doi:10.1007/BFb0067700).
    starts: shares of the range. tolerance: relative fall of chi2 in one step at which a start has arrived.
    """
    first = np.clip(np.array(starts), 0.0, 1.0)
    paths = [Descent(z, r) for z, r in zip(first, records.signals(first) - records.measured, strict=True)]
    for _ in range(MOST_STEPS):
        moving = [p for p in paths if not p.done]
        if not moving:
            break
        advance(records, moving, tolerance)
        paths = apart(paths)
    return min(paths, key=lambda p: p.chi2).z


def advance(records: WeightedRecords, paths: Sequence[Descent], tolerance: float) -> None:
    """Take one step on every path."""
    forms = [(j.T @ j, j.T @ p.residual) for p, j in zip(paths, slopes(records, paths), strict=True)]
    left = list(zip(paths, forms, strict=True))
    while left:
        dampings = [[max(f * p.damping, LEAST) for f in LADDER] for p, _ in left]
        tried = [[step_in_box(*form, p.z, d) for d in ds] for (p, form), ds in zip(left, dampings, strict=True)]
        found = records.signals(np.concatenate(tried)) - records.measured
        left = [
            pair for i, pair in enumerate(left)
            if not taken(pair[0], tried[i], found[i * len(LADDER) :][: len(LADDER)], dampings[i], tolerance)
        ]  # fmt: skip


def taken(path: Descent, tried: Sequence[Array], residuals: Array, dampings: Sequence[float], tolerance: float) -> bool:
    """Move a path to the best of the trials, or raise its damping; tell whether this step is over."""
    chi2 = np.sum(residuals**2, axis=1)
    best = int(np.argmin(np.where(np.isfinite(chi2), chi2, np.inf)))
    before = path.chi2
    if chi2[best] < before:
        path.z, path.residual, path.damping = tried[best], residuals[best].copy(), dampings[best]
        path.done = before - chi2[best] <= tolerance * before
        return True
    moved = max(float(np.max(np.abs(z - path.z), initial=0.0)) for z in tried)
    path.damping *= RAISED
    path.done = path.damping > LARGEST or moved < tolerance
    return path.done


def step_in_box(square: Array, slope: Array, z: Array, damping: float) -> Array:
    """Return the candidate to which a damped step leads; a parameter that would leave the box stops on it, and the
    others are told.

    square, slope: J^T J and J^T r, r simulated minus measured.
    """
    scale = np.diag(square)
    damped = square + np.diag(damping * scale + 1e-12 * max(float(scale.max(initial=0.0)), 1e-300))
    step = np.zeros(len(z))
    free = ~((z <= 0.0) & (slope > 0.0) | (z >= 1.0) & (slope < 0.0))
    while free.any():
        known = slope[free] + damped[np.ix_(free, ~free)] @ step[~free]
        step[free] = -np.linalg.solve(damped[np.ix_(free, free)], known)
        outside = free & ((z + step < 0.0) | (z + step > 1.0))
        if not outside.any():
            break
        step[outside] = np.clip(z + step, 0.0, 1.0)[outside] - z[outside]
        free &= ~outside
    return np.clip(z + step, 0.0, 1.0)


def slopes(records: WeightedRecords, paths: Sequence[Descent]) -> list[Array]:
    """Return d residual / d z of every path, (n_samples, n_free), from differences towards the middle of the box.

    A side that diverges is replaced by the other; where both do, the slope is 0.
    """
    n = len(paths[0].z)
    signs = np.array([np.where(p.z > 0.5, -1.0, 1.0) for p in paths])
    points = np.concatenate([p.z + np.diag(STEP * s) for p, s in zip(paths, signs, strict=True)])
    signals = records.signals(points) - records.measured
    found = []
    for i, (path, sign) in enumerate(zip(paths, signs, strict=True)):
        columns = (signals[i * n :][:n] - path.residual) / (STEP * sign)[:, np.newaxis]
        for k in np.flatnonzero(~np.isfinite(columns).all(axis=1)):
            columns[k] = other_side(records, path, int(k), -float(sign[k]))
        found.append(np.ascontiguousarray(columns.T))
    return found


def other_side(records: WeightedRecords, path: Descent, k: int, sign: float) -> Array:
    """Return the slope by one parameter from the side that is left, 0 where it diverges or lies outside the box."""
    z = path.z.copy()
    z[k] += sign * STEP
    signal = records.signals(z[np.newaxis])[0] - records.measured
    inside = 0.0 <= z[k] <= 1.0 and bool(np.isfinite(signal).all())
    return np.asarray((signal - path.residual) / (sign * STEP)) if inside else np.zeros_like(signal)


def apart(paths: Sequence[Descent]) -> list[Descent]:
    """Return paths without those that have met a better one."""
    kept: list[Descent] = []
    for path in sorted(paths, key=lambda p: p.chi2):
        if all(np.max(np.abs(path.z - other.z), initial=0.0) > SAME for other in kept):
            kept.append(path)
    return kept


# Relative change of the sum of squares at which a fit stops: far below the 1 that means anything in 10,000 samples.
TOLERANCE = 1e-7
N_SPREAD, N_STARTS = 512, 4
ONLY_NOISE = 0.01


@dataclass(frozen=True, eq=False)
class Fit:
    """Hold the declared model with some effects at its least-squares estimate.

    active: names of the effects that were added. records: the least-squares problem. z: free parameters as shares of
    their range, (n_free,). residual: whitened, measured minus simulated, (n_samples,). jacobian: whitened derivatives
    of the signal by z, (n_samples, n_free).
    """

    active: tuple[str, ...]
    records: WhiteRecords
    z: Array
    residual: Array
    jacobian: Array

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened residual."""
        return float(self.residual @ self.residual)

    @property
    def n_free(self) -> int:
        """Number of parameters that were fitted."""
        return len(self.z)

    @property
    def x(self) -> Array:
        """Free parameters, SI, (n_free,)."""
        return self.records.values(self.z)

    @property
    def candidate(self) -> Array:
        """Return the whole candidate of the problem's model, SI."""
        return np.asarray(self.records.space.complete(self.x[np.newaxis])[0])

    @property
    def values(self) -> dict[str, float]:
        """Name -> value of the free parameters, SI."""
        return dict(zip(self.records.space.free_names, map(float, self.x), strict=True))

    @cached_property
    def independent(self) -> float:
        """How many samples of the residual are independent."""
        return self.records.evidence.independent(self.residual)

    @property
    def is_noise(self) -> bool:
        """Whether the size of the residual is that of the noise: chi2 per sample not above 1 by chance of 1 %."""
        level, n = self.records.evidence.levels[0], len(self.residual) - self.n_free
        return level.known and bool(f_distribution.sf(self.chi2 / n, n, level.n_slow) > ONLY_NOISE)

    @cached_property
    def basis(self) -> Array:
        """Orthonormal basis of what the free parameters can absorb, (n_samples, rank)."""
        return self._decomposed[0]

    @cached_property
    def answer(self) -> Array:
        """How the free parameters answer to a change of the whitened signal, (n_free, n_samples)."""
        return self._decomposed[1]

    @cached_property
    def _decomposed(self) -> tuple[Array, Array]:
        return decomposed(self.jacobian)

    def column_names(self) -> list[str]:
        """Return which key each free parameter belongs to, the name of the parameter where it is the plant's own."""
        return [n.partition(".")[0] for n in self.values]


def span(columns: Array) -> Array:
    """Return an orthonormal basis of columns; directions below 1e-7 of the largest are rounding."""
    return decomposed(columns)[0]


def decomposed(columns: Array) -> tuple[Array, Array]:
    """Return an orthonormal basis of columns (see `span`), and their pseudoinverse, (n_columns, n_rows)."""
    scale = np.linalg.norm(columns, axis=0)
    seen = scale > 0.0
    inverse = np.zeros((columns.shape[1], len(columns)))
    if not seen.any():
        return np.empty((len(columns), 0)), inverse
    left, values, right = np.linalg.svd(columns[:, seen] / scale[seen], full_matrices=False)
    good = values > 1e-7 * values[0]
    inverse[seen] = (right[good].T / values[good]) @ left[:, good].T / scale[seen, np.newaxis]
    return np.asarray(left[:, good]), inverse


def fit_from(records: WhiteRecords, active: Sequence[str], starts: Sequence[Array]) -> Fit:
    """Return the best of the least-squares estimates from some starts (shares of the range).

    Raises ArmidError when every start diverges.
    """
    if not records.space.free.any():
        return evaluated(records, active, np.empty(0))
    good = [z for z, chi2 in zip(starts, records.chi2(np.array(starts)), strict=True) if np.isfinite(chi2)]
    if not good:
        raise ArmidError("each start of a fit diverged: other bounds are expected")
    return evaluated(records, active, descend(records, good, TOLERANCE))


def evaluated(records: WhiteRecords, active: Sequence[str], z: Array) -> Fit:
    """Return residual and slopes at free parameters, on all samples, whatever the fit saw."""
    whole = records if records.evidence.kept.all() else records.whole()
    residual, slopes = whole.residual_and_slopes(z)
    return Fit(tuple(active), records, z, -residual, slopes)


def fit_globally(records: WhiteRecords, active: Sequence[str]) -> Fit:
    """Return the least-squares estimate without a start.

    Deterministic: 512 candidates of a Kronecker sequence over the box, fits from the four best of them.

    Raises ArmidError when every candidate diverges.
    """
    n = int(records.space.free.sum())
    if n == 0:
        return evaluated(records, active, np.empty(0))
    spread = probes(np.zeros(n), np.ones(n), N_SPREAD)
    order = np.argsort(records.chi2(spread), kind="stable")[:N_STARTS]
    return fit_from(records, active, [spread[i] for i in order])


N_PROBES = 16
NEAR = 2.0
SUBSTEPS = (1, 2, 4, 8)


def made_ready(records: Sequence[Record], model: Model, space: Space, near: Mapping[str, float]) -> tuple[Replay, ...]:
    """Make records ready to be simulated, on the engine's standard accuracy: the evidence's noise hides its error.

    near: values about which it is calibrated.
    """
    spread = space.complete(probes(*neighbourhood(space, near), N_PROBES))
    known: dict[object, Calibration] = {}
    ready = []
    for record in records:
        pieces = tuple(p.until_window_end() for p in record.pieces)
        keys = [p.manoeuvre.likeness() for p in pieces]
        for key, piece in zip(keys, pieces, strict=True):
            if key not in known:
                known[key] = quickly_calibrated(model, piece.manoeuvre, spread)
        ready.append(Replay(record, model, pieces, tuple(known[key] for key in keys)))
    return tuple(ready)


def joined(alone: Sequence[WhiteRecords | None], model: Model) -> tuple[Replay, ...] | None:
    """Return records on the finest of the schedules that were found for each of several candidates alone.

    None where one of them was not tried alone, or with another model. A fit looks again where it ends.
    """
    known = [a.replays for a in alone if a is not None and a.replays[0].model is model]
    if len(known) < max(len(alone), 2):
        return None
    return tuple(with_finest(same) for same in zip(*known, strict=True))


def with_finest(replays: Sequence[Replay]) -> Replay:
    """Return a record with the finest of the schedules of each piece."""
    each = zip(*(r.calibrations for r in replays), strict=True)
    finest = tuple(max(c, key=lambda one: one.schedule.substeps) for c in each)
    first = replays[0]
    return Replay(first.record, first.model, first.pieces, finest)


def neighbourhood(space: Space, near: Mapping[str, float]) -> tuple[Array, Array]:
    """Return bounds of the free parameters, those with a known value within a factor of 2 of it."""
    low, high = space.low[space.free].copy(), space.high[space.free].copy()
    for i, name in enumerate(space.free_names):
        if name in near:
            ends = sorted((near[name] / NEAR, near[name] * NEAR))
            low[i], high[i] = max(low[i], ends[0]), min(high[i], ends[1])
    return low, np.maximum(high, low)


def quickly_calibrated(model: Model, manoeuvre: Manoeuvre, spread: Array) -> Calibration:
    """Return the coarsest of few schedules whose error on the candidates stays within half of the standard one.

    `calibrate` would go on to steps that a screening of candidates cannot pay (a ripple so fine that the motion is a
    matter of chance asks for 128 in a sample), and would look for steps over several samples.
    """
    allowed = ALLOWED[STANDARD] * model.plant.scales.speed
    runs = {n: simulate(model, manoeuvre, spread, Schedule(n)) for n in SUBSTEPS[:2]}
    for n in SUBSTEPS:
        runs[2 * n] = runs.get(2 * n) or simulate(model, manoeuvre, spread, Schedule(2 * n))
        error = difference(runs[n], runs[2 * n]) * 16 / 15
        if error <= MARGIN * allowed and not (runs[n].failed & ~runs[2 * n].failed).any():
            break
    return Calibration(Schedule(n, weights=switch_weights(spread, runs[n])), error, bool(error <= allowed))


S = TypeVar("S")
T = TypeVar("T")


def side_by_side(work: Callable[[S], T], items: Iterable[S], threads: int) -> list[T]:
    """Return the work of each item, in order; the same for any number of threads.

    Fits of several candidates side by side keep two threads busier than the lanes of one fit do: measured on the arm,
    1.7 of two against 1.3.
    """
    todo = list(items)
    if threads < 2 or len(todo) < 2:
        return [work(item) for item in todo]
    # A pool of its own: work that waited for the engine's lanes in the same pool would wait for itself.
    with ThreadPoolExecutor(threads, thread_name_prefix="armid") as pool:
        return list(pool.map(work, todo))
