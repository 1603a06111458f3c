"""Explore models: while one that may be right is not expanded, add, add a pair, drop, swap, free its shapes.

Occam's window (Madigan, Raftery 1994, doi:10.1080/01621459.1994.10476894): models whose posterior is far below that
of the best are not expanded. To first order additions, pairs and swaps come from one Gram matrix at each model; what
leads is fitted again, as a forecast ranks and does not judge.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from weakref import WeakKeyDictionary

import numpy as np

from armid.estimation.constants import NAMED
from armid.inference.candidates import EffectKey
from armid.inference.checks import is_significant
from armid.inference.decisions import HOPELESS, REFITTED, WINDOW
from armid.inference.evidence import (
    Expansion,
    Forecast,
    Scale,
    expansion_of,
    forecast,
    log_evidence,
    scale_of,
)
from armid.inference.hypothesis import Hypotheses, Hypothesis, Proposal, log_prior, words
from armid.inference.kinds import drifts, effects, faults, unknown
from armid.inference.library import Library
from armid.inference.model import UNTOLD, Fit, finished, fit_from, start_of, unless_diverged, with_free_shapes
from armid.inference.model import freed as freed_shape
from armid.inference.shooting import on_short_pieces, on_whole_records
from armid.inference.unknowns import Unknown, constants_of, freed, polished, projected
from armid.model import Array
from armid.problem.starts import fits_starts

Trial = tuple[Hypotheses, Callable[[], Fit | None]]
# Budgets of computing. Additions that are fitted at each model, those of other kinds, pairs, swaps of each effect.
N_ADDED, N_OTHERS, N_PAIRS, N_SWAPPED, N_EXCHANGED = 8, 3, 3, 3, 2
# Best models to which a signal without a form is added, of those with a name less too; signals of each.
N_BESIDE, N_SIGNALS = 2, 2
# Leading additions from which pairs are made; models that are expanded in all, and effects of one model.
N_LEADING, MOST_EXPANDED, MOST_EFFECTS = 24, 16, 8
# Of records with more samples than this, and with so many constants within tolerances half, fewer models are expanded,
# but for so many.
SAMPLES, USUAL_CONSTANTS, FEWEST_EXPANDED = 4_000, 10, 8
# Far from the noise: models that are expanded in turn without a better one, after which what is missing has no name.
MOST_IN_VAIN = 4
# Models that are expanded once more where the search ends at one that is not.
MOST_ENDS = 3
# A model is brought to its estimate at most so often in turn.
MOST_COMPLETED = 4
# Mean square of the best model, in units of the noise, up to which rivals are begun afresh.
NEAR_NOISE = 2.0
# Rivals that differ from the best model in one name and are brought to their estimates.
N_TWINS = 3
# Strengths at which a swapped effect is tried, as multiples of the linear guess.
STRENGTHS_OF_FORM = 2.0 ** np.arange(-4, 5)
# Models of each size that are expanded outside the window where more than noise is left.
BEAM = 3


@dataclass(eq=False)
class Exploration:
    """Hold every model that was fitted.

    fits: by the hypotheses that hold in it. forecasts: of each model that was expanded. noise: the scale,
    None: as the model shows it that leaves least. completed: models at their estimates with all unknowns freed, and the
    weight of a square at which they were. n_expanded: how often a model was expanded. refused: models that diverge, are
    hopeless, or hold a fault that hardly moves its record. in_vain: models that were expanded in turn without a better
    one, far from the noise.
    """

    library: Library
    known: dict[EffectKey, Hypothesis]
    faults: list[Hypothesis] = field(default_factory=list)
    drifts: list[Hypothesis] = field(default_factory=list)
    constants: list[Unknown] = field(default_factory=list)
    fits: dict[Hypotheses, Fit] = field(default_factory=dict)
    forecasts: dict[Hypotheses, list[Forecast]] = field(default_factory=dict)
    noise: Scale | None = None
    completed: dict[Hypotheses, float] = field(default_factory=dict)
    n_expanded: int = 0
    refused: set[Hypotheses] = field(default_factory=set)
    in_vain: int = 0
    _evidence: WeakKeyDictionary[Fit, dict[Scale, float]] = field(default_factory=WeakKeyDictionary)
    _scale: WeakKeyDictionary[Fit, Scale] = field(default_factory=WeakKeyDictionary)

    @property
    def declared(self) -> Fit:
        return self.fits[frozenset()]

    def scale(self) -> Scale:
        """Return the scale of the model that leaves least: it shows what is noise."""
        if self.noise is not None:
            return self.noise
        best = min(self.fits.values(), key=lambda f: f.chi2 + f.records.data.log_cover)
        if best not in self._scale:
            self._scale[best] = scale_of(best)
        return self._scale[best]

    def log_posterior(self, model: Hypotheses, scale: Scale | None = None) -> float:
        """Return the log posterior of a model, up to a constant."""
        fit, scale = self.fits[model], scale or self.scale()
        known = self._evidence.setdefault(fit, {})
        if scale not in known:
            known[scale] = log_evidence(expansion_of(fit, scale, self.library))
        return known[scale] + log_prior(model)

    def ranked(self) -> list[tuple[Hypotheses, float]]:
        """Return the models with their log posteriors, the best first."""
        scale = self.scale()
        ranking = [(model, self.log_posterior(model, scale)) for model in self.fits]
        return sorted(ranking, key=lambda pair: -pair[1])

    def take(self, model: Hypotheses, fit: Fit | None) -> bool:
        """Keep a fit where it is better than the one that is known; tell whether it is.

        What was forecast about a worse fit, whose misfit asked for other hypotheses, is forgotten.
        """
        if fit is None or not np.isfinite(fit.chi2):
            return False
        known = self.fits.get(model)
        if known is not None:
            scale = self.scale()
            rise = log_evidence(expansion_of(fit, scale, self.library)) + log_prior(model)
            rise -= self.log_posterior(model, scale)
            if not rise > 0.0:
                return False
            if rise > UNTOLD:
                self.forecasts.pop(model, None)
        self.fits[model] = fit
        self.completed.pop(model, None)
        return True

    def take_or_refuse(self, model: Hypotheses, fit: Fit | None) -> None:
        """Keep a fit as `take` does; refuse a model that has none."""
        if not self.take(model, fit) and model not in self.fits:
            self.refused.add(model)


def explore(library: Library, declared: Fit, most: int | None = None) -> Exploration:
    """Return the models that the train records ask for, from the declared one on.

    declared: its fit. most: models that are expanded, None: as many as the samples allow.
    """
    exploration = begun(library, declared)
    expand_all(exploration, 1)
    if not is_near(exploration):
        take_from_short_pieces(exploration)
    if expand_all(exploration, most) and add_unknown(exploration):
        expand_all(exploration, most)
    add_unknown(exploration)
    finish_all(exploration)
    for _ in range(MOST_ENDS):
        best = exploration.ranked()[0][0]
        if best in exploration.forecasts or exploration.fits[best].records.data.cover is not None:
            break
        # Drops from larger models led here: what may replace its effects was never fitted.
        expand(exploration, best)
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


def expand_all(exploration: Exploration, most: int | None) -> bool:
    """Expand models while one that may be right is not expanded; tell whether none is left.

    most: models that are expanded in all, None: as many as the samples allow.
    """
    cost = len(exploration.declared.residual) / SAMPLES * (1.0 + len(exploration.constants) / USUAL_CONSTANTS)
    most = most or int(np.clip(MOST_EXPANDED / cost, FEWEST_EXPANDED, MOST_EXPANDED))
    while exploration.n_expanded < most and exploration.in_vain < MOST_IN_VAIN:
        model, best = next_model(exploration), exploration.ranked()[0][0]
        if model is None:
            return True
        complete(exploration, model)
        # Near the noise a second name must not stand for a shape of the first that was held.
        for less in simpler(exploration, model) if is_near(exploration) else []:
            if may_be_far_off(exploration, less):
                complete(exploration, less)
        if next_model(exploration) == model:
            expand(exploration, model)
            finish(exploration)
            is_better = exploration.ranked()[0][0] != best or is_near(exploration)
            exploration.in_vain = 0 if is_better else exploration.in_vain + 1
    return False


def take_from_short_pieces(exploration: Exploration) -> None:
    """Take the models that lead on short pieces of the records, carried on to the whole ones: see `shooting`."""
    library, constants = exploration.library, exploration.constants
    begin = on_short_pieces(library, exploration.declared)
    if begin is None:
        return
    library.say("looking at short pieces of the records")
    short = begun(*begin)
    expand_all(short, FEWEST_EXPANDED)
    leaders = [m for m, _ in short.ranked() if m and all(h.kind == "effect" for h in m)][:BEAM]
    carried = library.each(lambda m: unless_diverged(partial(on_whole_records, short.fits[m], library)), leaders)
    for model, fit in zip(leaders, carried, strict=True):
        weight = exploration.scale().weight
        exploration.take(model, fit and with_constants(fit, constants, weight))


def without_denied(exploration: Exploration, denied: Hypotheses, standing: Hypotheses) -> Exploration:
    """Return what was explored without hypotheses that held-out records deny, and without larger sets than what stands.

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


def add_unknown(exploration: Exploration) -> bool:
    """Add a signal without a form to the best models; tell whether there is a new one.

    Where the best model leaves noise alone, to those with a name less: several wrong names together can explain an
    effect that the library does not hold.
    """
    ranked = exploration.ranked()
    if any(h.kind == "unknown" for m in exploration.fits for h in m):
        return False
    best = ranked[0][0]
    models = [*simpler(exploration, best)[:N_BESIDE], *([frozenset[Hypothesis]()] if best else [])]
    if is_significant(exploration.fits[best]):
        models = [*(m for m, _ in ranked[:N_BESIDE]), *models]
    return add_signals(exploration, list(dict.fromkeys(models)))


def add_signals(exploration: Exploration, models: Sequence[Hypotheses]) -> bool:
    """Add signals without a form to some models; return whether a model is new."""
    library, scale, before = exploration.library, exploration.scale(), len(exploration.fits)
    limit = limit_of(exploration, scale)
    for model in models:
        fit = exploration.fits[model]
        about = expansion_of(fit, scale, library)
        ahead = sorted((forecast(about, p) for p in unknown.propose(fit, library)), key=lambda f: -f.posterior)
        for one in ahead[:N_SIGNALS]:
            for key, make in trial_of(exploration, model, about, one, limit):
                if key not in exploration.refused:
                    exploration.take_or_refuse(key, make())
    return len(exploration.fits) > before


def next_model(exploration: Exploration) -> Hypotheses | None:
    """Return the model that is to be expanded next, None where all in the window are.

    Where the best model leaves more than noise, the best ones of each smaller size may lead on as well: a strong second
    effect can mislead the choice of the first. Far from the noise these come first, the smallest before all (a beam).
    """
    ranked = exploration.ranked()
    best, top = ranked[0]
    expanded = [(m, value) for m, value in ranked if m in exploration.forecasts]
    near = [m for m, value in ranked if value > top - WINDOW
            and not (is_outdone(m, value, ranked) or has_twin(m, value, expanded))]  # fmt: skip
    if is_significant(exploration.fits[best]) and exploration.fits[best].records.data.cover is None:
        plain = [m for m, _ in ranked if all(h.kind == "effect" for h in m)]
        beam = [m for n in range(1, len(best) + 1) for m in [m for m in plain if len(m) == n][:BEAM]]
        near = [*near, *beam] if is_near(exploration) else [*beam, *near]
    return next((m for m in near if m not in exploration.forecasts and len(m) < MOST_EFFECTS), None)


def has_twin(model: Hypotheses, value: float, expanded: Sequence[tuple[Hypotheses, float]]) -> bool:
    """Tell whether a model of the same names in other forms that may be right was expanded: it has the same neighbours.

    The model at which the search ends is expanded all the same.
    """
    names = {h.public for h in model}
    return any(m != model and {h.public for h in m} == names and other > value - WINDOW for m, other in expanded)


def is_outdone(model: Hypotheses, value: float, ranked: Sequence[tuple[Hypotheses, float]]) -> bool:
    """Tell whether a model with fewer of its hypotheses is more probable: such a model is not expanded."""
    return any(less < model and more > value for less, more in ranked)


def with_constants(fit: Fit, constants: Sequence[Unknown], weight: float) -> Fit:
    """Return a fit with all its further unknowns freed again, the constants that have a tolerance among them."""
    kept = [f.unknown for f in fit.others if not f.unknown.name.startswith(NAMED)]
    if not (kept or constants):
        return replace(fit, rough=False)
    again = unless_diverged(lambda: freed(fit, fit.base or fit.records, [*kept, *constants], weight))
    return replace(again or fit, rough=False)


def expand(exploration: Exploration, model: Hypotheses) -> None:
    """Fit the most promising changes of a model: additions of every kind, pairs, swaps, drops, free shapes."""
    fit, library, scale = exploration.fits[model], exploration.library, exploration.scale()
    library = library.for_misfit(fit.misfit) if fit.base is None else library
    library.say(f"expanding {words(model) if model else 'the declared model'}")
    about, held = expansion_of(fit, scale, library), expansion_of(fit, scale, library, with_doubts=False)
    proposals: list[Proposal] = effects.propose(fit, exploration.known, library)
    names = {h.public for h in model}
    others = [*faults.propose(fit, exploration.faults, library), *drifts.propose(fit, exploration.drifts)]
    others = [p for p in others if p.hypothesis.public not in names]
    ahead = [forecast(about, p) for p in proposals]
    ahead_held = [forecast(held, p) for p in proposals]
    beside = [forecast(about, p) for p in others]
    exploration.forecasts[model] = [f.without_columns for f in (*ahead, *beside)]
    exploration.n_expanded += 1
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
    if is_far and model == ranked[0][0]:  # before the drops: it fits what it stands on
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


def best_begun(
    exploration: Exploration, model: Hypotheses, about: Expansion, ahead: Sequence[Forecast], limit: float, n: int
) -> list[Trial]:
    """Return the additions whose first steps lead farthest: far from noise a straight line is a poor guess."""
    fit, library = about.fit, exploration.library
    begun = library.each(lambda a: effects.first_steps(fit, about, a, library), ahead)
    best = sorted(range(len(ahead)), key=lambda i: begun[i][0])[:n]
    return [t for i in best for t in trial_of(exploration, model, about, ahead[i], limit, begun[i][1])]


def exchanges(exploration: Exploration, model: Hypotheses, fit: Fit, limit: float) -> list[Trial]:
    """Return the fits in which another effect takes the place of one of several, by its first steps there.

    The effect that explains most alone may be wrong together with the others.
    """
    scale, trials = exploration.scale(), []
    hypotheses = [h for h in sorted(model) if h.kind == "effect"]
    for hypothesis in hypotheses if len(hypotheses) > 1 else []:
        less = model - {hypothesis}
        if less not in exploration.fits:
            again = unless_diverged(partial(without, fit, hypothesis, exploration.library, scale.weight))
            exploration.take(less, again)
        if less not in exploration.fits or less in exploration.forecasts:
            continue
        about = expansion_of(exploration.fits[less], scale, exploration.library, with_doubts=False)
        proposals = [p for p in effects.propose(about.fit, exploration.known, exploration.library)
                     if p.hypothesis.name != hypothesis.name]  # fmt: skip
        trials += best_begun(exploration, less, about, [forecast(about, p) for p in proposals], limit, N_EXCHANGED)
    return trials


def limit_of(exploration: Exploration, scale: Scale) -> float:
    """Return the sum of squares from which on a model is given up: far below the best one's posterior."""
    best = max(value for _, value in exploration.ranked()[:1])
    return scale.reach(min(best - HOPELESS, -1.0)) if np.isfinite(best) else np.inf


def leading(forecasts: Sequence[Forecast]) -> list[Forecast]:
    """Return those of each kind that lead and that are not improbable."""
    leaders = []
    for kind in ("record", "drift"):
        mine = [f for f in forecasts if f.proposal.hypothesis.kind == kind and f.posterior > REFITTED]
        leaders += sorted(mine, key=lambda f: -f.posterior)[:N_OTHERS]
    return leaders


def trial_of(
    exploration: Exploration, model: Hypotheses, about: Expansion, ahead: Forecast, limit: float, *begun: Array
) -> list[Trial]:
    """Return the fit of a model with one hypothesis more, where it is not known."""
    key = model | {ahead.proposal.hypothesis}
    if key in exploration.fits or not np.isfinite(ahead.total):
        return []
    return [(key, partial(ahead.proposal.refit, about.fit, about, ahead, limit, *begun))]


def drops(exploration: Exploration, model: Hypotheses, again: bool = False) -> list[Trial]:
    """Return the fits of a model without one of its effects, faults or drifts.

    A fault that imitated an effect keeps its place with a size of 0 when the effect is added.
    again: those without an effect that were fitted from elsewhere, too: they may have missed the valley to which the
    larger model led, and a name that nothing asks for would seem needed.
    """
    fit, weight, trials = exploration.fits[model], exploration.scale().weight, list[Trial]()
    sizes = {f.unknown.name for f in fit.others}
    for hypothesis in sorted(model):
        key, is_effect = model - {hypothesis}, hypothesis.kind == "effect"
        is_new = key not in exploration.fits and key not in exploration.refused
        is_asked = is_new or (again and is_effect and bool(key))
        if is_asked and (is_effect or name_of_size(hypothesis) in sizes):
            trials.append((key, partial(without, fit, hypothesis, exploration.library, weight)))
    return trials


def without(fit: Fit, hypothesis: Hypothesis, library: Library, weight: float) -> Fit | None:
    """Return a fit without an effect, or without the size of a fault or drift."""
    if hypothesis.kind == "effect":
        active = tuple(k for k in fit.active if k.declared != hypothesis.means)
        return near(fit, active, [fit.values], library, weight)
    base, kept = fit.base, [f.unknown for f in fit.others if f.unknown.name != name_of_size(hypothesis)]
    assert base is not None
    return unless_diverged(lambda: freed(fit, base, kept, weight, rough=True) if kept else
                           fit_from(base, fit.active, [fit.z], rough=True))  # fmt: skip


def name_of_size(hypothesis: Hypothesis) -> str:
    """Return the name of the unknown that is the size of a fault or drift."""
    return drifts.name_of(hypothesis) if hypothesis.kind == "drift" else hypothesis.name


def near(
    fit: Fit, active: tuple[EffectKey, ...], guesses: Sequence[dict[str, float]], library: Library, weight: float,
    limit: float = np.inf,
) -> Fit | None:  # fmt: skip
    """Return the model with some effects fitted from the best of several values, other unknowns as in a fit."""
    problem = effects.beside(fit, active, library)
    starts = [start_of(problem, values) for values in guesses]
    if len(starts) > 1:
        starts = [starts[int(np.argmin(projected(fit, problem, weight).chi2(np.array(starts))))]]
    return effects.fitted(fit, problem, active, starts, library, weight, limit)


def swaps(
    exploration: Exploration, model: Hypotheses, fit: Fit, scale: Scale, proposals: Sequence[Proposal], limit: float
) -> list[Trial]:
    """Return the fits in which what moves the records most alike takes the place of an effect of a model.

    A swap partner that was never fitted would make a posterior that is sure of the wrong one.
    """
    trials: dict[Hypotheses, Callable[[], Fit | None]] = {}
    for key in fit.active:
        hypothesis = next((h for h in model if h.means == key.declared), None)
        if hypothesis is None:
            continue
        # Constants that are free to stand in for either make twins look like strangers.
        none = np.empty((len(fit.residual), 0))
        about = Expansion(replace(fit, others=()), scale, exploration.library, none, key)
        others = {k.public for k in fit.active if k != key}
        wide = effects.propose_with_free_shapes(fit, key, exploration.known, exploration.library)
        ranking = [likest(about, p) for p in [*proposals, *wide] if p.hypothesis.name not in others]
        ranking.sort(key=lambda pair: pair[0])
        ranking = list({one[1].hypothesis: one for one in ranking}.values())[::-1]
        forms = [one for one in ranking if one[1].hypothesis.name == hypothesis.name]
        for _, proposal, variant, strength in [*forms, *ranking[:N_SWAPPED]]:
            other = model - {hypothesis} | {proposal.hypothesis}
            if not is_complete(exploration, other):  # a known rival may have been fitted from afar
                start = partial(swapped, fit, key, proposal, variant, strength)
                trials[other] = partial(start, exploration.library, scale.weight, limit)
    return list(trials.items())


def likest(about: Expansion, proposal: Proposal) -> tuple[float, Proposal, int, float]:
    """Return how alike a proposal and the effect that an expansion does without move the records: squared cosine.

    Both beyond what the other unknowns can do. Then the variant that is likest, and its strength in the effect's place.
    """
    assert about.without is not None
    fit, own = about.fit, about.fit.owned_by(about.without)
    slopes = fit.jacobian[:, own].T
    nulls = [fit.model.parameters[n].null for n in np.array(list(fit.values))[own]]
    low, span = fit.records.space.low[fit.records.space.free][own], fit.records.span[own]
    away = np.array([0.0 if null is None else z - (null - a) / s
                     for z, null, a, s in zip(fit.z[own], nulls, low, span, strict=True)])  # fmt: skip
    n, grid = len(slopes), proposal.grid
    local = [i for i, a in enumerate(grid) if a.share == effects.SLOPE]
    if not local:
        return 0.0, proposal, 0, 0.0
    gram, _, _ = about.products(np.vstack([slopes, proposal.columns[local]]))
    inner, cross, squares = gram[:n, :n], gram[:n, n:], np.maximum(np.diag(gram)[n:], 1e-300)
    regular = inner + 1e-9 * np.trace(inner) * np.eye(n) + 1e-300 * np.eye(n)
    alike = np.einsum("ij,ij->j", cross, np.linalg.solve(regular, cross)) / squares
    best = int(np.argmax(alike))
    return float(alike[best]), proposal, local[best], float(away @ cross[:, best] / squares[best])


def swapped(
    fit: Fit, key: EffectKey, proposal: Proposal, variant: int, strength: float, library: Library, weight: float,
    limit: float,
) -> Fit | None:  # fmt: skip
    """Return the model with one effect replaced by another, its shapes free where those of the old one are."""
    new: EffectKey = proposal.hypothesis.means
    new = replace(new, free_shape=key.free_shape and bool(library.fixed_shapes(new)))
    active = (*(k for k in fit.active if k != key), new)
    values = {n: v for n, v in fit.values.items() if not key.owns(n)}
    shares = np.clip(strength * STRENGTHS_OF_FORM, 0.01, library.reach)
    guesses = [values | proposal.grid[variant].at(float(share)) for share in shares]
    return near(fit, active, guesses, library, weight, limit)


def pairs(
    exploration: Exploration, model: Hypotheses, about: Expansion, ahead: Sequence[Forecast]
) -> Iterable[tuple[Hypotheses, Fit | None]]:
    """Yield the fits with two effects more that promise clearly more than the best single one."""
    lead = sorted((f for f in ahead if np.isfinite(f.total)), key=lambda f: -f.posterior)[:N_LEADING]
    if len(lead) < 2 or not is_significant(about.fit):
        return
    variants = [f.best(1)[0][0] for f in lead]
    columns = np.array([f.proposal.columns[v] for f, v in zip(lead, variants, strict=True)])
    gram, slope, _ = about.products(columns)
    width = np.array([f.proposal.scales[int(np.argmax(f.log_factor[v]))] for f, v in zip(lead, variants, strict=True)])
    prior = np.array([f.proposal.hypothesis.log_prior + f.proposal.variants[v] - np.log(len(f.proposal.scales))
                      for f, v in zip(lead, variants, strict=True)])  # fmt: skip
    best_single = lead[0].posterior
    values: list[tuple[float, int, int, float, float]] = []
    for i in range(len(lead)):
        for k in range(i + 1, len(lead)):
            if lead[i].proposal.hypothesis.name == lead[k].proposal.hypothesis.name:
                continue
            both = [i, k]
            normal = gram[np.ix_(both, both)] + np.diag(width[both] ** -2.0)
            mean = np.linalg.solve(normal, slope[both])
            if (mean <= 0.0).any():
                continue
            rise = float(about.student(np.array(slope[both] @ mean)))
            _, determinant = np.linalg.slogdet(normal)
            total = rise - 0.5 * determinant - float(np.log(width[both]).sum()) + float(prior[both].sum())
            values.append((total, i, k, float(mean[0]), float(mean[1])))
    for total, i, k, first, second in sorted(values, reverse=True)[:N_PAIRS]:
        one, two = lead[i].proposal, lead[k].proposal
        key = model | {one.hypothesis, two.hypothesis}
        if total <= best_single or key in exploration.fits or len(key) < len(model) + 2:
            continue
        library, values_of = exploration.library, dict(about.fit.values)
        values_of |= one.grid[variants[i]].at(float(np.clip(first, 0.01, library.reach)))
        values_of |= two.grid[variants[k]].at(float(np.clip(second, 0.01, library.reach)))
        active = (*about.fit.active, one.hypothesis.means, two.hypothesis.means)
        yield key, near(about.fit, active, [values_of], library, about.scale.weight)


def finish(exploration: Exploration) -> None:
    """Bring the leading models of the best size to their estimates: rough fits may stand in the wrong order."""
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
        # A name must not stand for its twin, whose rough fit may be far from its estimate.
        twins = [m for m, value in ranked if len(m) == len(best) and len(m - best) == 1 and value > top - HOPELESS]
        todo += [m for m in twins[:N_TWINS]
                 if m not in todo and not is_complete(exploration, m) and may_be_far_off(exploration, m)]  # fmt: skip
        if not todo:
            break
        for model in todo:
            complete(exploration, model)
    weight, top = exploration.scale().weight, exploration.ranked()[0][1]
    for model in [m for m, value in exploration.ranked()[:BEAM] if value > top - WINDOW]:
        exploration.fits[model] = polished(exploration.fits[model], weight)


def simpler(exploration: Exploration, model: Hypotheses) -> list[Hypotheses]:
    """Return the known models that lack one effect of a model, the most probable first."""
    less = [model - {h} for h in sorted(model) if h.kind == "effect" and model - {h} in exploration.fits]
    return sorted(less, key=lambda m: -exploration.log_posterior(m))


def may_be_far_off(exploration: Exploration, model: Hypotheses) -> bool:
    """Tell whether a rough fit of a model may be far from its estimate.

    That holds where an effect has a shape that its declaration holds, or records start as they do in another model.
    """
    fit = exploration.fits[model]
    return fits_starts(fit.records.replays) or any(exploration.library.fixed_shapes(key) for key in fit.active)


def is_complete(exploration: Exploration, model: Hypotheses) -> bool:
    """Tell whether a model is at its estimate for about the weight that a square has by now."""
    known = exploration.completed.get(model, 0.0)
    return 0.5 < known / exploration.scale().weight < 2.0


def complete(exploration: Exploration, model: Hypotheses) -> None:
    """Bring a model to its estimate, with its shapes, its constants and its further unknowns freed.

    Where that makes it the best, a square weighs more than before, and constants are freed once more.
    """
    for _ in range(MOST_COMPLETED):
        if is_complete(exploration, model):
            return
        weight = exploration.completed[model] = exploration.scale().weight
        if not (model or exploration.constants):
            return
        fit = exploration.fits[model]
        again = unless_diverged(partial(completed, fit, exploration.library, exploration.constants, weight))
        exploration.fits[model] = again or replace(exploration.fits[model], rough=False)


def is_near(exploration: Exploration) -> bool:
    """Tell whether the best model is near the noise, so that a few log units count."""
    return NEAR_NOISE * exploration.scale().weight * len(exploration.declared.residual) > exploration.scale().n


def completed(fit: Fit, library: Library, constants: Sequence[Unknown], weight: float) -> Fit:
    """Return a fit at its estimate, its further unknowns freed again, and its shapes where chi2 falls."""
    if fit.records.data.cover is not None:
        return replace(fit, rough=False)
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
    wide = with_free_shapes(fit, key, library, effects.beside(fit, active, library))
    return finished(replace(wide, others=fit.others, base=effects.base_of(fit, active, library)), library)
