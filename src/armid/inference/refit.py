"""How the whitened signal answers to candidates about a fit, and refits from the starts that this gives."""

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import replace
from functools import reduce

import numpy as np

from armid.errors import ArmidError
from armid.estimation.least_squares import descend
from armid.inference.candidates import Active, EffectKey, idle
from armid.inference.library import Activation, Library, points_within
from armid.inference.model import Fit, fit_from, with_own_starts
from armid.inference.whitening import WhiteRecords
from armid.model import Array


def finished(fit: Fit, library: Library) -> Fit:
    """Return the fit at its estimate; where it crept there and has shapes set free, the better one by continuation.

    Its further unknowns are held.
    """

    def from_starts(starts: list[Array]) -> Fit:
        again = fit_from(fit.records, fit.active, starts)
        return replace(again, others=fit.others, base=fit.base) if fit.others else accurate(again, library)

    done = from_starts([fit.z])
    shapes = {name for key in fit.active if key.free_shape for name in library.fixed_shapes(key)}
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
    return with_own_starts(fit if finer is None else fit_from(finer, fit.active, [fit.z]), roughly=True)


# Shares of their range from which all shapes begin; then each alone from the best of so many places along its range:
# the best period of a sampled control is narrow; for shapes that are not times an eighth of the places is enough.
STARTS, N_PLACES = (0.03, 0.5), 384
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
    records = library.problem(active, fit.values) if problem is None else problem
    known = dict(zip(fit.records.space.names, fit.candidate, strict=True))
    z = records.shares(np.array([known[n] for n in records.space.free_names]))
    free = np.array([n in library.fixed_shapes(key) for n in records.space.free_names])
    starts = [np.where(free, share, z) for share in STARTS]
    # The strength has taken up what it could of the shape's part, so that each shape is tried without it too.
    rest = records.shares(at_null(records, fit.candidate, key)[records.space.free])
    units = [records.model.parameters[n].unit for n in records.space.free_names]
    starts += [best_along(records, at, place, N_PLACES if units[place] == "s" else N_PLACES // 8)
               for place in map(int, np.flatnonzero(free)) for at in (z, rest)]  # fmt: skip
    return fit_from(records, active, [np.clip(z, 1e-3, 1.0 - 1e-3), *starts], rough=True)


def best_along(records: WhiteRecords, z: Array, place: int, n: int = N_PLACES) -> Array:
    """Return a candidate with one free parameter at its best value on a grid, the others unchanged, (n_free,)."""
    tried = np.tile(z, (n, 1))
    tried[:, place] = (np.arange(n) + 0.5) / n
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
