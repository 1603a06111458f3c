"""Score candidate effects at a fit: by how much each would lower the residual, or bias a parameter unseen."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from scipy.special import chdtrc

from armid.estimation.least_squares import descend
from armid.inference.library import Activation, EffectKey, Library, activation_grid, idle
from armid.inference.model import UNTOLD, Fit, beyond
from armid.inference.whitening import WhiteRecords
from armid.model import Array

# A refit may start from so many points of the grid of each candidate.
N_TRIED = 8
# Of so many leading candidates it is asked whether they are the same to the records.
MOST_TWINS = 16
# A fall of chi2 that is not noticed among so many candidates.
UNSEEN = 12.0
# Share of the range whose secant is a slope; relative changes of a parameter that are tried, the largest first; by what
# factor a promise has to exceed what is proven; relative fall of chi2 in one step at which such a fit has arrived.
SLIGHT, SIZES, MORE, PROVED = 1e-4, (0.3, 0.1, 0.03, 0.012), 1.5, 1e-4


@dataclass(frozen=True, eq=False)
class Score:
    """Hold what a candidate would do to the residual of a fit.

    drop: predicted fall of chi2. p: chance of such a drop from noise alone, for one candidate, its grid of shapes
    counted. starts: free parameters of the extended model from which to refit (shares of the range), best first.
    n_shapes: grid of shapes.
    biases: by how much the effect could bias each free parameter unseen, to first order, SI, (n_free,).
    share: length of its sensitivity after projection off the parameters' as a share of that before. alignment: cosine
    between what is left of it and what is left of the residual; its square is the share of the residual that an
    unbounded amplitude would remove. twin: a candidate with a larger drop that would do the same, so that the records
    cannot tell them apart; None for none.
    """

    key: EffectKey
    drop: float
    p: float
    starts: tuple[Array, ...]
    n_shapes: int
    biases: Array
    share: float
    alignment: float
    twin: EffectKey | None = None


def scores(current: Fit, library: Library) -> list[Score]:
    """Return what each candidate would do, the largest drop of chi2 first."""
    each = library.each(lambda key: score(current, key, library), library.joinable(current.active))
    found = sorted((pair for pair in each if pair is not None), key=lambda pair: -pair[0].drop)
    distinct: list[tuple[Score, Array]] = []
    for i, (own, change) in enumerate(found[:MOST_TWINS]):
        twins = (s.key for s, other in distinct if s.n_shapes == own.n_shapes and is_same(change, other))
        found[i] = replace(own, twin=next(twins, None)), change
        distinct += [found[i]] if found[i][0].twin is None else []
    return [own for own, _ in found]


def score(current: Fit, key: EffectKey, library: Library) -> tuple[Score, Array] | None:
    """Score one candidate at a fit; None where nothing can be said, as every strength diverges or changes nothing.

    Return what it would change of the whitened signal, too, beyond what the parameters could do, (n_samples,).

    The secant from null to each strength, divided by it, stands for the sensitivity there; projected off the
    sensitivities to the free parameters, so that what these can absorb does not count. All strengths and shapes run as
    one population. The amplitude is clipped to the range of the effect.
    """
    records = library.problem((*current.active, key), current.values)
    grid, n_shapes = activation_grid(records, key)
    moved = responses(current, records, grid)
    rest = rest_of(current)
    drops, amplitudes = predicted(current, moved, rest)
    if not np.isfinite(drops).any():
        return None
    answers = (current.answer @ moved.T).T
    order = np.argsort(-drops, kind="stable")[: N_TRIED // 2]
    # Each from the predicted amplitude, and from the strength that was tried.
    starts = [moved_start(records, current, grid[i], answers[i], share)
              for i in order for share in (max(amplitudes[i], 0.01), grid[i].share)]  # fmt: skip
    best = int(order[0])
    drop = float(drops[best])
    # n_eff ln(chi2 / (chi2 - drop)), see `fit.criterion`
    left = max(current.chi2 - drop, 1e-9 * current.chi2)
    ratio = float(current.independent * np.log(current.chi2 / left))
    p = min(1.0, n_shapes * float(chdtrc(1, max(ratio, 0.0))))
    biases = unseen_biases(current, moved, answers)
    free = beyond(current.basis, moved[best])
    length, whole = float(np.linalg.norm(free)), float(np.linalg.norm(moved[best]))
    product = length * float(np.linalg.norm(rest))
    alignment = float(free @ rest) / product if product > 0.0 else 0.0
    share = length / whole if whole > 0.0 else 0.0
    return Score(key, drop, p, tuple(starts), n_shapes, biases, share, alignment), amplitudes[best] * free


def is_same(one: Array, other: Array) -> bool:
    """Tell whether two whitened signals are so near to each other that no comparison of models tells them apart."""
    return float(np.sum((one - other) ** 2)) < UNTOLD


def responses(
    current: Fit, records: WhiteRecords, grid: Sequence[Activation], without: EffectKey | None = None
) -> Array:
    """Return the change of the whitened signal per full strength of each activation, (n_activations, n_samples).

    without: an effect of the fit that is put to its null before.
    """
    rest = candidate_at(records, current.values)
    population = np.tile(rest if without is None else at_null(records, rest, without), (len(grid) + 1, 1))
    for row, activation in zip(population[1:], grid, strict=True):
        for n, value in activation.at(activation.share).items():
            row[records.space.index(n)] = value
    signals = records.whole_signals(population)
    return np.asarray((signals[1:] - signals[0]) / np.array([a.share for a in grid])[:, np.newaxis])


def unseen_biases(current: Fit, moved: Array, answers: Array) -> Array:
    """Return the largest change of each free parameter, SI, that strengths within the range could cause unseen.

    A strength a adds a^2 q to chi2, q the squared length of the change of the signal beyond the reach of the
    parameters; below UNSEEN it is not noticed, while the parameters make up for the rest.
    moved: change of the whitened signal per full strength, (n_activations, n_samples). answers: of the parameters to
    it, (n_activations, n_free).
    """
    good = np.isfinite(moved).all(axis=1)
    if not current.n_free or not good.any():
        return np.zeros(current.n_free)
    share = np.minimum(1.0, unseen_strengths(current, moved[good]))
    return np.asarray(np.max(np.abs(answers[good]) * share[:, np.newaxis], axis=0) * current.records.span)


def unseen_strengths(current: Fit, moved: Array) -> Array:
    """Return the strength up to which each activation is not noticed, see `unseen_biases`, (n_activations,)."""
    return np.asarray(np.sqrt(UNSEEN / np.maximum(square_beyond(current.basis, moved), 1e-12)))


def proven_biases(current: Fit, library: Library, least: float) -> dict[str, Array]:
    """Return by how much candidates could bias the free parameters unseen, SI, {public name: (n_free,)}.

    A bias is proven by a fit: the parameters are fitted beside a strength of the effect, and chi2 rises by no more than
    UNSEEN. That holds where the motion answers to strengths along a curve, which secants leave (see `unseen_biases`).
    Those that promise most come first; what promises hardly more than is proven already is not asked.
    least: relative change of a parameter below which none is looked for.
    """
    library = library.about(current.records.replays, current.misfit)
    each = library.each(lambda key: promised_biases(current, library, key), library.joinable(current.active))
    found: dict[str, Array] = {}
    known = np.zeros(current.n_free)
    for promise in sorted(chain.from_iterable(each), key=lambda p: -float(p.sizes.max(initial=0.0))):
        if np.any(promise.sizes > np.maximum(least, MORE * known)):
            bias = proven_bias(current, promise)
            name = promise.key.public
            found[name] = np.maximum(bias, found.get(name, 0.0))
            known = np.maximum(known, bias / magnitudes(current))
    return found


@dataclass(frozen=True, eq=False)
class Promise:
    """Hold what one shape and sign of a candidate promises to first order.

    records: the problem with the candidate. limit: chi2 up to which it is not noticed. answer: of the parameters,
    shares of the range per full strength, (n_free,). shares: strengths that are tried, the largest first. sizes:
    relative changes of the parameters at the first of them, (n_free,).
    """

    key: EffectKey
    records: WhiteRecords
    limit: float
    activation: Activation
    answer: Array
    shares: tuple[float, ...]
    sizes: Array


def promised_biases(current: Fit, library: Library, key: EffectKey) -> list[Promise]:
    records, found = library.problem((*current.active, key), current.values), []
    own = np.array([library.owner(name) is None for name in current.values])
    every, _ = activation_grid(records, key)
    grid = [replace(a, share=SLIGHT) for a in every if a.share == every[0].share]
    without = records.whole_signals(candidate_at(records, current.values)[np.newaxis])[0]
    left = records.data.white([r.measured for r in records.replays]) - without
    limit, changes = float(left @ left) + UNSEEN, responses(current, records, grid)
    for activation, moved, unseen in zip(grid, changes, unseen_strengths(current, changes), strict=True):
        if np.isfinite(moved).all():
            answer = current.answer @ moved
            slopes = np.abs(answer) * current.records.span / magnitudes(current)
            largest = float(slopes[own].max(initial=0.0)) or float(slopes.max(initial=1e-300))
            tried = dict.fromkeys(min(size / largest, 1.0) for size in SIZES)
            shares = tuple(share for share in tried if share <= unseen)
            sizes = slopes * max(shares, default=0.0)
            found.append(Promise(key, records, limit, activation, answer, shares, sizes))
    return found


def magnitudes(current: Fit) -> Array:
    """Return what changes of the free parameters are relative to, infinite for a value of 0, (n_free,)."""
    return np.where(current.x == 0.0, np.inf, np.abs(current.x))


def proven_bias(current: Fit, promise: Promise) -> Array:
    """Return the largest change of the parameters, SI, (n_free,), of those tried that the records do not show."""
    for share in promise.shares:
        x = fitted_beside(current, promise, share)
        if x is not None:
            return np.asarray(np.abs(x - current.x))
    return np.zeros(current.n_free)


def fitted_beside(current: Fit, promise: Promise, share: float) -> Array | None:
    """Return the free parameters of a fit, SI, fitted beside a strength; None where the records tell of it."""
    space = promise.records.space
    for name, value in promise.activation.at(share).items():
        space = space.with_fixed(name, value)
    order = [list(current.values).index(name) for name in space.free_names]
    posed = replace(promise.records, space=space)
    start = np.clip(current.z - share * promise.answer, 0.0, 1.0)[order]
    if not np.isfinite(posed.chi2(start[np.newaxis])[0]):
        return None
    end = descend(posed, [start], PROVED, limit=promise.limit)
    if posed.chi2(end[np.newaxis])[0] > promise.limit:
        return None
    x = np.empty(current.n_free)
    x[order] = posed.values(end)
    return x


def square_beyond(basis: Array, moved: Array) -> Array:
    """Return the squared length of changes of the signal, (n, n_samples), beyond the reach of a basis."""
    within = moved @ basis
    return np.asarray(np.einsum("ij,ij->i", moved, moved) - np.einsum("ij,ij->i", within, within))


def predicted(current: Fit, moved: Array, rest: Array) -> tuple[Array, Array]:
    """Return predicted drop of chi2 and amplitude of each activation, -inf where it diverged.

    moved: change of the whitened signal per full strength, (n_activations, n_samples). rest: see `rest_of`.
    """
    square, slope = square_beyond(current.basis, moved), moved @ rest
    # What the parameters absorb whole leaves rounding, which must not be divided by.
    seen = np.isfinite(square) & (square > 1e-8 * np.einsum("ij,ij->i", moved, moved))
    amplitude = np.clip(np.divide(slope, square, out=np.zeros_like(slope), where=seen), 0.0, 1.0)
    drop = amplitude * (2.0 * slope - amplitude * square)
    return np.where(seen, drop, -np.inf), amplitude


def rest_of(current: Fit) -> Array:
    """Return the whitened residual of a fit, projected off the sensitivities to its parameters, (n_samples,)."""
    return beyond(current.basis, current.residual)


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


def moved_start(records: WhiteRecords, current: Fit, activation: Activation, answer: Array, share: float) -> Array:
    """Return the extended candidate at a strength, with the linear answer of the free parameters to it, (n_free,)."""
    known = dict(zip(current.values, np.clip(current.z - share * answer, 0.01, 0.99), strict=True))
    shares = records.shares(free_values(records, activation.at(share)))
    z = [known.get(name, own) for name, own in zip(records.space.free_names, shares, strict=True)]
    return np.asarray(np.clip(np.array(z), 1e-3, 1.0 - 1e-3))
