"""Explore models: while one that may be right is not expanded, fit its neighbours (`moves` says which these are).

Occam's window (Madigan, Raftery 1994, doi:10.1080/01621459.1994.10476894): models whose posterior is far below that
of the best are not expanded. Leading forecasts are then fitted, because a forecast only ranks. Of many long records
some are searched first. The models that lead there are fitted to all records, and the search on these begins at them.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from weakref import WeakKeyDictionary

import numpy as np

from armid.estimation.constants import NAMED
from armid.inference.candidates import EffectKey
from armid.inference.checks import is_significant
from armid.inference.decisions import HOPELESS, REFITTED, WINDOW
from armid.inference.declared import declared_again
from armid.inference.evidence import expansion_of, forecast
from armid.inference.kinds import drifts, effects, faults, unknown
from armid.inference.kinds.hypothesis import Hypotheses, Hypothesis, Proposal, may_join, words
from armid.inference.library import Library, are_scheduled_alike
from armid.inference.model import Fit, finished, fit_from, unless_diverged, with_data_of, with_free_shapes
from armid.inference.model import freed as freed_shape
from armid.inference.moves import (
    Exploration,
    Trial,
    best_begun,
    drops,
    exchanges,
    is_complete,
    is_near,
    leading,
    limit_of,
    pairs,
    simpler,
    swaps,
    trial_of,
)
from armid.inference.shooting import on_short_pieces, on_whole_records
from armid.inference.unknowns import Unknown, constants_of, freed, polished
from armid.inference.whitening import WhitenedData
from armid.problem.starts import fits_starts

# Budgets of computing. Additions that are fitted at each model.
N_ADDED = 8
# Best models that get a signal without a form, and as many with one effect fewer; signals that are tried for each.
N_BESIDE, N_SIGNALS = 2, 2
# Models that are expanded in all, and effects of one model.
MOST_EXPANDED, MOST_EFFECTS = 16, 8
# Above so many samples fewer models are expanded, but at least so many; so many constants within tolerances halve the
# number. From three times as many samples on, some of the records are searched first, with about so many samples.
SAMPLES, SPARED, FEWEST_EXPANDED, USUAL_CONSTANTS = 4_000, 3, 8, 10
# Steps between samples; an expansion with more counts as several: friction as sharp as a fast machine shows it.
USUAL_STEPS = 16.0
# Far from the noise: expansions without a better model after which the best one is the last that is expanded, unless
# that leads to a better one: what is missing has no name.
MOST_IN_VAIN = 4
# Most expansions of a last model that was never expanded, and fits of what was only forecast and would count.
MOST_ENDS, MOST_COUNTED = 3, 16
# Most completions of one model in a row.
MOST_COMPLETED = 4
# Rivals that differ from the best model in one name and are completed.
N_RIVALS = 3
# Best models of each size that are expanded outside the window, completed, carried on from short pieces.
BEAM = 3


def explore(
    library: Library,
    declared: Fit,
    until: Callable[[Fit], bool] = lambda _: False,
    led_by: Mapping[Hypotheses, Fit] | None = None,
) -> Exploration:
    """Return the models that were explored from the declared one.

    declared: its fit. until: whether a fit that leads, after an expansion, is reason to stop at once. led_by: models
    that led with another noise of the same records; the search goes on from these.
    """
    exploration = begun(library, declared)
    if led_by:
        go_on_from(exploration, led_by)
    else:
        take_from_some_records(exploration)
    if expand_all(exploration, None, until):
        add_unknown(exploration)
    if until(exploration.fits[exploration.ranked()[0][0]]):
        return exploration
    add_unknown(exploration)
    finish_all(exploration)
    # Far from the noise each leads to a larger model that was never expanded.
    for _ in range(MOST_ENDS if is_near(exploration) else 1):
        best = exploration.ranked()[0][0]
        is_expanded = best in exploration.forecasts or exploration.fits[best].records.data.cover is not None
        if is_expanded or not is_named(best):
            break
        # Drops reached this model: its own additions and swaps were never fitted.
        expand(exploration, best)
        finish_all(exploration)
    if fit_what_counts(exploration):
        finish_all(exploration)
    return exploration


def begun(library: Library, declared: Fit) -> Exploration:
    """Return an exploration that knows the declared model alone."""
    exploration = Exploration(library, effects.hypotheses(library))
    exploration.constants = constants_of(declared.records, declared.z, library.tolerances)
    exploration.fits[frozenset()] = declared
    exploration.fits[frozenset()] = with_constants(declared, exploration.constants, exploration.scale().weight)
    exploration.faults = faults.hypotheses(declared.records)
    exploration.drifts = drifts.hypotheses(declared, library)
    return exploration


def expand_all(exploration: Exploration, most: int | None, until: Callable[[Fit], bool] = lambda _: False) -> bool:
    """Expand models while one that may be right is not expanded; tell whether none is left.

    most: models that are expanded in all, None: as many as the samples allow. until: see `explore`.
    """
    cost = exploration.library.data.n_simulated / SAMPLES * (1.0 + len(exploration.constants) / USUAL_CONSTANTS)
    fewest = 1 if exploration.is_led else FEWEST_EXPANDED
    most = most or int(np.clip(MOST_EXPANDED / cost, fewest, MOST_EXPANDED))
    while exploration.n_expanded < most:
        model, best = next_model(exploration), exploration.ranked()[0][0]
        if until(exploration.fits[best]) or (exploration.in_vain >= MOST_IN_VAIN and model != best):
            return False
        if model is None:
            return True
        complete(exploration, model)
        # Near the noise free the shapes of the smaller model first: a second effect may only correct a held shape.
        for less in simpler(exploration, model) if is_near(exploration) else []:
            if may_be_far_off(exploration, less):
                complete(exploration, less)
        if next_model(exploration) == model:
            work = expansions_of(exploration.fits[model])
            if exploration.n_expanded and exploration.n_expanded + work > most:
                return False
            exploration.n_expanded += work
            expand(exploration, model)
            finish(exploration)
            is_better = exploration.ranked()[0][0] != best or is_near(exploration)
            exploration.in_vain = 0 if is_better else exploration.in_vain + 1
    return False


def expansions_of(fit: Fit) -> float:
    """Return as how many usual expansions the one of a model counts."""
    return max(1.0, max(c.schedule.least for r in fit.records.replays for c in r.calibrations) / USUAL_STEPS)


def look(exploration: Exploration) -> None:
    """Expand the declared model, and far from the noise take what leads on short pieces."""
    expand_all(exploration, 1)
    if not is_near(exploration):
        take_from_short_pieces(exploration)


def go_on_from(exploration: Exploration, leaders: Mapping[Hypotheses, Fit]) -> None:
    """Take models that led with another noise: some of the records, or pieces of them, need no second look."""
    exploration.is_led = some_records(exploration.library.data) is not None
    if not exploration.is_led:
        expand_all(exploration, 1)
    take_carried(exploration, leaders, with_data_of)


def take_from_some_records(exploration: Exploration) -> None:
    """Take the models that lead on some of many long records; look at all records where there are not so many.

    Faults of records are left to the search on all records, which separates a fault from an effect.
    """
    library = exploration.library
    which = some_records(library.data)
    if which is None:
        look(exploration)
        return
    library.say(f"looking at {len(which)} of {len(library.data.records)} records")
    few = library.of_records(which)
    some = begun(few, declared_again(few, exploration.declared))
    look(some)
    expand_all(some, None)
    finish(some)
    leaders = leaders_of(some)
    take_carried(exploration, leaders, with_data_of)
    exploration.is_led = bool(leaders)


def leaders_of(exploration: Exploration) -> dict[Hypotheses, Fit]:
    """Return the best models without something unknown, each by its effects alone."""
    leaders: dict[Hypotheses, Fit] = {}
    for model in [m for m, _ in exploration.ranked() if is_named(m)]:
        leaders.setdefault(frozenset(h for h in model if h.kind == "effect"), exploration.fits[model])
    leaders.pop(frozenset(), None)
    return dict(list(leaders.items())[:BEAM])


def some_records(data: WhitenedData) -> list[int] | None:
    """Return which records are looked at first: every so many; None where that would spare little.

    A sensor that holds its value tells as much as it has samples, however many are simulated.
    """
    n = len(data.records)
    n_some = int(np.ceil(n * SAMPLES / sum(record.n_samples for record in data.records)))
    return None if SPARED * n_some > n else [(2 * i + 1) * n // (2 * n_some) for i in range(n_some)]


def take_carried(
    exploration: Exploration, leaders: Mapping[Hypotheses, Fit], carry: Callable[[Fit, Library], Fit]
) -> None:  # fmt: skip
    """Take models that lead on a part of the records, carried on to all of them, the constants freed there."""
    library = exploration.library
    carried = library.each(lambda fit: unless_diverged(partial(carry, fit, library)), leaders.values())
    for model, fit in zip(leaders, carried, strict=True):
        exploration.take(model, fit and with_constants(fit, exploration.constants, exploration.scale().weight))


def take_from_short_pieces(exploration: Exploration) -> None:
    """Take the models that lead on short pieces of the records, carried on to the whole ones: see `shooting`."""
    library = exploration.library
    begin = on_short_pieces(library, exploration.declared)
    if begin is None:
        return
    library.say("looking at short pieces of the records")
    short = begun(*begin)
    expand_all(short, FEWEST_EXPANDED)
    leaders = [m for m, _ in short.ranked() if m and all(h.kind == "effect" for h in m)][:BEAM]
    take_carried(exploration, {m: short.fits[m] for m in leaders}, on_whole_records)


def fit_what_counts(exploration: Exploration) -> bool:
    """Fit what was only forecast and would be listed in the posterior; tell whether a model was added.

    Forecasts that lead may be refused where they are fitted, and those behind them, as wrong, would count unasked.
    """
    before = len(exploration.fits)
    for _ in range(MOST_COUNTED):
        scale, ranked = exploration.scale(), exploration.ranked()
        top = ranked[0][1]
        known = exploration.fits.keys() | exploration.refused
        near = [(model, value) for model, value in ranked if value > top - WINDOW]
        waiting = [(value + f.posterior, model, f) for model, value in near
                   for f in exploration.forecasts.get(model, ())
                   if model | {f.proposal.hypothesis} not in known]  # fmt: skip
        if not waiting:
            break
        chance, model, ahead = max(waiting, key=lambda one: one[0])
        if not top + REFITTED < chance < np.inf:
            break
        about = expansion_of(exploration.fits[model], scale, exploration.library)
        for key, make in trial_of(exploration, model, about, ahead, limit_of(exploration, scale)):
            exploration.take_or_refuse(key, make())
    return len(exploration.fits) > before


def without_denied(exploration: Exploration, denied: Hypotheses, standing: Hypotheses) -> Exploration:
    """Return the exploration without models that hold a denied hypothesis, and without larger ones than what stands.

    What is left over then is something unknown: no other name was judged in place of those.
    """
    gone = {h.public for h in denied}
    fits = {m: fit for m, fit in exploration.fits.items()
            if len(m) <= len(standing) and not any(h.public in gone for h in m)}  # fmt: skip
    forecasts = {m: [f for f in ahead if f.proposal.hypothesis.public not in gone]
                 for m, ahead in exploration.forecasts.items() if m in fits and len(m) < len(standing)}  # fmt: skip
    left = replace(exploration, fits=fits, forecasts=forecasts, noise=exploration.scale(),
                   _evidence=WeakKeyDictionary())  # fmt: skip
    add_signals(left, [m for m, _ in left.ranked()[:N_BESIDE]])
    return left


def add_unknown(exploration: Exploration) -> None:
    """Add a signal without a form to some models, once.

    To the declared one and the best ones with one effect fewer than the best: several wrong names together can explain
    an effect that the library does not hold. Where the best model leaves more than noise, to the best ones as well.
    """
    ranked = exploration.ranked()
    if not all(map(is_named, exploration.fits)):
        return
    best = ranked[0][0]
    models = [*simpler(exploration, best)[:N_BESIDE], *([frozenset[Hypothesis]()] if best else [])]
    if is_significant(exploration.fits[best]):
        models = [*(m for m, _ in ranked[:N_BESIDE]), *models]
    add_signals(exploration, list(dict.fromkeys(models)))


def add_signals(exploration: Exploration, models: Sequence[Hypotheses]) -> None:
    """Add signals without a form to some models."""
    library, scale = exploration.library, exploration.scale()
    limit = limit_of(exploration, scale)
    for model in models:
        fit = exploration.fits[model]
        about = expansion_of(fit, scale, library)
        ahead = sorted((forecast(about, p) for p in unknown.propose(fit, library)), key=lambda f: -f.posterior)
        for one in ahead[:N_SIGNALS]:
            for key, make in trial_of(exploration, model, about, one, limit):
                if key not in exploration.refused:
                    exploration.take_or_refuse(key, make())


def next_model(exploration: Exploration) -> Hypotheses | None:
    """Return the model that is to be expanded next, None where all in the window are.

    Where the best model leaves more than noise, the best effect-only models of each size up to its own may lead on as
    well: a strong second effect can mislead the choice of the first. Far from the noise these come first (a beam),
    until several in turn were expanded in vain.
    Where some records were searched first, the beam was expanded there. Models with something unknown are not expanded:
    names next to it do not count.
    """
    ranked = exploration.ranked()
    best, top = ranked[0]
    expanded = [(m, value) for m, value in ranked if m in exploration.forecasts]
    reach = HOPELESS if is_near(exploration) else WINDOW
    near = [m for m, value in ranked if is_named(m) and value > top - (reach if is_form_of(m, best) else WINDOW)
            and not (is_outdone(m, value, ranked) or has_expanded_form(m, value, expanded))]  # fmt: skip
    is_left = is_significant(exploration.fits[best]) and exploration.fits[best].records.data.cover is None
    if is_left and not exploration.is_led:
        plain = [m for m, _ in ranked if all(h.kind == "effect" for h in m)]
        # an effect may show together with another only: those with one are expanded although none of them leads
        beam = [m for n in range(1, max(len(best), 1) + 1) for m in [m for m in plain if len(m) == n][:BEAM]]
        is_beam_first = not is_near(exploration) and exploration.in_vain < MOST_IN_VAIN
        near = [*beam, *near] if is_beam_first else [*near, *beam]
    return next((m for m in near if m not in exploration.forecasts and len(m) < MOST_EFFECTS), None)


def is_named(model: Hypotheses) -> bool:
    return all(h.kind != "unknown" for h in model)


def has_expanded_form(model: Hypotheses, value: float, expanded: Sequence[tuple[Hypotheses, float]]) -> bool:
    """Tell whether an expanded model in the window has the same names in other forms: its neighbours are the same.

    The model at which the search ends is expanded all the same. Of forms that differ by more each has its own: what one
    lacks another may hold.
    """
    return any(m != model and is_form_of(m, model) and abs(other - value) < WINDOW for m, other in expanded)


def is_form_of(model: Hypotheses, other: Hypotheses) -> bool:
    """Tell whether a model has the names of another, whatever their forms."""
    return {h.public for h in model} == {h.public for h in other}


def is_outdone(model: Hypotheses, value: float, ranked: Sequence[tuple[Hypotheses, float]]) -> bool:
    """Tell whether a subset of its hypotheses is more probable: then a model is not expanded."""
    return any(less < model and more > value for less, more in ranked)


def with_constants(fit: Fit, constants: Sequence[Unknown], weight: float) -> Fit:
    """Return a fit with all its further unknowns freed again, the constants that have a tolerance among them."""
    kept = [f.unknown for f in fit.others if not f.unknown.name.startswith(NAMED)]
    if not (kept or constants):
        return fit
    again = unless_diverged(lambda: freed(fit, fit.base or fit.records, [*kept, *constants], weight))
    return again or fit


def expand(exploration: Exploration, model: Hypotheses) -> None:
    """Fit the most promising neighbours of a model: see `moves`; signals and free shapes come later."""
    fit, library, scale = exploration.fits[model], exploration.library, exploration.scale()
    library = library.for_misfit(fit.misfit) if fit.base is None else library
    library.say(f"expanding {words(model) if model else 'the declared model'}")
    about, held = expansion_of(fit, scale, library), expansion_of(fit, scale, library, with_doubts=False)
    proposals: list[Proposal] = effects.propose(fit, exploration.known, library)
    changes = drifts.propose(fit, exploration.drifts)
    others = [*faults.propose(fit, exploration.faults, library, changes), *changes]
    others = [p for p in others if may_join(model, p.hypothesis, len(fit.records.data.records))]
    ahead = [forecast(about, p) for p in proposals]
    ahead_held = [forecast(held, p) for p in proposals]
    beside = [forecast(about, p) for p in others]
    exploration.forecasts[model] = [f.without_columns for f in (*ahead, *beside)]
    limit = limit_of(exploration, scale)
    trials: list[Trial] = []
    if is_significant(fit):
        trials += best_begun(exploration, model, held, ahead_held, limit, N_ADDED)
    else:
        # forms share the prior of a name: that a name has more of them makes none less worth a fit
        n_forms = Counter(p.hypothesis.name for p in proposals)
        odds = [max(f.posterior, h.posterior) for f, h in zip(ahead, ahead_held, strict=True)]
        added = [i for i, p in enumerate(proposals) if odds[i] + np.log(n_forms[p.hypothesis.name]) > REFITTED]
        for i in sorted(added, key=lambda i: -odds[i])[:N_ADDED]:
            trials += trial_of(exploration, model, held, ahead_held[i], limit)
    trials += [t for f in leading(beside) for t in trial_of(exploration, model, about, f, limit)]
    ranked = exploration.ranked()
    is_far = is_significant(fit) and not is_near(exploration)
    if is_far and model == ranked[0][0]:  # first, because exchanges fit the smaller models
        trials += exchanges(exploration, model, fit, limit)
    trials += drops(exploration, model)
    if not is_far and exploration.log_posterior(model, scale) > ranked[0][1] - WINDOW:
        forms = effects.propose_forms(fit, exploration.known, library)
        trials += swaps(exploration, model, fit, scale, [*proposals, *forms], limit)
    made = library.each(lambda t: t[1](), trials)
    for (key, _), again in zip(trials, made, strict=True):
        exploration.take_or_refuse(key, again)
    for key, again in pairs(exploration, model, about, ahead):
        exploration.take(key, again)


def finish(exploration: Exploration) -> None:
    """Complete the best models with as many hypotheses as the best: rough fits may be misranked."""
    size = len(exploration.ranked()[0][0])
    for model in [m for m, _ in exploration.ranked() if len(m) == size][:BEAM]:
        complete(exploration, model)


def finish_all(exploration: Exploration) -> None:
    """Bring all models that may count to their estimates, all unknowns freed."""
    led: set[Hypotheses] = set()
    while True:
        best, _ = exploration.ranked()[0]
        for key, make in drops(exploration, best, again=best not in led):
            exploration.take_or_refuse(key, make())
        led.add(best)
        ranked = exploration.ranked()
        todo = [m for m, value in ranked if value > ranked[0][1] - WINDOW and not is_complete(exploration, m)
                and not is_outdone(m, value, ranked)]  # fmt: skip
        best, top = ranked[0]
        todo += [m for m in simpler(exploration, best)
                 if not is_complete(exploration, m) and may_be_far_off(exploration, m)]  # fmt: skip
        # A name must not win because the rough fit of its rival is far from its estimate.
        rivals = [m for m, value in ranked if len(m) == len(best) and len(m - best) == 1 and value > top - HOPELESS]
        todo += [m for m in rivals[:N_RIVALS]
                 if m not in todo and not is_complete(exploration, m) and may_be_far_off(exploration, m)]  # fmt: skip
        if not todo:
            break
        for model in todo:
            complete(exploration, model)
    weight, top = exploration.scale().weight, exploration.ranked()[0][1]
    for model in [m for m, value in exploration.ranked() if value > top - WINDOW]:
        exact = in_accurate_steps(exploration.fits[model], exploration.library)
        exploration.fits[model] = polished(exact, weight)


def in_accurate_steps(fit: Fit, library: Library) -> Fit:
    """Return a fit in steps as fine as its estimate asks for; further unknowns are still as they stand.

    Those of a search serve all models with an effect. Their errors would tell two effects apart that move the machine
    alike.
    """
    if fits_starts(fit.records.replays):
        return fit
    exact = library.for_estimate(fit.active, fit.values, fit.misfit, fit.records.replays)
    if are_scheduled_alike(exact.problem(fit.active).replays, fit.records.replays):
        return fit
    records = effects.records_with(fit, fit.active, exact)
    if fit.base is None:
        return replace(fit_from(records, fit.active, [fit.z]), constants=fit.constants)
    return replace(fit, records=records, residual=records.plain.residuals(fit.z)[0],
                   base=effects.base_of(fit, fit.active, exact))  # fmt: skip


def may_be_far_off(exploration: Exploration, model: Hypotheses) -> bool:
    """Tell whether a rough fit of a model may be far from its estimate.

    That holds where an effect has a shape that its declaration holds, or where starts of records are fitted.
    """
    fit = exploration.fits[model]
    return fits_starts(fit.records.replays) or any(exploration.library.fixed_shapes(key) for key in fit.active)


def complete(exploration: Exploration, model: Hypotheses) -> None:
    """Bring a model to its estimate, with its shapes, its constants and its further unknowns freed.

    Where that makes it the one that fits best, a square weighs more than before, and it is completed once more.
    """
    for _ in range(MOST_COMPLETED):
        if is_complete(exploration, model):
            return
        weight = exploration.completed[model] = exploration.scale().weight
        if not (model or exploration.constants):
            return
        fit = exploration.fits[model]
        again = unless_diverged(partial(completed, fit, exploration.library, exploration.constants, weight))
        exploration.fits[model] = again or exploration.fits[model]


def completed(fit: Fit, library: Library, constants: Sequence[Unknown], weight: float) -> Fit:
    """Return a fit at its estimate, its further unknowns freed again, and its shapes where chi2 falls."""
    if fit.records.data.cover is not None:
        return fit
    return with_constants(with_fitted_shapes(finished(fit, library), library), constants, weight)


def with_fitted_shapes(fit: Fit, library: Library) -> Fit:
    """Return a fit with the fixed shapes of its effects free, of each effect where chi2 falls."""
    for key in fit.active:
        if not key.free_shape and library.fixed_shapes(key):
            wide = unless_diverged(partial(reshaped, fit, key, library))
            if wide is not None and wide.chi2 < fit.chi2 * (1.0 - 2.0 / len(fit.residual)):
                fit = wide
    return fit


def reshaped(fit: Fit, key: EffectKey, library: Library) -> Fit:
    """Return a fit with the fixed shapes of one of its effects free."""
    if not fit.others:
        return finished(with_free_shapes(fit, key, library), library)
    active = freed_shape(fit.active, key)
    wide = with_free_shapes(fit, key, library, effects.records_with(fit, active, library))
    return finished(replace(wide, others=fit.others, base=effects.base_of(fit, active, library)), library)
