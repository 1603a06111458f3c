"""Effects of the library that may be missing: each form on a grid of its shapes, its strength from weak to strong."""

from dataclasses import replace
from functools import partial

import numpy as np

from armid.estimation.least_squares import descend
from armid.inference.candidates import EffectKey
from armid.inference.decisions import OUT_OF_TOLERANCE, calibration
from armid.inference.evidence import SCALES_OF_STRENGTH, Expansion, Forecast
from armid.inference.hypothesis import Hypothesis, Proposal
from armid.inference.library import Library, activation_grid
from armid.inference.model import (
    ROUGHLY,
    Fit,
    candidate_at,
    fit_from,
    free_values,
    problem_about,
    responses,
    start_of,
    unless_diverged,
)
from armid.inference.unknowns import freed, moved, projected
from armid.inference.whitening import WhiteRecords
from armid.model import Array

# Shares of the range over which a strength is tried: a slope, and two secants where the response is not linear.
SLOPE = 1e-3
SHARES_TRIED = (SLOPE, 0.05, 0.4)
# Variants of a forecast from which a fit may start.
N_STARTS_OF_EFFECT = 4
# First steps of a fit, after which it shows how far it may lead.
N_FIRST_STEPS = 2
# An effect may be one parameter of the model where this parameter explains such a share of its squared response. Two
# forms of one law differ by up to 2e-4 of it, two laws by 2e-3 and more in some company (measured on nine machines).
# Other effects act meanwhile with such shares of their size, one after the other.
PARALLEL, SAME_RESPONSE, COMPANY = 0.9, 1e-3, (0.03, 0.1, 0.3)
# How often the change of the parameter that does the same is corrected.
N_SECANTS = 3


def hypotheses(library: Library) -> dict[EffectKey, Hypothesis]:
    """Return a hypothesis for each form of each effect; the forms of one effect share its prior.

    That a user asks for a few candidates makes none of them more probable: the whole library shares what is expected.
    What does the same as a constant within its tolerance is as improbable as that this tolerance is wrong.
    """
    n, forms = len(library.known_names), [key.public for key in library.candidates]

    def odds(key: EffectKey) -> float:
        usual = calibration().log_odds("effect", n, key.public)
        usual += float(np.log(OUT_OF_TOLERANCE)) if library.doubles.get(key) in library.tolerances else 0.0
        return library.log_odds(key.public, usual) - float(np.log(forms.count(key.public)))

    return {key: Hypothesis("effect", key.public, key.form, odds(key), key) for key in library.candidates}


def propose(fit: Fit, known: dict[EffectKey, Hypothesis], library: Library) -> list[Proposal]:
    """Return the effects that are not in a fit, with what each would change."""
    return proposals(fit, library.joinable(fit.active), known, library)


def propose_forms(fit: Fit, known: dict[EffectKey, Hypothesis], library: Library) -> list[Proposal]:
    """Return the other forms of the effects of a fit."""
    mine, names = {key.declared for key in fit.active}, {key.public for key in fit.active}
    return proposals(fit, [k for k in library.candidates if k.public in names and k not in mine], known, library)


def propose_with_free_shapes(
    fit: Fit, key: EffectKey, known: dict[EffectKey, Hypothesis], library: Library
) -> list[Proposal]:  # fmt: skip
    """Return the effects with a held shape that one of a fit has free, such as a width of a sign, theirs free as well.

    With another width a twin would look like a stranger.
    """
    if not key.free_shape:
        return []

    def shapes(k: EffectKey) -> set[str]:
        return {name.rpartition(".")[2] for name in library.fixed_shapes(k)}

    rivals = [replace(k, free_shape=True) for k in library.joinable(fit.active) if shapes(k) & shapes(key)]
    return proposals(fit, rivals, known, library)


def proposals(
    fit: Fit, keys: list[EffectKey], known: dict[EffectKey, Hypothesis], library: Library
) -> list[Proposal]:  # fmt: skip
    proposed = library.each(lambda key: proposal(fit, known[key.declared], key, library), keys)
    return [p for p in proposed if p is not None]


def proposal(fit: Fit, hypothesis: Hypothesis, key: EffectKey, library: Library) -> Proposal | None:
    records = beside(fit, (*fit.active, key), library)
    activations, _ = activation_grid(records, key, library.declared_ranges(records.model, key))
    grid = [replace(a, share=share) for a in activations if a.share == activations[0].share for share in SHARES_TRIED]
    moved = responses(fit, records, grid)
    good = np.flatnonzero(np.isfinite(moved).all(axis=1) & (np.abs(moved).max(axis=1, initial=0.0) > 0.0))
    if not len(good):
        return None
    chosen = [grid[i] for i in good]
    variants = np.full(len(good), -np.log(len(grid)))
    return Proposal(
        hypothesis, moved[good], SCALES_OF_STRENGTH, variants, partial(refit, key, library), one_sided=True, grid=chosen
    )


def doubles(fit: Fit, library: Library) -> dict[EffectKey, str]:
    """Return the effects that do what the declared model does by itself, and nothing else, with what does it.

    That is a free parameter, or a constant that is known within a tolerance. Viscous friction is the damping of a
    machine that has one: records cannot tell two shares of one quantity, and its interval would reach from none of it
    to all. Its sign may be smoothed in another form. Both are moved side by side, in the company of other effects, weak
    and strong: a wrong gain of the drive looks like another mass only until something else acts.
    """
    keys, products = library.joinable(()), fit.products(library.tolerances)
    names = [*fit.values, *(p.names[0] for p in products)]
    slopes = np.column_stack([fit.jacobian / fit.records.span, *(p.slope for p in products)])
    found = library.each(lambda key: double(fit, key, library, names, slopes), keys)
    return {key: name for key, name in zip(keys, found, strict=True) if name}


def double(fit: Fit, key: EffectKey, library: Library, own: list[str], slopes: Array) -> str:
    """Return what of the declared model does what an effect does, "" for nothing.

    own: its parameters, and constants; slopes: change of the whitened signal by each, (n_samples, n).
    """
    records = beside(fit, (key,), library)
    known, declared = strengths(records, library), records.model.parameters
    names = known.get(key, [])
    company = [n for other, theirs in known.items() if other.public != key.public for n in theirs]
    if len(names) != 1 or not company or not own:
        return ""
    alone, step = candidate_at(records, fit.values), SLOPE * library.strength_of(names[0], declared[names[0]])
    response, squares = change_by(records, alone, names[0], step), np.maximum(np.sum(slopes**2, axis=0), 1e-300)
    along = slopes.T @ response / squares
    best = int(np.argmax(along**2 * squares))
    if not along[best] ** 2 * squares[best] > PARALLEL * float(response @ response):
        return ""
    for share in COMPANY:
        at_work = alone.copy()
        for other in company:
            at_work[records.space.index(other)] += share * library.strength_of(other, declared[other])
        if not is_same(records, at_work, (names[0], step), (own[best], float(along[best]))):
            return ""
    return own[best]


def is_same(records: WhiteRecords, candidate: Array, one: tuple[str, float], other: tuple[str, float]) -> bool:
    """Tell whether a change of a parameter does what some change of another, or of a constant, does.

    one, other: name, and the change; that of the other is a first guess.
    """
    response, (name, change) = change_by(records, candidate, *one), other
    for _ in range(N_SECANTS):
        by_other = change_by(records, candidate, name, change)
        apart = response - by_other
        if float(apart @ apart) < SAME_RESPONSE * float(response @ response):
            return True
        change *= float(response @ by_other) / max(float(by_other @ by_other), 1e-300)
    return False


def change_by(records: WhiteRecords, candidate: Array, name: str, change: float) -> Array:
    """Return the change of the whitened signal where a parameter of a candidate changes, or a constant by a share.

    (n_samples,).
    """
    both, is_parameter = np.tile(candidate, (2, 1)), name in records.space.names
    if is_parameter:
        both[1, records.space.index(name)] += change
    still, moved = records.whole_signals(both, None if is_parameter else {name: np.array([0.0, change])})
    return np.asarray(moved - still)


def strengths(records: WhiteRecords, library: Library) -> dict[EffectKey, list[str]]:
    """Return the strengths of each candidate of a compiled model, but of those whose shapes are times."""
    parameters: dict[EffectKey, list[str]] = {}
    for name in records.space.names:
        owner = library.owner(name)
        if owner is not None:
            parameters.setdefault(owner, []).append(name)
    declared = records.model.parameters
    return {key: [n for n in names if declared[n].null is not None] for key, names in parameters.items()
            if all(declared[n].unit != "s" for n in names)}  # fmt: skip


def beside(fit: Fit, active: tuple[EffectKey, ...], library: Library) -> WhiteRecords:
    """Return the problem with other effects on the records as a fit has them: its constants, faults and cover."""
    problem = problem_about(fit, active, library)
    if fit.records.data.cover is not None:
        problem = replace(problem, data=fit.records.data)
    return moved(problem, [f.unknown for f in fit.others], [f.value for f in fit.others])


def refit(
    key: EffectKey, library: Library, fit: Fit, about: Expansion, ahead: Forecast, limit: float,
    begun: Array | None = None,
) -> Fit | None:  # fmt: skip
    """Return the model with an effect, fitted from the best two of the starts that a forecast gives.

    It can do all that it does without the effect: where it ends worse, the fit begins again there, the effect at rest.
    begun: where its first steps led; the fit goes on from there.
    """
    active = (*fit.active, key)
    problem = beside(fit, active, library)
    if begun is None:
        starts = np.array(starts_of(fit, about, ahead, problem, library))
        order = np.argsort(projected(fit, problem, about.scale.weight).chi2(starts), kind="stable")
        best = starts[order[:2]]
    else:
        best = begun[np.newaxis]
    done = fitted(fit, problem, active, list(best), library, about.scale.weight, limit)
    if done is not None and done.chi2 <= fit.chi2:
        return done
    again = fitted(fit, problem, active, [start_of(problem, fit.values)], library, about.scale.weight, limit)
    return done if again is None or (done is not None and done.chi2 <= again.chi2) else again


def fitted(
    fit: Fit, problem: WhiteRecords, active: tuple[EffectKey, ...], starts: list[Array], library: Library,
    weight: float, limit: float = np.inf,
) -> Fit | None:  # fmt: skip
    """Return a model with other effects fitted roughly, its further unknowns those of a fit, free to move from there.

    Held where they are, constants that stand in for the new effect would leave nothing for it to explain.
    problem: with the values that the further unknowns have in the fit.
    """
    if not fit.others:
        return unless_diverged(lambda: fit_from(problem, active, starts, rough=True, limit=limit))
    base = base_of(fit, active, library)
    assert base is not None
    chi2 = projected(fit, problem, weight).chi2(np.array(starts))
    if not np.isfinite(chi2).any():
        return None
    z = starts[int(np.argmin(chi2))]
    near = Fit(active, problem, z, problem.plain.residuals(z)[0], base=base, others=fit.others)
    return unless_diverged(lambda: freed(near, base, [f.unknown for f in fit.others], weight, limit, rough=True))


def base_of(fit: Fit, active: tuple[EffectKey, ...], library: Library) -> WhiteRecords | None:
    """Return the problem with other effects before any further unknown of a fit was moved, None where it has none."""
    return None if fit.base is None else replace(problem_about(fit, active, library), data=fit.base.data)


def first_steps(fit: Fit, about: Expansion, ahead: Forecast, library: Library) -> tuple[float, Array]:
    """Return where the first steps of a fit from the best start lead: the sum of squares, and the candidate."""
    key = ahead.proposal.hypothesis.means
    problem = beside(fit, (*fit.active, key), library)
    starts, projection = (
        np.array(starts_of(fit, about, ahead, problem, library)),
        projected(fit, problem, about.scale.weight),
    )
    chi2 = projection.chi2(starts)
    best = starts[int(np.argmin(chi2))]
    if not np.isfinite(chi2.min()):
        return np.inf, best
    z = descend(projection, [best], ROUGHLY, most=N_FIRST_STEPS)
    return float(projection.chi2(z)[0]), z


def starts_of(
    fit: Fit, about: Expansion, ahead: Forecast, problem: WhiteRecords, library: Library
) -> list[Array]:  # fmt: skip
    """Return extended candidates at expected and tried strengths, with the linear answer of the parameters."""
    starts, grid = [], ahead.proposal.grid
    for variant, strength in ahead.best(N_STARTS_OF_EFFECT):
        for share in dict.fromkeys((float(np.clip(strength, 0.01, library.reach)), grid[variant].share)):
            z = np.clip(fit.z - share * ahead.answer[: fit.n_free, variant], 0.01, 0.99)
            values = dict(zip(fit.values, fit.records.values(z), strict=True)) | grid[variant].at(share)
            starts.append(np.clip(problem.shares(free_values(problem, values)), 1e-3, 1.0 - 1e-3))
    return starts
