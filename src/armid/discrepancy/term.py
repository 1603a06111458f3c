"""The empirical term: what is added, without a name, where no effect of the library will do."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from armid.discrepancy.bundles import applies
from armid.discrepancy.dependence import Dependence
from armid.discrepancy.diagnose import diagnose
from armid.discrepancy.empirical import empirical_effect, terms_of
from armid.discrepancy.fit import Fit, fit_from
from armid.discrepancy.group import WITHIN
from armid.discrepancy.library import Library
from armid.discrepancy.missing import Missing, missing_from, posed_in
from armid.discrepancy.search import Search, unless_diverged
from armid.discrepancy.select import FAMILYWISE, criterion, left_out
from armid.discrepancy.stretch import bump_at
from armid.discrepancy.view import train_view
from armid.model import ArmidError, Effect

Array = NDArray[np.float64]
# So many curves are fitted fully: those that remove most, and those that predict left-out records best; both judge on
# straight lines through a model that is not straight.
MOST_REMOVING, MOST_PREDICTING = 3, 2


@dataclass(frozen=True, eq=False)
class Term:
    """Hold a model with an empirical term, the last of its effects.

    dependence: the curve it began from. search: with the term in its library. others: curves at other ports that would
    do as well by the criterion.
    """

    fit: Fit
    dependence: Dependence
    missing: Missing
    search: Search
    others: tuple[Dependence, ...]


def empirical_term(declared: Fit, named: Fit, search: Search) -> tuple[Missing | None, Term | None]:
    """Recover what a model with named effects lacks, and add a term without a name where that earns its parameters.

    The term is tried on the declared model as well, and each named effect is taken out again beside it: a name that a
    curve makes superfluous was the wrong one. Returns (None, None) where nothing significant is left.
    """
    if not diagnose(train_view(named)).significant:
        return None, None
    found: list[Term] = []
    missing = None
    library = with_terms(search.library)
    for lacking in (named, declared) if named.active else (declared,):
        library.told("recovering the missing signal without a form")
        missing = missing_from(lacking, library)
        found += terms(missing, replace(search, library=library))
    # A curve must do better than the names that it would replace.
    limit = criterion(named, named.independent)
    better = [t for t in found if criterion(t.fit, named.independent) < limit]
    for term in preferred(better, named.independent):
        if earned(declared if len(term.fit.active) == 1 else term.missing.lacking, term.fit):
            return term.missing, term
    return missing, None


def preferred(found: Sequence[Term], n_eff: float) -> list[Term]:
    """Return terms by the criterion, best first; of those that do about as well as the best the fewest names first."""
    ranked = sorted(found, key=lambda t: criterion(t.fit, n_eff))
    if not ranked:
        return []
    near = [t for t in ranked if criterion(t.fit, n_eff) < criterion(ranked[0].fit, n_eff) + WITHIN]
    return sorted(near, key=lambda t: (len(t.fit.active), t.fit.chi2)) + ranked[len(near) :]


def terms(missing: Missing, search: Search) -> list[Term]:
    """Fit the leading curves to what a model lacks, the best first."""
    removing, predicting = missing.dependences, sorted(missing.dependences, key=lambda d: -d.share)
    leading = tuple(dict.fromkeys([*removing[:MOST_REMOVING], *predicting[:MOST_PREDICTING]]))
    for dependence in leading:
        search.library.told(f"fitting a curve over {dependence.variable} at port {dependence.port}")
    # Another curve may compose with the model, and not diverge, where one does not.
    tried = search.library.each(unless_diverged, [partial(term_of, d, missing, search) for d in leading])
    found = [t for t in tried if t is not None]
    found.sort(key=lambda t: criterion(t.fit, missing.lacking.independent))
    return [with_others(t, found) for t in found]


def term_of(dependence: Dependence, missing: Missing, search: Search) -> Term:
    """Fit one curve together with all other parameters, and take out the named effects that it makes superfluous."""
    lacking = missing.lacking
    effect, heights = empirical_effect(search.library.declared, dependence)
    library = with_candidate(search.library, effect)
    records, flat = posed_in(library, lacking, (effect.name,))
    guess = np.array([heights.get(n, v) for n, v in zip(records.space.free_names, flat, strict=True)])
    # The heights are a straight line's guess: where they are worse than none, the fit begins without.
    starts = np.array([np.clip(records.shares(v), 1e-3, 1.0 - 1e-3) for v in (guess, flat)])
    better = starts[int(np.argmin(records.chi2(starts)))]
    fit = fit_from(records, (*lacking.active, effect.name), [better])
    extended = replace(search, library=library, fits=dict(search.fits), scores=dict(search.scores))
    return Term(pruned(fit, extended), dependence, missing, extended, ())


def with_terms(library: Library) -> Library:
    """Return a library whose first bundle holds a term and a test signal at each port too.

    They are compiled together with all other candidates, once and for whatever curve: which it is, parameters say.
    """
    wanted = [*terms_of(library.declared).values(), *(bump_at(port) for port in library.declared.plant.ports)]
    model = library.wide(())
    joined: list[Effect] = []
    for effect in wanted:
        if applies(model, effect):
            model, joined = model + effect, [*joined, effect]
    first = (*(library.bundles[0] if library.bundles else ()), *(e.name for e in joined))
    added = {e.name: e for e in joined}
    return replace(
        library, candidates={**library.candidates, **added}, originals={**library.originals, **added},
        bundles=(first, *library.bundles[1:]), _wide={}, _problems={},
    )  # fmt: skip


def with_candidate(library: Library, effect: Effect) -> Library:
    """Return a library whose term at a port is a certain curve.

    Raises ArmidError where the term cannot be compiled with the others.
    """
    if effect.name not in library.candidates:
        raise ArmidError(f"a term at port {effect.name} cannot be composed with the candidates")
    changed = {effect.name: effect}
    return replace(
        library, candidates={**library.candidates, **changed}, originals={**library.originals, **changed},
        _wide={}, _problems={},
    )  # fmt: skip


def pruned(fit: Fit, search: Search) -> Fit:
    """Return the fit without the named effects that cost more than they bring beside the term."""
    for name in fit.active[:-1]:
        smaller = search.reduced(fit, tuple(n for n in fit.active if n != name))
        if criterion(smaller, fit.independent) <= criterion(fit, fit.independent):
            fit = smaller
    return fit


def with_others(term: Term, found: Sequence[Term]) -> Term:
    """Return a term with the curves at other ports that cannot be told from it."""
    limit = criterion(term.fit, term.fit.independent) + WITHIN
    near = [t.dependence for t in found if criterion(t.fit, term.fit.independent) < limit]
    return replace(term, others=tuple(d for d in near if d.port != term.dependence.port))


def earned(smaller: Fit, larger: Fit) -> bool:
    """Tell whether the heights of a curve are significant, cheaper by the criterion, and better on left-out records."""
    n_eff, extra = max(smaller.independent, larger.independent), max(larger.n_free - smaller.n_free, 1)
    ratio = n_eff * np.log(smaller.chi2 / larger.chi2)
    known = min((level.n_slow for level in larger.records.evidence.levels if level.known), default=n_eff)
    p = float(f_distribution.sf(max(ratio, 0.0) / extra, extra, known))
    cheaper = criterion(larger, n_eff) < criterion(smaller, n_eff)
    if p >= FAMILYWISE or not cheaper:
        return False
    before, after = left_out(smaller, larger)
    return after < before
