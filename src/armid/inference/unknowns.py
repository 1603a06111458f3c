"""Unknowns of a fit that are not parameters of the engine: constants within tolerances, sizes of faults, drifts.

Each has a normal prior with a standard deviation of 1 in its own unit: min weight |r(z, v)|^2 + |v|^2 over parameters z
and unknowns v. Both take their steps together (Levenberg, Marquardt). A column of v costs a simulation, so that columns
serve until a step falls short of what they foretell. Where candidates z are only ranked, v takes its best values about
known ones v0 by a projection (Golub, Pereyra 1973, doi:10.1137/0710036): (r + C v0)' (1 + C C')^-1 (r + C v0).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from armid.errors import ArmidError
from armid.estimation.constants import Product, moved_replays, products
from armid.estimation.least_squares import (
    FIRST_DAMPING,
    LADDER,
    LARGEST_DAMPING,
    LEAST_DAMPING,
    MOST_ITERATIONS,
    RAISED,
    REACH_OF_PATH,
    Descent,
    LeastSquaresProblem,
    forward_slopes,
    jumps_of,
    promised_fall,
    step_in_box,
)
from armid.estimation.least_squares import STEP as Z_STEP
from armid.inference.model import ROUGHLY, Fit
from armid.inference.whitening import WhiteRecords
from armid.model import Array
from armid.problem.cover import Cover
from armid.problem.problem import ReadyRecord, signals_of_each, with_each
from armid.problem.starts import fits_starts, with_shown_starts, with_starts

# Step of the differences, in prior standard deviations.
UNKNOWN_STEP = 1e-3
# Of a fit that is polished: relative change at which it ends, and how far inside the box it stays, as a share.
ARRIVED_STEP, INSIDE = 1e-8, 1e-6
# Fall of the weighted sum of squares at which a fit has arrived. Columns are old below this share of a foretold fall.
SETTLED_COST, FORETOLD = 0.1, 0.7
# Most steps of a rough fit: from far away it takes 16 to come near.
MOST_ROUGH = 20


@dataclass(frozen=True, eq=False)
class Unknown:
    """Declare an unknown.

    moved: the records as they are with a value of it; constants are moved together, see `moved`. lost: samples that a
    value leaves out. column: of records, a candidate and a value, how much of the residual a unit of it takes away;
    None: by differences. product: which constants it is, None for other unknowns.
    """

    name: str
    moved: Callable[[WhiteRecords, float], WhiteRecords] = lambda records, _: records
    lost: Callable[[float], float] = lambda _: 0.0
    column: Callable[[WhiteRecords, Array, float], Array] | None = None
    product: Product | None = None


@dataclass(frozen=True, eq=False)
class Freed:
    """Hold an unknown of a fit: its value in prior deviations, and its change of the whitened signal per deviation."""

    unknown: Unknown
    value: float
    column: Array


def constant(product: Product) -> Unknown:
    """Return a constant, or several that act as one, as an unknown whose prior is its tolerance."""
    return Unknown(product.public, product=product)


def shares_of(chosen: Sequence[Product | None], values: Sequence[float] | Array) -> dict[str, float]:
    """Return by which share of its value the first member of each product is off; values: in tolerances."""
    return {p.names[0]: float(v) * p.tolerance for p, v in zip(chosen, values, strict=True) if p is not None}


def constants_of(records: WhiteRecords, z: Array, tolerances: Mapping[str, float]) -> list[Unknown]:
    """Return the constants that records see at a candidate, those that act as one together."""
    return [constant(p) for p in products(records, z, tolerances)] if tolerances else []


@dataclass(frozen=True, eq=False)
class ProjectedRecords(LeastSquaresProblem):
    """Pose records whose further unknowns take their best values at each candidate, about known ones."""

    records: WhiteRecords = field(kw_only=True)
    columns: Array = field(kw_only=True)
    values_known: Array = field(kw_only=True)

    @cached_property
    def cover(self) -> Cover:
        return Cover.of(self.columns)

    @property
    def jumps(self) -> list[tuple[int, Array, float]]:
        return self.records.jumps

    @cached_property
    def measured(self) -> Array:
        return self.cover.white(self.records.measured + self.columns @ self.values_known)

    def signals(self, Z: Array) -> Array:
        return self.cover.white(self.records.signals(Z))


def projected(fit: Fit, problem: WhiteRecords, weight: float) -> LeastSquaresProblem:
    """Return a problem whose further unknowns are those of a fit, with the columns that they have there.

    problem: with the values that the unknowns have in the fit. weight: of each square, see `evidence.Scale`.
    The problem itself where there are none.
    """
    if not fit.others:
        return problem
    return about_known(problem, fit.columns, np.array([f.value for f in fit.others]), weight)


def about_known(records: WhiteRecords, columns: Array, values: Array, weight: float) -> ProjectedRecords:
    """Return records whose further unknowns take their best values, about known ones.

    A square that counts less than 1 leaves the priors more to say: their deviations shrink with its root.
    """
    root = np.sqrt(weight)
    return ProjectedRecords((), records.space, records=records, columns=records.padded(root * columns),
                            values_known=values / root)  # fmt: skip


def moved(records: WhiteRecords, unknowns: Sequence[Unknown], values: Sequence[float] | Array) -> WhiteRecords:
    """Return records with the values of some unknowns, constants last: candidates side by side differ in them."""
    pairs = [(u, float(value)) for u, value in zip(unknowns, values, strict=True) if value != 0.0]
    for unknown, value in pairs:
        records = unknown.moved(records, value)
    shares = shares_of([u.product for u, _ in pairs], [value for _, value in pairs])
    return replace(records, replays=moved_replays(records.replays, shares)) if shares else records


def freed(
    fit: Fit, base: WhiteRecords, unknowns: Sequence[Unknown], weight: float, limit: float = np.inf,
    rough: bool = False, begun: Mapping[str, float] | None = None,
) -> Fit:  # fmt: skip
    """Return a fit with some unknowns freed, from where it stands: min weight |r|^2 + |v|^2.

    base: the records of the fit before any of the unknowns was moved. weight: of each square, see `evidence.Scale`.
    limit: see `descend`. rough: to about where it arrives. begun: where unknowns begin that the fit does not hold, in
    prior deviations, else 0.
    Raises ArmidError where it diverges at its start.
    """
    known = {**(begun or {}), **{f.unknown.name: f.value for f in fit.others}}
    kept = {f.unknown.name: f.column for f in fit.others}
    values, z = np.array([known.get(u.name, 0.0) for u in unknowns]), fit.z
    (cost,), (residual,) = costs_at(base, unknowns, values[np.newaxis], z[np.newaxis], weight)
    if not np.isfinite(cost):
        raise ArmidError("a fit with further unknowns diverges where it starts: other bounds are expected")
    damping, columns, is_new = FIRST_DAMPING, columns_about(base.plain, unknowns, values, z, kept), not kept
    # to first order all candidates have their best starts; a rough fit takes them anew where it ends
    has_starts = fits_starts(base.replays)
    for _ in range(MOST_ROUGH if rough else MOST_ITERATIONS):
        problem = moved(base, unknowns, values)
        here, square, slope = normal_equations(problem, residual, columns, values, z, weight)
        walls = base.walls(z)
        if cost - REACH_OF_PATH * promised_fall(square, slope, here, walls) > limit:
            break
        dampings = [max(factor * damping, LEAST_DAMPING) for factor in LADDER]
        tried = np.array([step_in_box(square, slope, here, d, walls) for d in dampings])
        costs, residuals = costs_at(base, unknowns, tried[:, len(z) :], tried[:, : len(z)], weight)
        best = int(np.argmin(costs))
        fall, step = cost - costs[best], tried[best] - here
        if fall > 0.0:
            z, values, cost, damping = tried[best][: len(z)], tried[best][len(z) :], costs[best], dampings[best]
            residual = residuals[best]
            if has_starts and not rough:
                base = about_starts(base, unknowns, values, z)
                (begun,), (residual,) = costs_at(base, unknowns, values[np.newaxis], z[np.newaxis], weight)
                cost = min(cost, begun)
        elif is_new:
            damping *= RAISED
        has_arrived = weight * fall < max(SETTLED_COST, ROUGHLY * weight * cost if rough else 0.0)
        if is_new and ((has_arrived and fall > 0.0) or damping > LARGEST_DAMPING):
            break
        if is_new and not fall > 0.0:  # columns that were taken here need no others, only a shorter step
            continue
        # Columns serve on while they foretell what a step does.
        is_new = has_arrived or fall < FORETOLD * float(2.0 * slope @ step - step @ square @ step)
        if is_new:
            columns = columns_about(base.plain, unknowns, values, z, {})
    if has_starts and rough:
        base = about_starts(base, unknowns, values, z)
        residual = costs_at(base, unknowns, values[np.newaxis], z[np.newaxis], weight)[1][0]
    return landed(fit, base, unknowns, values, z, residual, columns)


def landed(
    fit: Fit, base: WhiteRecords, unknowns: Sequence[Unknown], values: Array, z: Array, residual: Array, columns: Array,
) -> Fit:  # fmt: skip
    """Return a fit with other values of its parameters and further unknowns; residual: there, see `costs_at`."""
    records = moved(base, unknowns, values)
    others = tuple(Freed(u, float(v), c) for u, v, c in zip(unknowns, values, columns.T, strict=True))
    return replace(fit, records=records, z=z, residual=residual[: len(columns)], base=base,
                   others=others, constants=shares_of([u.product for u in unknowns], values))  # fmt: skip


def polished(fit: Fit, weight: float) -> Fit:
    """Return a fit at its minimum: along a valley that bends, steps that gain next to nothing lead far.

    By a trust region with all slopes taken anew at each step (Branch, Coleman, Li 1999,
    doi:10.1137/S1064827595289108). Fits whose starts follow them stay as they are.
    """
    base = fit.base
    if base is None or fits_starts(base.replays):
        return fit
    unknowns, n = [f.unknown for f in fit.others], len(fit.z)
    steps = np.repeat([Z_STEP, UNKNOWN_STEP], [n, len(unknowns)])
    low, high = (np.append(wall, np.full(len(unknowns), end))
                 for wall, end in zip(base.walls(fit.z), (-np.inf, np.inf), strict=True))  # fmt: skip
    inside = np.clip(fit.z, low[:n] + INSIDE, high[:n] - INSIDE)
    here = np.concatenate([inside, [f.value for f in fit.others]])

    def residuals(X: Array) -> Array:
        whitened = residuals_at(base, unknowns, X[:, n:], X[:, :n])
        return np.asarray(np.hstack([np.sqrt(weight) * whitened, X[:, n:]]))

    def slopes(x: Array) -> Array:
        centre = np.clip(x, low + steps, high - steps)
        sides = residuals(np.concatenate([centre + np.diag(steps), centre - np.diag(steps)]))
        return np.asarray(np.nan_to_num((sides[: len(x)] - sides[len(x) :]) / (2.0 * steps[:, np.newaxis])).T)

    def residual(x: Array) -> Array:
        return np.asarray(residuals(x[np.newaxis])[0])

    solution = least_squares(residual, here, slopes, (low, high), x_scale="jac", max_nfev=MOST_ITERATIONS,
                             ftol=ARRIVED_STEP, xtol=ARRIVED_STEP, gtol=ARRIVED_STEP)  # fmt: skip
    z, values = solution.x[:n], solution.x[n:]
    # what came to the edge of the inside is on the bound
    z = np.clip(z + INSIDE * (2.0 * z - 1.0), low[:n], high[:n])
    V, Z = np.array([[f.value for f in fit.others], values]), np.array([fit.z, z])
    (before, after), (_, there) = costs_at(base, unknowns, V, Z, weight)
    if not after < before:
        return fit
    columns = columns_about(base.plain, unknowns, values, z, {})
    return landed(fit, base, unknowns, values, z, there, columns)


def normal_equations(
    records: WhiteRecords, residual: Array, columns: Array, values: Array, z: Array, weight: float
) -> tuple[Array, Array, Array]:
    """Return all unknowns, parameters first, and half the second and the negative first derivatives of the cost."""
    slopes = np.empty((len(residual), 0))
    if len(z):
        slopes = forward_slopes(records, [Descent(z, residual, float(residual @ residual))])[0]
    jacobian = np.hstack([slopes, records.padded(columns)])
    prior = np.concatenate([np.zeros(len(z)), np.full(len(values), 1.0 / weight)])
    here = np.concatenate([z, values])
    return here, jacobian.T @ jacobian + np.diag(prior), jacobian.T @ residual - prior * here


def about_starts(base: WhiteRecords, unknowns: Sequence[Unknown], values: Array, z: Array) -> WhiteRecords:
    """Return records before any unknown was moved, from the starts that fit best with some values of the unknowns."""
    problem = moved(base, unknowns, values)
    started = with_starts(problem.replays, problem.whole(z[np.newaxis])[0])
    names = base.model.plant.start_constants.values()
    pieces_of = {r.record.file: r.pieces for r in started}

    def begun(ready: ReadyRecord) -> ReadyRecord:
        pieces = []
        for mine, theirs in zip(ready.record.pieces, pieces_of[ready.record.file], strict=True):
            own = {n: theirs.manoeuvre.constants[n] for n in names if n in theirs.manoeuvre.constants}
            pieces.append(replace(mine.with_constants(own), correction=theirs.correction))
        return with_shown_starts(replace(ready, record=replace(ready.record, pieces=tuple(pieces))))

    return replace(base, replays=with_each(base.replays, begun))


def costs_at(
    base: WhiteRecords, unknowns: Sequence[Unknown], V: Array, Z: Array, weight: float
) -> tuple[Array, Array]:  # fmt: skip
    """Return the cost of candidates, (n_candidates,), and their residuals.

    The cost is the sum of squares, the priors and the samples that are left out counted.
    """
    residuals = residuals_at(base, unknowns, V, Z)
    lost = np.array([sum(u.lost(float(v)) for u, v in zip(unknowns, values, strict=True)) for values in V])
    chi2 = np.sum(residuals**2, axis=1)
    # A sample that is left out would have missed by as much as the others do.
    total = chi2 + np.sum(V**2, axis=1) / weight + np.maximum(chi2 / residuals.shape[1], 1.0) * lost
    return np.where(np.isfinite(total), total, np.inf), residuals


def residuals_at(base: WhiteRecords, unknowns: Sequence[Unknown], V: Array, Z: Array) -> Array:
    """Return the whitened residuals of candidates, each with its own values of the unknowns, (n_candidates, n).

    V: (n_candidates, n_unknowns). Candidates are simulated side by side.
    """
    free = np.array([u.product is None for u in unknowns], dtype=np.bool_)
    rest, forms = [u for u in unknowns if u.product is None], []
    for values in dict.fromkeys(map(tuple, V[:, free])):
        forms.append((moved(base, rest, values), np.flatnonzero((V[:, free] == values).all(axis=1))))
    shares = {u.product.names[0]: V[:, i] * u.product.tolerance for i, u in enumerate(unknowns) if u.product}
    signals = signals_of_each([(records.replays, rows) for records, rows in forms], base.whole(Z), shares)
    residuals: dict[int, Array] = {}
    for (records, rows), own in zip(forms, signals, strict=True):
        white = records.with_known(records.data.white(own), Z[rows])
        residuals |= dict(zip(rows.tolist(), records.measured - white, strict=True))
    return np.array([residuals[row] for row in range(len(V))])


def columns_about(
    base: WhiteRecords, unknowns: Sequence[Unknown], values: Array, z: Array, kept: Mapping[str, Array]
) -> Array:
    """Return the change of the whitened signal per deviation of each unknown, (n_samples, n_unknowns).

    kept: columns that are known.
    """
    stepped = [i for i, u in enumerate(unknowns) if u.name not in kept and u.column is None]
    by_steps = stepped_columns(base, unknowns, values, z, stepped) if stepped else {}

    def column(i: int, unknown: Unknown) -> Array:
        if unknown.name in kept:
            return kept[unknown.name]
        if unknown.column is None:
            return np.asarray(by_steps[i])
        rest = moved(base, [u for u in unknowns if u is not unknown], np.delete(values, i))
        return unknown.column(rest, z, float(values[i]))

    columns = np.array([column(i, u) for i, u in enumerate(unknowns)]).reshape(len(unknowns), base.measured.size)
    return np.where(np.isfinite(columns).all(axis=1, keepdims=True), columns, 0.0).T


def stepped_columns(
    base: WhiteRecords, unknowns: Sequence[Unknown], values: Array, z: Array, stepped: Sequence[int]
) -> dict[int, Array]:
    """Return what `columns_about` does of some unknowns, by differences to both sides that do not jump."""
    steps = UNKNOWN_STEP * np.eye(len(values))[stepped]
    points = np.vstack([values, values + steps, values - steps])
    here, *sides = residuals_at(base, unknowns, points, np.tile(z, (len(points), 1)))
    ahead, behind = np.reshape(sides, (2, len(stepped), len(here)))
    over_ahead, over_behind = jumps_of(here, ahead - here, behind - here)
    # one-sided differences of a curved answer would separate a constant from a parameter that does the same
    rises = np.where(over_ahead[:, np.newaxis], here, ahead) - np.where(over_behind[:, np.newaxis], here, behind)
    runs = UNKNOWN_STEP * (2.0 - over_ahead - over_behind)
    return dict(zip(stepped, -rises / runs[:, np.newaxis], strict=True))
