"""Least squares of the evidence from several starts at once, every call of the engine a whole population.

The engine runs eight candidates in the time of one. So the slopes of all starts are one population, and a step is tried
with several dampings, all starts together, as another.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armid.identifiability import WeightedRecords
from armid.identifiability.weighted import STEP

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
