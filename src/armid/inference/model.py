"""A model fitted to the train records, and refitted from what its whitened residual says about candidates."""

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import cached_property, partial, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError
from armid.estimation.constants import NAMED, Product, products
from armid.estimation.information import information_at, start_changes
from armid.estimation.least_squares import AT_BOUND, MOST_ROUNDS, SETTLED_CHI2, descend, held_by_bound, promised_fall
from armid.inference.candidates import Active, EffectKey, idle
from armid.inference.library import Activation, Library, are_scheduled_alike, calibrated_replays, points_within
from armid.inference.whitening import WhiteRecords
from armid.model import Array, Model
from armid.problem.problem import by_record, with_each
from armid.problem.starts import fits_starts, with_starts

# Relative change of the sum of squares at which a fit stops: far below the 1 that means anything in 10,000 samples.
FIT_TOLERANCE, ROUGHLY = 1e-7, 1e-3
# A change of n_eff ln(chi2) that no comparison of two models tells from none.
UNTOLD = 0.5


@dataclass(frozen=True, eq=False)
class Fit:
    """Hold the declared model with some effects at its least-squares estimate.

    active: the effects that were added. records: the least-squares problem. z: free parameters as shares of their
    range, (n_free,). residual: whitened, measured minus simulated, (n_samples,). constants: by how much each differs
    from its declared value, as a share of it; the records hold them so.
    others: further unknowns that were fitted, see `unknowns.Freed`; the records hold their values. base: the records
    before that, None where there are none.
    """

    active: Active
    records: WhiteRecords
    z: Array
    residual: Array
    constants: Mapping[str, float] = field(default_factory=dict)
    base: WhiteRecords | None = None
    others: tuple[Any, ...] = ()
    _products: dict[tuple[tuple[str, float], ...], tuple[Product, ...]] = field(default_factory=dict)

    @cached_property
    def chi2(self) -> float:
        return float(self.residual @ self.residual)

    @property
    def misfit(self) -> float:
        """Root mean square of the residual in units of the noise, at least 1."""
        return max(1.0, float(np.sqrt(self.chi2 / len(self.residual))))

    @property
    def log_density(self) -> float:
        """Log density of the measured samples, up to a constant of the records."""
        return -0.5 * self.chi2 - self.records.data.log_noise

    @property
    def n_free(self) -> int:
        return len(self.z)

    @property
    def names(self) -> tuple[str, ...]:
        """Public names of the effects."""
        return tuple(key.public for key in self.active)

    @property
    def model(self) -> Model:
        """The compiled model, other candidates at their null included."""
        return self.records.model

    @property
    def x(self) -> Array:
        return self.records.values(self.z)

    @property
    def candidate(self) -> Array:
        return np.asarray(self.records.space.complete(self.x[np.newaxis])[0])

    @property
    def values(self) -> dict[str, float]:
        return dict(zip(self.records.space.free_names, map(float, self.x), strict=True))

    @cached_property
    def independent(self) -> float:
        """How many samples of the residual are independent."""
        return self.records.data.independent(self.residual)

    @cached_property
    def has_arrived(self) -> bool:
        """Whether a further step promises next to nothing of chi2; where that bends sharply, steps only creep."""
        falls = promised_fall(self.jacobian.T @ self.jacobian, self.jacobian.T @ self.residual, self.z,
                              self.records.walls(self.z))  # fmt: skip
        return falls <= ROUGHLY * self.chi2

    @cached_property
    def jacobian(self) -> Array:
        """Whitened derivatives of the signal by z, (n_samples, n_free); most models of a search are never asked."""
        return self.records.plain.residual_and_slopes(self.z)[1]

    @property
    def columns(self) -> Array:
        """What one prior deviation of each further unknown does to the whitened signal, (n_samples, n_unknowns).

        Copied each time: kept with every fit of a search it would take a third of the memory.
        """
        return np.array([f.column for f in self.others]).reshape(len(self.others), len(self.residual)).T

    @cached_property
    def basis(self) -> Array:
        """Orthonormal basis of what the free parameters can do, (n_samples, rank)."""
        return decomposed(self.jacobian)[0]

    @cached_property
    def start_slopes(self) -> Array:
        """What one standard deviation of each measured start does to the whitened signal, (n_samples, n_starts).

        Without columns where records start at rest, or where their starts are fitted.
        """
        changes = list(start_changes(self.records.plain, self.z))
        return np.column_stack(changes) if changes else np.empty((len(self.residual), 0))

    @cached_property
    def noise_half_width(self) -> Array:
        """Half of the 95 % interval of noise alone, SI, (n_free,): that of `identify`, where what is left is noise."""
        weights = [1.0 / level.rms for level in self.records.data.levels]
        return information_at(self.records.replays, self.records.space, self.x, weights=weights).half_width

    def is_at_a_limit(self, key: EffectKey) -> bool:
        """Whether a limit holds a strength of one of its effects; a shape may be as sharp as it can be."""
        held = held_by_bound(self.records.space, self.x)
        return any(is_held and key.owns(name) and self.model.parameters[name].null is not None
                   for name, is_held in zip(self.values, held, strict=True))  # fmt: skip

    @property
    def has_idle_effect(self) -> bool:
        """Whether an effect does nothing at the fit: all its strengths are at their nulls."""
        pairs = zip(self.values.items(), self.records.span, strict=True)
        away = {name: abs(value - null) > AT_BOUND * span for (name, value), span in pairs
                if (null := self.model.parameters[name].null) is not None}  # fmt: skip
        strengths = [[is_away for name, is_away in away.items() if key.owns(name)] for key in self.active]
        return any(own and not any(own) for own in strengths)

    @property
    def deviations(self) -> dict[str, float]:
        """How far each constant within a tolerance is from its declared value, in its standard deviations."""
        return {f.unknown.name.removeprefix(NAMED): f.value for f in self.others if f.unknown.name.startswith(NAMED)}

    def products(self, tolerances: Mapping[str, float]) -> tuple[Product, ...]:
        """Return the constants within tolerances that the records see at the fit, see `products`."""
        known = tuple(tolerances.items())
        if known not in self._products:
            self._products[known] = products(self.records, self.z, tolerances)
        return self._products[known]

    def owned_by(self, key: EffectKey) -> NDArray[np.bool_]:
        return np.array([key.owns(name) for name in self.values], dtype=np.bool_)


def beyond(basis: Array, signals: Array) -> Array:
    """Return what is left of signals, (n_samples,) or (n_samples, n), beyond the reach of an orthonormal basis."""
    return np.asarray(signals - basis @ (basis.T @ signals))


def decomposed(columns: Array) -> tuple[Array, Array]:
    """Return an orthonormal basis of columns, (n_rows, rank), and their pseudoinverse, (n_columns, n_rows).

    Directions below 1e-7 of the largest are rounding.
    """
    scale = np.linalg.norm(columns, axis=0)
    seen = scale > 0.0
    inverse = np.zeros((columns.shape[1], len(columns)))
    if not seen.any():
        return np.empty((len(columns), 0)), inverse
    left, values, right = np.linalg.svd(columns[:, seen] / scale[seen], full_matrices=False)
    good = values > 1e-7 * values[0]
    inverse[seen] = (right[good].T / values[good]) @ left[:, good].T / scale[seen, np.newaxis]
    return np.asarray(left[:, good]), inverse


def fit_from(
    records: WhiteRecords, active: Active, starts: Sequence[Array], rough: bool = False, limit: float = np.inf
) -> Fit:  # fmt: skip
    """Return the best of the least-squares estimates from some starts (shares of the range).

    rough: stop where a step lowers chi2 by less than a thousandth, or where chi2 will not come below the limit.
    The residual is that of all samples, whatever the fit saw.
    Raises ArmidError when every start diverges.
    """
    z = np.empty(0)
    if records.space.free.any():
        tried, tolerance, kept = np.array(starts), ROUGHLY if rough else FIT_TOLERANCE, records.data.estimates
        chi2 = records.chi2(tried)
        good = tried[np.isfinite(chi2)]
        if not len(good):
            raise ArmidError("each start of a fit diverged: other bounds are expected")
        make = partial(descend, records, list(good), tolerance, limit=limit)
        z = make() if kept is None else kept.recalled((tried, chi2, tolerance, limit), make)
    return Fit(tuple(active), records, z, records.plain.residuals(z)[0])


def with_data_of(fit: Fit, library: Library) -> Fit:
    """Return the model of a fit fitted to the data of a library, from where it stands, its constants as declared."""
    records = library.problem(fit.active, fit.values)
    return accurate(fit_from(records, fit.active, [start_of(records, fit.values)]), library)


def accurate_enough(fit: Fit) -> Fit:
    """Return a fit about its own starts whose records are simulated as accurately as their noise asks for."""
    records = fit.records
    each = [ready.record for ready in by_record(records.replays)]
    enough = calibrated_replays(each, fit.model, records.space, fit.values, at_hand=records.replays)
    if are_scheduled_alike(enough, records.replays):
        return with_own_starts(fit)
    # The pieces are those of the fit, whose constants may be others than the record's.
    theirs = {r.record.file: r.calibrations for r in enough}
    replays = with_each(records.replays, lambda ours: replace(ours, calibrations=theirs[ours.record.file]))
    again = fit_from(replace(records, replays=replays), fit.active, [fit.z])
    return with_own_starts(replace(again, constants=fit.constants))


def with_own_starts(fit: Fit, roughly: bool = False) -> Fit:
    """Return a fit about the starts that fit it best, where starts of records are fitted (see problem/starts.py).

    roughly: only as far as a comparison of models can tell, see UNTOLD.
    """
    if not fits_starts(fit.records.replays):
        return fit
    for _ in range(MOST_ROUNDS):
        last, records = fit, replace(fit.records, replays=with_starts(fit.records.replays, fit.candidate))
        fit = replace(fit_from(records, fit.active, [fit.z], rough=roughly), constants=fit.constants)
        untold = UNTOLD / fit.independent if roughly else 0.0
        if np.all(np.abs(fit.z - last.z) <= SETTLED_CHI2) or abs(last.chi2 / fit.chi2 - 1.0) <= max(
            SETTLED_CHI2, untold
        ):
            break
    return fit


def finished(fit: Fit, library: Library) -> Fit:
    """Return the fit at its estimate; where it crept there and has shapes set free, the better one by continuation.

    Its further unknowns are held.
    """

    def from_starts(starts: list[Array]) -> Fit:
        again = fit_from(fit.records, fit.active, starts)
        return replace(again, others=fit.others, base=fit.base) if fit.others else accurate(again, library)

    done = from_starts([fit.z])
    shapes = {name for key in fit.active if key.free_shape for name in library.fixed_shapes(key)}
    shapes |= set(library.own_shapes if library.own_shapes_free else ())
    if not shapes or done.has_arrived:
        return done
    starts = continued(done, shapes)
    again = unless_diverged(lambda: from_starts(starts)) if starts else None
    return done if again is None or done.chi2 < again.chi2 else again


def start_of(records: WhiteRecords, values: Mapping[str, float]) -> Array:
    return np.clip(records.shares(free_values(records, values)), 0.0, 1.0)


def accurate(fit: Fit, library: Library) -> Fit:
    """Return the fit about its own starts, with finer steps where it ended where the engine's are too coarse."""
    finer = library.recalibrated(fit.active, fit.values, fit.misfit)
    again = fit if finer is None else fit_from(started_as(finer, fit), fit.active, [fit.z])
    return with_own_starts(again, roughly=True)


def problem_about(fit: Fit, active: Active, library: Library) -> WhiteRecords:
    """Return the problem with some effects, its records in motion started as those of a fit are."""
    return started_as(library.problem(active, fit.values), fit)


def started_as(problem: WhiteRecords, fit: Fit) -> WhiteRecords:
    """Return a problem whose records in motion start as those of a fit do, before further unknowns move them."""
    if not fits_starts(problem.replays):
        return problem
    pieces = {r.record.file: r.record.pieces for r in (fit.base or fit.records).replays}
    return replace(problem, replays=with_each(problem.replays, lambda ours: replace(
        ours, record=replace(ours.record, pieces=pieces[ours.record.file]))))  # fmt: skip


# Shares of their range from which all shapes begin; then each alone from the best of so many places along its range:
# the best period of a sampled control is narrow; for shapes that are not times an eighth of the places is enough.
STARTS, N_PLACES_OF_SHAPE = (0.03, 0.5), 384
# Values at which a shape is held in turn where a fit only crept, and the fall of chi2 in a step that leads on from one.
N_HELD, LEADING = 8, 1e-2


def continued(fit: Fit, shapes: Set[str]) -> list[Array]:
    """Return for each shape but times the best estimate with it held in turn from its largest value to its least.

    Each begins where the last one ended, the other shapes held as they are: over a wide sign chi2 is smooth, and leads
    to where steps over a narrow one would only creep (continuation).
    """
    records, space = fit.records, fit.records.space
    names = np.array(space.free_names)
    is_shape = np.isin(names, list(shapes))
    starts = []
    for place in np.flatnonzero(is_shape):
        if records.model.parameters[names[place]].unit == "s":
            continue
        z, estimates = fit.z.copy(), []
        low, high = space.low[space.free][place], space.high[space.free][place]
        for value in points_within(low, high, N_HELD)[::-1]:
            z[place] = (value - low) / (high - low)
            values = zip(names[is_shape], records.values(z)[is_shape], strict=True)
            held = reduce(lambda there, shape: there.with_fixed(*shape), values, space)
            problem = replace(records, space=held)
            if np.isfinite(problem.chi2(z[~is_shape])[0]):
                z[~is_shape] = descend(problem, [z[~is_shape]], LEADING)
            estimates.append((float(problem.chi2(z[~is_shape])[0]), z.copy()))
        starts.append(min(estimates, key=lambda one: one[0])[1])
    return starts


def freed(active: Active, key: EffectKey) -> Active:
    return tuple(replace(k, free_shape=True) if k == key else k for k in active)


def with_free_shapes(fit: Fit, key: EffectKey, library: Library, problem: WhiteRecords | None = None) -> Fit:
    """Return the fit with the fixed shapes of one of its effects free, such as the width over which a sign is smoothed.

    A declared shape that is not the machine's leaves a residual that another effect would be taken for.
    """
    active = freed(fit.active, key)
    records = problem_about(fit, active, library) if problem is None else problem
    # The strength has taken up what it could of the shape's part, so that each shape is tried without it too.
    rest = records.shares(at_null(records, fit.candidate, key)[records.space.free])
    return fit_from(records, active, starts_of_shapes(fit, records, library.fixed_shapes(key), [rest]), rough=True)


def starts_of_shapes(
    fit: Fit, records: WhiteRecords, shapes: Sequence[str], rests: Sequence[Array] = ()
) -> list[Array]:
    """Return candidates, as shares of their range, from which the fit of a problem with some more shapes free begins.

    fit: where they are fixed. rests: candidates from which each shape is tried too.
    """
    known, names = dict(zip(fit.records.space.names, fit.candidate, strict=True)), records.space.free_names
    z, free = records.shares(free_values(records, known)), np.isin(names, list(shapes))
    starts = [np.where(free, share, z) for share in STARTS if free.any()]
    units = [records.model.parameters[n].unit for n in names]
    starts += [best_along(records, at, place, N_PLACES_OF_SHAPE if units[place] == "s" else N_PLACES_OF_SHAPE // 8)
               for place in map(int, np.flatnonzero(free)) for at in (z, *rests)]  # fmt: skip
    return [np.clip(z, 1e-3, 1.0 - 1e-3), *starts]


def best_along(records: WhiteRecords, z: Array, place: int, n: int = N_PLACES_OF_SHAPE) -> Array:
    """Return a candidate with one free parameter at its best value on a grid, the others unchanged, (n_free,)."""
    space, tried = records.space, np.tile(z, (n, 1))
    low, high = space.low[space.free][place], space.high[space.free][place]
    tried[:, place] = (points_within(low, high, n) - low) / (high - low)
    return np.asarray(tried[np.argmin(records.chi2(tried))])


def unless_diverged(trial: Callable[[], Fit | None]) -> Fit | None:
    """Return what a fit gives, None where each of its starts diverges or it cannot be composed.

    An estimate does not count where every candidate near it diverges: its uncertainty cannot be found.
    """
    try:
        fit = trial()
    except ArmidError:
        return None
    return None if fit is None or (fit.n_free and not fit.jacobian.any()) else fit


def responses(current: Fit, records: WhiteRecords, grid: Sequence[Activation]) -> Array:
    """Return the change of the whitened signal per full strength of each activation, (n_activations, n_samples)."""
    population = np.tile(candidate_at(records, current.values), (len(grid) + 1, 1))
    for row, activation in zip(population[1:], grid, strict=True):
        for n, value in activation.at(activation.share).items():
            row[records.space.index(n)] = value
    signals = records.whole_signals(population)
    return np.asarray((signals[1:] - signals[0]) / np.array([a.share for a in grid])[:, np.newaxis])


def free_values(records: WhiteRecords, values: Mapping[str, float]) -> Array:
    """Return the free parameters of a problem, SI: given values, the others where they rest, (n_free,)."""
    declared = records.model.parameters
    return np.array([values.get(n, idle(declared[n])) for n in records.space.free_names])


def candidate_at(records: WhiteRecords, values: Mapping[str, float]) -> Array:
    """Return the whole candidate of a problem at some values, as `free_values` takes them, SI, (n_parameters,)."""
    return np.asarray(records.space.complete(free_values(records, values)[np.newaxis])[0])


def at_null(records: WhiteRecords, candidate: Array, key: EffectKey) -> Array:
    model, changed = records.model, candidate.copy()
    for i, name in enumerate(records.space.names):
        if key.owns(name) and model.parameters[name].null is not None:
            changed[i] = idle(model.parameters[name])
    return changed
