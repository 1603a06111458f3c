"""The empirical term: what is added, without a name, where no effect of the library will do."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from armid.errors import ArmidError
from armid.loop.candidates import UNNAMED, Library, applies
from armid.loop.diagnose import diagnose, train_view
from armid.loop.equivalence import WITHIN
from armid.loop.fit import Fit, fit_from
from armid.loop.missing_signal import (
    N_KNOTS,
    Dependence,
    Missing,
    bump_at,
    knows,
    missing_from,
    posed_in,
    variable_names,
)
from armid.loop.search import Search, unless_diverged
from armid.loop.select import FAMILYWISE, criterion, left_out
from armid.model import Effect, Model, Parameter


def hat(place, knot):
    """Return the weight of a knot at a place between 0 and the last knot."""
    return np.maximum(0.0, 1.0 - np.abs(place - knot))


def curve(variable, first, last, h0, h1, h2, h3, h4, h5, h6, h7):
    """Return a curve that runs straight between eight heights and stays level beyond the first and the last."""
    place = 7.0 * np.minimum(np.maximum((variable - first) / (last - first), 0.0), 1.0)
    low = h0 * hat(place, 0.0) + h1 * hat(place, 1.0) + h2 * hat(place, 2.0) + h3 * hat(place, 3.0)
    return low + h4 * hat(place, 4.0) + h5 * hat(place, 5.0) + h6 * hat(place, 6.0) + h7 * hat(place, 7.0)


def any_curve(
    v0, v1, v2, v3, v4, v5, v6, v7, speed, effort, w0, w1, w2, w3, w4, w5, w6, w7, one, direction, driven, width,
    first, last, h0, h1, h2, h3, h4, h5, h6, h7,
):  # fmt: skip
    """Return a curve over the variable whose weight is 1, times 1, the direction of the motion, or the drive's effort.

    Which of them is a parameter, so that one compiled model serves for all.
    """
    variable = w0 * v0 + w1 * v1 + w2 * v2 + w3 * v3 + w4 * v4 + w5 * v5 + w6 * v6 + w7 * v7
    factor = one + direction * speed / np.sqrt(speed**2 + width**2) + driven * effort
    return factor * curve(variable, first, last, h0, h1, h2, h3, h4, h5, h6, h7)


SLOTS = 8
FACTORS = {"1": "one", "direction": "direction", "drive_effort": "driven"}
# Heights may grow to so many times the largest that was guessed.
GROWTH = 20.0


def key_of(port: str) -> str:
    """Return the name under which the term at a port is compiled."""
    return f"{UNNAMED}{port}"


def terms_of(model: Model) -> dict[str, Effect]:
    """Return port -> the term that may be added there, at rest: which curve it is, is decided by its parameters.

    Ports that need what every variable is made of (a circle) have none.
    """
    found = {}
    for port in model.plant.ports:
        variables = usable(model, port)
        if variables:
            found[port] = term_at(model, port, variables, None)
    return found


def empirical_effect(model: Model, found: Dependence) -> tuple[Effect, dict[str, float]]:
    """Return the term with the shape of a dependence, and the heights from which a fit may start (name -> SI).

    Raises ArmidError where the port needs what the term would be made of: a circle.
    """
    variables = usable(model, found.port)
    driven = found.factor == "drive_effort"
    if found.variable not in variables or (driven and not composes(model, found.port, "drive_effort")):
        raise ArmidError(f"a curve over {found.variable} cannot stand at port {found.port}, which it is made of")
    effect = term_at(model, found.port, variables, found)
    return effect, {f"{effect.name}.h{i}": float(h) for i, h in enumerate(found.heights)}


def usable(model: Model, port: str) -> list[str]:
    """Return the variables over which a curve can stand at a port, as many as there are slots."""
    return [v for v in variable_names(model) if composes(model, port, v)][:SLOTS]


def composes(model: Model, port: str, variable: str) -> bool:
    """Tell whether a term at a port may use a variable."""
    one = Parameter("one", "1", 0.0, 1.0, null=0.0)
    trial = Effect("trial", (one,), {port: product}, binds={"variable": variable})
    return knows(model, variable) and applies(model, trial)


def product(variable, one):  # type: ignore[no-untyped-def]
    """Return a variable times a parameter: the least that a term could be."""
    return one * variable


def term_at(model: Model, port: str, variables: Sequence[str], found: Dependence | None) -> Effect:
    """Return the term at a port with the values that make it one curve; at rest where no dependence is told."""
    span = GROWTH * (float(np.abs(found.heights).max()) if found is not None else 1.0) or GROWTH
    unit = model.plant.ports[port]
    heights = [Parameter(f"h{i}", unit, -span, span, null=0.0) for i in range(N_KNOTS)]
    chosen = chosen_values(model, variables, found)
    note = "of the curve: which one it is"
    fixed = [Parameter(name, "1", v - 1.0, v + 1.0, fixed=v, note=note) for name, v in chosen.items()]
    told = "" if found is None else f"; a curve over {found.variable}, times {found.factor}"
    return Effect(key_of(port), (*heights, *fixed), {port: any_curve}, note=f"empirical: no name is claimed{told}",
                  binds=bound(model, port, variables))  # fmt: skip


def chosen_values(model: Model, variables: Sequence[str], found: Dependence | None) -> dict[str, float]:
    """Return the parameters that choose variable, factor and range."""
    weights = {f"w{i}": 0.0 for i in range(SLOTS)}
    factors = dict.fromkeys(FACTORS.values(), 0.0)
    ends = {"first": -1.0, "last": 1.0}
    if found is not None:
        weights[f"w{variables.index(found.variable)}"] = 1.0
        factors[FACTORS[found.factor]] = 1.0
        ends = {"first": found.first, "last": found.last}
    return weights | factors | ends | {"width": 0.005 * model.plant.scales.speed}


def bound(model: Model, port: str, variables: Sequence[str]) -> Mapping[str, str]:
    """Return what the arguments of the curve stand for; slots without a variable take the time, at weight 0."""
    slots = {f"v{i}": variables[i] if i < len(variables) else "time" for i in range(SLOTS)}
    effort = "drive_effort" if composes(model, port, "drive_effort") else "time"
    return slots | {"speed": "omega" if composes(model, port, "omega") else "time", "effort": effort}


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
