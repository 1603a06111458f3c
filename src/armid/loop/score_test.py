"""Score candidate effects at a fit: how far each would bring the residual down, were the records linear in it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2 as chi2_distribution

from armid.loop.candidates import Library, Ray, base, idle, rays
from armid.loop.fit import Fit, fit_from
from armid.loop.select import criterion
from armid.loop.whitening import WhiteRecords

Array = NDArray[np.float64]
N_TRIED, N_STARTS = 8, 2
# A fall of chi2 that is not noticed among so many candidates.
UNSEEN = 12.0


@dataclass(frozen=True, eq=False)
class Score:
    """Hold what a candidate would do to the residual of a fit.

    drop: predicted fall of chi2. strength: predicted value of its leading parameter as a share of the way from the null
    to the bound. p: chance of such a drop from noise alone, for one candidate, its grid of shapes counted. starts: free
    parameters of the extended model from which to refit (shares of the range), best first. n_shapes: grid of shapes.
    bends: by how much the effect could bend each free parameter unseen, relative to its value, (n_free,).
    """

    name: str
    drop: float
    strength: float
    p: float
    starts: tuple[Array, ...]
    n_shapes: int
    bends: Array


def score(current: Fit, name: str, library: Library) -> Score | None:
    """Score one candidate at a fit; None where nothing can be said, as every strength diverges or changes nothing.

    The secant from null to each strength, divided by it, stands for the sensitivity there; projected off the
    sensitivities to the free parameters, so that what these can absorb does not count. All strengths and shapes run as
    one population. The amplitude is clipped to the range of the effect.
    """
    records = library.problem((*current.active, name), current.values)
    found, n_shapes = rays(records, name)
    moved = responses(current, records, found)
    drops, amplitudes = predicted(current, moved)
    if not np.isfinite(drops).any():
        return None
    answers = (current.answer @ moved.T).T
    bends = unseen_bends(current, moved, answers)
    order = np.argsort(-drops, kind="stable")[: N_TRIED // 2]
    starts = [s for i in order for s in starts_at(records, current, found[i], answers[i], amplitudes[i])]
    best = int(order[0])
    ratio = log_ratio(current, float(drops[best]))
    p = min(1.0, n_shapes * float(chi2_distribution.sf(ratio, 1)))
    return Score(name, float(drops[best]), float(amplitudes[best]), p, tuple(starts), n_shapes, bends)


def responses(current: Fit, records: WhiteRecords, found: Sequence[Ray], without: str = "") -> Array:
    """Return the change of the whitened signal per full strength along each ray, (n_rays, n_samples).

    without: an effect of the fit that is put to its null before.
    """
    rest = at_null(records, whole_candidate(records, current), without)
    population = np.tile(rest, (len(found) + 1, 1))
    for row, ray in zip(population[1:], found, strict=True):
        for n, value in ray.at(ray.level).items():
            row[records.space.index(n)] = value
    signals = records.whole_signals(population)
    return np.asarray((signals[1:] - signals[0]) / np.array([r.level for r in found])[:, np.newaxis])


def unseen_bends(current: Fit, moved: Array, answers: Array) -> Array:
    """Return the largest relative change of each free parameter that strengths within the range could cause unseen.

    A strength a adds a^2 q to chi2, q the squared length of the change of the signal beyond the reach of the
    parameters; below UNSEEN it is not noticed, while the parameters make up for the rest.
    moved: change of the whitened signal per full strength, (n_rays, n_samples). answers: of the parameters to it,
    (n_rays, n_free).
    """
    good = np.isfinite(moved).all(axis=1)
    if not current.n_free or not good.any():
        return np.zeros(current.n_free)
    beyond = square_beyond(current, moved[good])
    share = np.minimum(1.0, np.sqrt(UNSEEN / np.maximum(beyond, 1e-12)))
    largest = np.max(np.abs(answers[good]) * share[:, np.newaxis], axis=0) * current.records.span
    return np.asarray(largest / np.maximum(np.abs(current.x), 1e-300))


def square_beyond(current: Fit, moved: Array) -> Array:
    """Return the squared length of changes of the signal beyond the reach of the free parameters, (n_rays,)."""
    within = moved @ current.basis
    return np.asarray(np.einsum("ij,ij->i", moved, moved) - np.einsum("ij,ij->i", within, within))


def predicted(current: Fit, moved: Array) -> tuple[Array, Array]:
    """Return predicted drop of chi2 and amplitude of each ray, -inf where it diverged.

    moved: change of the whitened signal per full strength, (n_rays, n_samples).
    """
    basis = current.basis
    rest = current.residual - basis @ (basis.T @ current.residual)
    square, slope = square_beyond(current, moved), moved @ rest
    # A ray that the parameters absorb whole leaves rounding, which must not be divided by.
    seen = np.isfinite(square) & (square > 1e-8 * np.einsum("ij,ij->i", moved, moved))
    amplitude = np.clip(np.divide(slope, square, out=np.zeros_like(slope), where=seen), 0.0, 1.0)
    drop = amplitude * (2.0 * slope - amplitude * square)
    return np.where(seen, drop, -np.inf), amplitude


def log_ratio(current: Fit, drop: float) -> float:
    """Return n_eff ln(chi2 / (chi2 - drop)), the statistic of a drop (see `select.criterion`)."""
    left = max(current.chi2 - drop, 1e-9 * current.chi2)
    return float(current.independent * np.log(current.chi2 / left))


def whole_candidate(records: WhiteRecords, current: Fit) -> Array:
    """Return the current fit as a candidate of an extended problem, the new effect at its null."""
    declared, values = records.replays[0].model.parameters, current.values
    free = [values.get(n, idle(declared[n])) for n in records.space.free_names]
    return np.asarray(records.space.complete(np.array([free]))[0])


def start_of(records: WhiteRecords, values: Mapping[str, float]) -> Array:
    """Return shares of the range of some values, parameters that have none where they rest, (n_free,)."""
    declared = records.replays[0].model.parameters
    x = np.array([values.get(n, idle(declared[n])) for n in records.space.free_names])
    return np.clip(records.shares(x), 0.0, 1.0)


def at_null(records: WhiteRecords, candidate: Array, key: str) -> Array:
    """Return a whole candidate with one effect at its null, shapes as they are."""
    model, changed = records.replays[0].model, candidate.copy()
    for i, name in enumerate(records.space.names):
        if name.partition(".")[0] == base(key) and model.parameters[name].null is not None:
            changed[i] = idle(model.parameters[name])
    return changed


def starts_at(records: WhiteRecords, current: Fit, ray: Ray, answer: Array, amplitude: float) -> list[Array]:
    """Return starts of a refit at a ray: predicted amplitude and tried level, the free parameters moved to match."""
    return [moved_start(records, current, ray, answer, share) for share in (max(amplitude, 0.01), ray.level)]


def moved_start(records: WhiteRecords, current: Fit, ray: Ray, answer: Array, share: float) -> Array:
    """Return the extended candidate at a strength, with the linear answer of the free parameters to it, (n_free,)."""
    shares = dict(zip(current.values, np.clip(current.z - share * answer, 0.01, 0.99), strict=True))
    added = ray.at(share)
    space = records.space
    z = [shares[n] if n in shares else (added[n] - space.low[i]) / (space.high[i] - space.low[i])
         for n, i in ((n, space.index(n)) for n in space.free_names)]  # fmt: skip
    return np.asarray(np.clip(np.array(z), 1e-3, 1.0 - 1e-3))


def traced(current: Fit, library: Library) -> list[Score]:
    """Return the scores of all candidates that are not in a fit, best first."""
    names = [n for n in library.candidates if library.can_join(n, current.active)]
    found = library.each(lambda n: score(current, n, library), names)
    return sorted((s for s in found if s is not None), key=lambda s: -s.drop)


def refitted(current: Fit, found: Score, library: Library) -> Fit:
    """Fit the extended model fully, from the best two of the starts of a score."""
    records = library.problem((*current.active, found.name))
    values = records.chi2(np.array(found.starts[:N_TRIED]))
    order = np.argsort(values, kind="stable")[:N_STARTS]
    starts = distinct([found.starts[i] for i in order])
    return accurate(fit_from(records, (*current.active, found.name), starts), library)


def substituted(active: tuple[str, ...], values: Mapping[str, float], library: Library) -> Fit:
    """Fit a model fully from some values."""
    records = library.problem(active, values)
    return accurate(fit_from(records, active, [start_of(records, values)]), library)


def accurate(fit: Fit, library: Library) -> Fit:
    """Return the fit, made again with finer steps where it ended where the engine's are too coarse."""
    finer = library.recalibrated(fit.active, fit.values)
    return fit if finer is None else fit_from(finer, fit.active, [fit.z])


def distinct(starts: Sequence[Array]) -> list[Array]:
    """Return starts without those that are next to an earlier one."""
    kept: list[Array] = []
    for z in starts:
        if all(np.max(np.abs(z - other)) > 0.02 for other in kept):
            kept.append(z)
    return kept


@dataclass(frozen=True, eq=False)
class Projected:
    """Hold the best ray of one candidate at a fit, all whitened.

    share: length of its sensitivity after projection off the parameters' as a share of that before. alignment: cosine
    between what is left of it and what is left of the residual; its square is the share of the residual that an
    unbounded amplitude would remove. change: the part of the residual that it predicts, (n_samples,).
    """

    name: str
    share: float
    alignment: float
    change: Array


def rest_of(current: Fit) -> Array:
    """Return the whitened residual of a fit, projected off the sensitivities to its parameters, (n_samples,)."""
    return np.asarray(current.residual - current.basis @ (current.basis.T @ current.residual))


def projected(current: Fit, name: str, library: Library) -> Projected:
    """Return what stands behind the score of a candidate: the ray with the largest predicted drop of chi2 (`score`)."""
    records = library.problem((*current.active, name), current.values)
    found, _ = rays(records, name)
    moved = responses(current, records, found)
    drops, amplitudes = predicted(current, moved)
    best = int(np.argsort(-drops, kind="stable")[0])
    free = moved[best] - current.basis @ (current.basis.T @ moved[best])
    rest = rest_of(current)
    length, whole = float(np.linalg.norm(free)), float(np.linalg.norm(moved[best]))
    product = length * float(np.linalg.norm(rest))
    alignment = float(free @ rest) / product if product > 0.0 else 0.0
    return Projected(name, length / whole if whole > 0.0 else 0.0, alignment, amplitudes[best] * free)


# Scores are a linear guess: refit at least and at most so many, and those within a factor of the best.
FEWEST, MOST, WITHIN = 6, 12, 4.0
# So many of them are refitted even where the score says that they cannot do as well as a model that is known.
SURE = 4
# The others must come to what is known with so many times their score: without a friction every rate is bent.
REACH = 10.0
# A drop of chi2 that one candidate in thousands reaches on noise: below it nothing is refitted.
WORTH = 8.0
# An addition whose statistic stays below this is not looked at further; one in ten thousand asks for 15.
PROMISING = 12.0
# Models within this factor of the least chi2 are told apart by the criterion; what they leave has about one character.
COMPARABLE = 1.5


def ranked(fits: Iterable[Fit]) -> list[Fit]:
    """Return models by their criterion, best first, with the effective samples of the one with the least chi2."""
    known = list(fits)
    if not known:
        return []
    least = min(f.chi2 for f in known)
    n_eff = max(f.independent for f in known if f.chi2 <= COMPARABLE * least)
    return sorted(known, key=lambda f: criterion(f, n_eff))


def different(fits: Iterable[Fit]) -> list[Fit]:
    """Return models, best first, without those that another holds with a shape set free."""
    found: dict[frozenset[str], Fit] = {}
    for fit in fits:
        found.setdefault(frozenset(map(base, fit.active)), fit)
    return list(found.values())


def leading(parent: Fit, scores: list[Score]) -> list[Score]:
    """Return the scores that deserve a full fit."""
    if not scores:
        return []
    worth = [s for s in scores if s.drop > WORTH * max(1.0, parent.chi2 / len(parent.residual))]
    near = [s for s in worth if s.drop * WITHIN >= worth[0].drop]
    return worth[: max(FEWEST, min(MOST, len(near)))]


def within_reach(parent: Fit, found: Score, fits: Mapping[frozenset[str], Fit]) -> bool:
    """Tell whether a candidate may come to the best model of its size, its score a guess within a factor."""
    known = [f.chi2 for key, f in fits.items() if len(key) == len(parent.active) + 1]
    return parent.chi2 - REACH * found.drop <= min(known, default=np.inf)


def promising(smaller: Fit, larger: Fit) -> bool:
    """Tell whether an addition may come to be significant."""
    n_eff = max(smaller.independent, larger.independent)
    return bool(n_eff * np.log(smaller.chi2 / larger.chi2) > PROMISING)
