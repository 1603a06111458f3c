"""What a search has fitted, and the neighbours of a model.

A neighbour has one effect, fault or drift more; a pair of effects more; one fewer (a drop); another effect, by its
first steps (an exchange) or by its likeness (a swap, other forms too). `search` adds signals, and frees shapes.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from weakref import WeakKeyDictionary

import numpy as np

from armid.estimation.constants import NAMED, Product
from armid.inference.candidates import CONSTANT, EffectKey
from armid.inference.checks import is_significant, square_along
from armid.inference.decisions import HOPELESS, REFITTED, WINDOW
from armid.inference.evidence import Expansion, Forecast, Scale, expansion_of, forecast, log_evidence, scale_of
from armid.inference.kinds import effects
from armid.inference.kinds.hypothesis import Hypotheses, Hypothesis, Proposal, log_prior
from armid.inference.library import Library
from armid.inference.model import UNTOLD, Fit, beyond, decomposed, fit_from, start_of, unless_diverged
from armid.inference.unknowns import Unknown, constant, freed, projected
from armid.model import Array

Trial = tuple[Hypotheses, Callable[[], Fit | None]]
# Budgets of computing: additions of other kinds that are fitted at each model, pairs, swaps of each effect, exchanges.
N_OTHERS, N_PAIRS, N_SWAPPED, N_EXCHANGED = 3, 3, 3, 2
# Leading additions from which pairs are made.
N_LEADING = 24
# Mean square of the residual over that of the noise below which a search counts as near the noise.
NEAR_NOISE = 2.0
# Deviation of a constant that counts as exact and is tried instead of an effect, and how many of them are.
DOUBTED, N_INSTEAD = 0.1, 2
# Strengths at which a swapped effect is tried, as multiples of the linear guess.
STRENGTHS_OF_FORM = 2.0 ** np.arange(-4, 5)


@dataclass(eq=False)
class Exploration:
    """Hold every model that was fitted.

    fits: by the hypotheses that hold in it. forecasts: of each model that was expanded. noise: the scale, None: that of
    the model that leaves least. completed: models that were brought to their estimates, and the weight of a square at
    which they were. is_led: whether a search on some of the records led to the first models. n_expanded: how often a
    model was expanded, in usual expansions. refused: models that diverge, are hopeless, or hold a fault that hardly
    moves its record. in_vain: models that were expanded in turn without a better one, far from the noise.
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
    is_led: bool = False
    n_expanded: float = 0.0
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

        Forecasts from the worse fit, whose misfit asked for other hypotheses, are deleted.
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


def best_begun(
    exploration: Exploration, model: Hypotheses, about: Expansion, ahead: Sequence[Forecast], limit: float, n: int
) -> list[Trial]:
    """Return the trials of the additions whose first steps leave least: a straight line misleads far from noise."""
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
    """Return the sum of squares above which a fit stops: it is hopelessly behind the best model."""
    best = exploration.ranked()[0][1]
    return scale.reach(min(best - HOPELESS, -1.0)) if np.isfinite(best) else np.inf


def leading(forecasts: Sequence[Forecast]) -> list[Forecast]:
    """Return the leading forecasts of each kind, without improbable ones."""
    leaders = []
    for kind in dict.fromkeys(f.proposal.hypothesis.kind for f in forecasts):
        mine = [f for f in forecasts if f.proposal.hypothesis.kind == kind and f.posterior > REFITTED]
        leaders += sorted(mine, key=lambda f: -f.posterior)[:N_OTHERS]
    return leaders


def trial_of(
    exploration: Exploration, model: Hypotheses, about: Expansion, ahead: Forecast, limit: float, *begun: Array
) -> list[Trial]:
    """Return the trial of a model with one hypothesis more, none where it is fitted already."""
    key = model | {ahead.proposal.hypothesis}
    if key in exploration.fits or not np.isfinite(ahead.total):
        return []
    return [(key, partial(ahead.proposal.refit, about.fit, about, ahead, limit, *begun))]


def drops(exploration: Exploration, model: Hypotheses, again: bool = False) -> list[Trial]:
    """Return the fits of a model without one of its effects, faults or drifts.

    A fault may have imitated an effect, and have a size of 0 now.
    again: fit smaller models from here, too. Their first fit may have missed this minimum, and the name seem needed.
    """
    fit, weight, trials = exploration.fits[model], exploration.scale().weight, list[Trial]()
    sizes = {f.unknown.name for f in fit.others}
    for hypothesis in sorted(model):
        key, is_effect = model - {hypothesis}, hypothesis.kind == "effect"
        is_new = key not in exploration.fits and key not in exploration.refused
        is_asked = is_new or (again and is_effect and bool(key))
        if is_asked and (is_effect or hypothesis.size_name in sizes):
            trials.append((key, partial(without, fit, hypothesis, exploration.library, weight)))
    return trials


def without(fit: Fit, hypothesis: Hypothesis, library: Library, weight: float) -> Fit | None:
    """Return a fit without an effect, or without the size of a fault or drift."""
    if hypothesis.kind == "effect":
        active = tuple(k for k in fit.active if k.declared != hypothesis.means)
        return near(fit, active, [fit.values], library, weight)
    base, kept = fit.base, [f.unknown for f in fit.others if f.unknown.name != hypothesis.size_name]
    assert base is not None
    return unless_diverged(lambda: freed(fit, base, kept, weight, rough=True) if kept else
                           fit_from(base, fit.active, [fit.z], rough=True))  # fmt: skip


def constants_instead(
    exploration: Exploration, model: Hypotheses, hypothesis: Hypothesis, names: Sequence[str]
) -> dict[str, float]:
    """Return the constants that explain the records as well as an effect of a model, and by which share they are off.

    names: of constants that count as exact. Those that would leave least to first order are fitted in its place.
    Nothing stands in for a constant that is known roughly.
    """
    if not names or hypothesis.name.startswith(CONSTANT):
        return {}
    scale, fit = exploration.scale(), exploration.fits[model]
    less = exploration.fits.get(model - {hypothesis}) or without(fit, hypothesis, exploration.library, scale.weight)
    if less is None:
        return {}
    kept = [f.unknown for f in less.others]
    known = np.column_stack([less.jacobian, *(f.column for f in less.others)])
    basis, found = decomposed(known)[0], dict[str, float]()

    def explained(product: Product) -> float:
        return square_along(beyond(basis, product.slope[:, np.newaxis]), less.residual)[0]

    tried = sorted(less.products(dict.fromkeys(names, DOUBTED)), key=lambda p: -explained(p))[:N_INSTEAD]
    for product in tried:
        unknowns = [*kept, constant(product)]
        again = unless_diverged(partial(freed, less, less.base or less.records, unknowns, scale.weight))
        if again is not None and scale.weight * (again.chi2 - fit.chi2) < 2.0 * WINDOW:
            found[product.public.removeprefix(NAMED)] = again.constants[product.names[0]]
    return found


def near(
    fit: Fit, active: tuple[EffectKey, ...], guesses: Sequence[dict[str, float]], library: Library, weight: float,
    limit: float = np.inf,
) -> Fit | None:  # fmt: skip
    """Fit a model with some effects from the best of several guesses, its further unknowns as in another fit."""
    problem = effects.records_with(fit, active, library)
    starts = [start_of(problem, values) for values in guesses]
    if len(starts) > 1:
        starts = [starts[int(np.argmin(projected(fit, problem, weight).chi2(np.array(starts))))]]
    return effects.fitted(fit, problem, active, starts, library, weight, limit)


def swaps(
    exploration: Exploration, model: Hypotheses, fit: Fit, scale: Scale, proposals: Sequence[Proposal], limit: float
) -> list[Trial]:
    """Return, for each effect, the fits of the replacements whose columns have the largest cosine with its own.

    Otherwise the posterior would be too sure of the effect that was tried first.
    """
    trials: dict[Hypotheses, Callable[[], Fit | None]] = {}
    for key in fit.active:
        hypothesis = next((h for h in model if h.means == key.declared), None)
        if hypothesis is None:
            continue
        # Constants that are free would hide the likeness.
        alone = expansion_of(replace(fit, others=()), scale, exploration.library, with_doubts=False)
        about = replace(alone, without=key)
        others = {k.public for k in fit.active if k != key}
        wide = effects.propose_with_free_shapes(fit, key, exploration.known, exploration.library)
        ranking = [likeness(about, p) for p in [*proposals, *wide] if p.hypothesis.name not in others]
        ranking.sort(key=lambda pair: pair[0])
        ranking = list({one[1].hypothesis: one for one in ranking}.values())[::-1]
        # all forms of a name as soon as it is worth a fit, as for additions
        likest = dict.fromkeys(one[1].hypothesis.name for one in ranking if one[1].hypothesis.name != hypothesis.name)
        names = {hypothesis.name, *list(likest)[:N_SWAPPED]}
        for _, proposal, variant, strength in (one for one in ranking if one[1].hypothesis.name in names):
            other = model - {hypothesis} | {proposal.hypothesis}
            if not is_complete(exploration, other):  # a known rival may have been fitted from afar
                start = partial(swapped, fit, key, proposal, variant, strength)
                trials[other] = partial(start, exploration.library, scale.weight, limit)
    return list(trials.items())


def likeness(about: Expansion, proposal: Proposal) -> tuple[float, Proposal, int, float]:
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
    """Return the model with one effect replaced by another, its shapes free where those of the old one are.

    What both call by one name, as forms of an effect do, may have the value that it had.
    """
    new: EffectKey = proposal.hypothesis.means
    new = replace(new, free_shape=key.free_shape and bool(library.fixed_shapes(new)))
    active = (*(k for k in fit.active if k != key), new)
    values = {n: v for n, v in fit.values.items() if not key.owns(n)}
    shares = library.reachable(strength * STRENGTHS_OF_FORM)
    guesses = [values | proposal.grid[variant].at(float(share)) for share in shares]
    owned = {n.rpartition(".")[2]: v for n, v in fit.values.items() if key.owns(n)}
    common = {n: owned[name] for n in guesses[0] if new.owns(n) and (name := n.rpartition(".")[2]) in owned}
    guesses += [guesses[0] | common] if common else []
    return near(fit, active, guesses, library, weight, limit)


def pairs(
    exploration: Exploration, model: Hypotheses, about: Expansion, ahead: Sequence[Forecast]
) -> Iterable[tuple[Hypotheses, Fit | None]]:
    """Yield fits with two effects more, forecast above the best single one, where more than noise is left."""
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
        values_of |= one.grid[variants[i]].at(float(library.reachable(first)))
        values_of |= two.grid[variants[k]].at(float(library.reachable(second)))
        active = (*about.fit.active, one.hypothesis.means, two.hypothesis.means)
        yield key, near(about.fit, active, [values_of], library, about.scale.weight)


def simpler(exploration: Exploration, model: Hypotheses, of_any_kind: bool = False) -> list[Hypotheses]:
    """Return the known models that lack one effect of a model, or one hypothesis, the most probable first."""
    lacking = [model - {h} for h in sorted(model) if of_any_kind or h.kind == "effect"]
    less = [m for m in lacking if m in exploration.fits]
    return sorted(less, key=lambda m: -exploration.log_posterior(m))


def is_complete(exploration: Exploration, model: Hypotheses) -> bool:
    """Tell whether a model is at its estimate for about the weight that a square has by now."""
    known = exploration.completed.get(model, 0.0)
    return 0.5 < known / exploration.scale().weight < 2.0


def is_near(exploration: Exploration) -> bool:
    """Tell whether the model that fits best is near the noise, so that a few log units count."""
    return NEAR_NOISE * exploration.scale().weight * len(exploration.declared.residual) > exploration.scale().n
