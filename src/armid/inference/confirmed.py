"""What the records know of the unknowns of a fit, as far as simulations confirm it.

Slopes are differences, and those of a motion with sharp friction hold the engine's rounding. Where parameters and
constants make up for each other exactly (inertia, friction and resistance of a motor), that rounding alone would tell
them apart, and an interval would not hold. So the unknowns are moved along each principal axis of their posterior.
"""

import numpy as np

from armid.inference.model import Fit
from armid.inference.unknowns import residuals_at
from armid.model import Array

# How far along an axis, in posterior deviations; rounds, as a wider axis is looked at again.
FAR, MOST_ROUNDS = 2.0, 4
# Share of the rise of the sum of squares that slopes foretell from which they are believed, and the least that matters.
BELIEVED, LEAST = 0.5, 0.05
# Share of its range from a bound within which the bound holds a parameter.
HELD = 1e-4


def confirmed(fit: Fit, columns: Array, flat: Array, weight: float) -> Array:
    """Return columns whose squares give the information on the unknowns that simulations confirm, (n_samples, n).

    columns: whitened slopes by the free parameters, the further unknowns of the fit, and what it holds, (n_samples, n).
    flat: prior precision of each, (n,). weight: of each square, see `evidence.Scale`.
    """
    n_free, n = fit.n_free, fit.n_free + len(fit.others)
    if not n_free:
        return columns
    base = fit.base if fit.base is not None and fit.others else fit.records
    base, unknowns = base.plain, [f.unknown for f in fit.others]
    here, root = np.concatenate([fit.z, [f.value for f in fit.others]]), np.sqrt(weight)
    # What a bound holds stays there.
    stays = np.append(np.minimum(fit.z, 1.0 - fit.z) < HELD, np.zeros(n - n_free, dtype=np.bool_))
    for _ in range(MOST_ROUNDS):
        axes = principal_axes(columns, flat, weight, n)
        moves = np.where(stays[:, np.newaxis], 0.0, FAR * axes)
        shares = room(here[:n_free], moves[:n_free])
        moves = shares * moves
        rows = np.concatenate([here + moves.T, here - moves.T])
        residuals = residuals_at(base, unknowns, rows[:, n_free:], rows[:, :n_free])
        along = root * columns[:, :n] @ axes
        trios = root * np.stack([residuals[:n], residuals[n:], np.tile(fit.residual, (n, 1))], axis=1)
        squares = [left(along, i, trio) for i, trio in enumerate(trios)]
        rise = np.array([0.5 * (above + below) - middle for above, below, middle in squares])
        foretold = weight * np.sum((columns[:, :n] @ moves) ** 2, axis=0)
        matters = np.isfinite(rise) & (foretold > LEAST * shares**2)
        believed = np.where(matters, np.clip(rise / np.maximum(foretold, 1e-300), 0.0, 1.0), 1.0)
        if (believed >= BELIEVED).all():
            break
        kept = np.where(believed < BELIEVED, np.sqrt(believed), 1.0)
        changed = columns[:, :n] @ (axes * kept) @ np.linalg.inv(axes)
        columns = np.hstack([changed, columns[:, n:]])
    return columns


def left(along: Array, i: int, residuals: Array) -> Array:
    """Return the squares of residuals, (n_residuals, n_samples), that the slopes along all axes but one cannot take up.

    The ways on which unknowns make up for each other bend: what a straight one leaves the others answer, as far as
    their priors let them. along: per posterior deviation, so that what the records do not know of an axis is prior.
    """
    others = np.delete(along, i, axis=1)
    square, mixed = others.T @ others, residuals @ others
    answer = np.linalg.solve(square + np.diag(np.maximum(1.0 - np.diag(square), 1e-9)), mixed.T)
    return np.asarray(np.sum(residuals**2, axis=1) - np.sum(mixed.T * answer, axis=0))


def principal_axes(columns: Array, flat: Array, weight: float, n: int) -> Array:
    """Return the principal axes of the first n unknowns, one posterior deviation long each, as columns, (n, n)."""
    covariance = np.linalg.inv(weight * columns.T @ columns + np.diag(flat))[:n, :n]
    sizes = np.sqrt(np.diag(covariance))
    squares, vectors = np.linalg.eigh(covariance / np.outer(sizes, sizes))
    return np.asarray(sizes[:, np.newaxis] * vectors * np.sqrt(np.maximum(squares, 1e-12)))


def room(z: Array, moves: Array) -> Array:
    """Return which share of each move, (n_free, n), stays in the box on either side, (n,)."""
    sizes, ends = np.abs(moves), np.minimum(z, 1.0 - z)[:, np.newaxis]
    return np.asarray(np.min(np.where(sizes > ends, ends / np.maximum(sizes, 1e-300), 1.0), axis=0))
