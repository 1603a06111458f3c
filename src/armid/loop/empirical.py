"""The empirical term: what is added, without a name, where no effect of the library will do."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from armid.errors import ArmidError
from armid.inference.checks import is_significant
from armid.inference.library import UNNAMED, EffectKey, Library, joined
from armid.inference.missing_signal import (
    N_HEIGHTS,
    Dependence,
    Missing,
    bump_at,
    curve_variables,
    knows,
    missing_from,
)
from armid.inference.model import Fit, fit_from
from armid.inference.refit import unless_diverged
from armid.inference.score_test import free_values
from armid.loop.equivalence import WITHIN
from armid.loop.fit import behind, compare, criterion, predicted_alike
from armid.loop.search import Search
from armid.model import Effect, Model, Parameter

# Variables that a compiled term can choose from; factor of a curve -> the parameter that chooses it.
SLOTS = 8
FACTORS = {"1": "one", "direction": "direction", "drive_effort": "driven"}
# Heights may grow to so many times the largest that was guessed.
GROWTH = 20.0
# So many curves are fitted fully: those that remove most, and those that predict left-out records best; both judge on
# straight lines through a model that is not straight.
MOST_REMOVING, MOST_PREDICTING = 3, 2


@dataclass(frozen=True, eq=False)
class Term:
    """Hold a model with an empirical term, the last of its effects.

    dependence: the curve it began from. search: with the term in its library. others: ports at which another curve
    would do as well by the criterion.
    """

    fit: Fit
    dependence: Dependence
    search: Search
    others: tuple[str, ...] = ()


def empirical_term(named: Fit, search: Search) -> tuple[Missing | None, Term | None]:
    """Recover what a model with named effects lacks, and add a term without a name where that earns its parameters.

    The term stands beside the names, of which none is claimed then. It is judged as an effect is: by what is left out
    of the fit, and where the misfit dwarfs the noise by more than a standard error of that. Returns (None, None) where
    nothing significant is left.
    """
    if not is_significant(named):
        return None, None
    library = with_terms(search.library)
    library.say("recovering the missing signal without a form")
    missing = missing_from(named, library)
    n_eff = named.independent
    for term in terms(missing, replace(search, library=library)):
        if criterion(term.fit, n_eff) >= criterion(named, n_eff):
            break
        judged = compare(named, term.fit, n_extra=max(term.fit.n_free - named.n_free, 1))
        if judged.why or judged.left_out[1] >= judged.left_out[0] or not term.fit.needs(term.fit.active[-1]):
            continue
        if not named.dwarfs_noise or named not in predicted_alike([named, term.fit]):
            return missing, term
    return missing, None


def terms(missing: Missing, search: Search) -> list[Term]:
    """Fit the leading curves to what a model lacks, the best first."""
    predicting = sorted(missing.dependences, key=lambda d: -d.share)
    leading = tuple(dict.fromkeys([*missing.dependences[:MOST_REMOVING], *predicting[:MOST_PREDICTING]]))
    for dependence in leading:
        search.library.say(f"fitting a curve over {dependence.variable} at port {dependence.port}")
    # Another curve may compose with the model, and not diverge, where one does not.
    tried = search.library.each(unless_diverged, [partial(term_of, d, missing, search) for d in leading])
    found = sorted((t for t in tried if t is not None),
                   key=lambda t: criterion(t.fit, missing.lacking.independent))  # fmt: skip
    near = [{o.dependence.port: None for o in found if behind(o.fit, t.fit) < WITHIN} for t in found]
    return [replace(t, others=tuple(port for port in ports if port != t.dependence.port))
            for t, ports in zip(found, near, strict=True)]  # fmt: skip


def term_of(dependence: Dependence, missing: Missing, search: Search) -> Term:
    """Fit one curve together with all other parameters.

    Raises ArmidError where the term cannot be compiled with the others.
    """
    lacking, library = missing.lacking, search.library
    effect, heights = empirical_effect(library.declared, dependence)
    key = EffectKey(effect.name)
    if key not in library.candidates:
        raise ArmidError(f"a term at port {effect.name} cannot be composed with the candidates")
    library = replace(library, candidates={**library.candidates, key: effect}, _models={}, _problems={})
    records = library.problem((*lacking.active, key), lacking.values)
    flat = free_values(records, lacking.values)
    guess = np.array([heights.get(n, v) for n, v in zip(records.space.free_names, flat, strict=True)])
    # The heights are a straight line's guess: where they are worse than none, the fit begins without.
    starts = np.array([np.clip(records.shares(v), 1e-3, 1.0 - 1e-3) for v in (guess, flat)])
    fit = fit_from(records, (*lacking.active, key), [starts[int(np.argmin(records.chi2(starts)))]])
    extended = replace(search, library=library, fits=dict(search.fits), scores=dict(search.scores))
    return Term(fit, dependence, extended)


def with_terms(library: Library) -> Library:
    """Return a library whose first bundle holds a term and a test signal at each port too.

    They are compiled together with all other candidates, once and for whatever curve: which it is, parameters say.
    Ports that need what every variable is made of (a circle) have no term.
    """
    declared, model = library.declared, library.compiled_model(())
    usable = {port: usable_variables(declared, port) for port in declared.plant.ports}
    wanted = [term_at(declared, port, variables, None) for port, variables in usable.items() if variables]
    added: dict[EffectKey, Effect] = {}
    for effect in (*wanted, *(bump_at(port) for port in declared.plant.ports)):
        extended = joined(model, effect)
        if extended is not None:
            model, added[EffectKey(effect.name)] = extended, effect
    bundles = ((*(library.bundles[0] if library.bundles else ()), *added), *library.bundles[1:])
    return replace(library, candidates={**library.candidates, **added}, bundles=bundles, _models={}, _problems={})


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


def product(variable, one):  # type: ignore[no-untyped-def]
    """Return a variable times a parameter: the least that a term could be."""
    return one * variable


def empirical_effect(model: Model, found: Dependence) -> tuple[Effect, dict[str, float]]:
    """Return the term with the shape of a dependence, and the heights from which a fit may start (name -> SI).

    Raises ArmidError where the port needs what the term would be made of: a circle.
    """
    variables = usable_variables(model, found.port)
    driven = found.factor == "drive_effort"
    if found.variable not in variables or (driven and not composes(model, found.port, "drive_effort")):
        raise ArmidError(f"a curve over {found.variable} cannot stand at port {found.port}, which it is made of")
    effect = term_at(model, found.port, variables, found)
    return effect, {f"{effect.name}.h{i}": float(h) for i, h in enumerate(found.heights)}


def usable_variables(model: Model, port: str) -> list[str]:
    """Return the variables over which a curve can stand at a port, as many as there are slots."""
    return [v for v in curve_variables(model) if composes(model, port, v)][:SLOTS]


def composes(model: Model, port: str, variable: str) -> bool:
    one = Parameter("one", "1", 0.0, 1.0, null=0.0)
    trial = Effect("trial", (one,), {port: product}, binds={"variable": variable})
    return knows(model, variable) and joined(model, trial) is not None


def term_at(model: Model, port: str, variables: Sequence[str], found: Dependence | None) -> Effect:
    """Return the term at a port with the values that make it one curve; at rest where no dependence is given.

    Parameters choose variable, factor and range; slots without a variable take the time, at weight 0.
    """
    span = GROWTH * (float(np.abs(found.heights).max()) if found is not None else 1.0) or GROWTH
    unit = model.plant.ports[port]
    heights = [Parameter(f"h{i}", unit, -span, span, null=0.0) for i in range(N_HEIGHTS)]
    chosen = {f"w{i}": 0.0 for i in range(SLOTS)} | dict.fromkeys(FACTORS.values(), 0.0) | {"first": -1.0, "last": 1.0}
    if found is not None:
        chosen[f"w{variables.index(found.variable)}"] = chosen[FACTORS[found.factor]] = 1.0
        chosen |= {"first": found.first, "last": found.last}
    chosen["width"] = 0.005 * model.plant.scales.speed
    note = "of the curve: which one it is"
    fixed = [Parameter(name, "1", v - 1.0, v + 1.0, fixed=v, note=note) for name, v in chosen.items()]
    curve_note = "" if found is None else f"; a curve over {found.variable}, times {found.factor}"
    binds = {f"v{i}": variables[i] if i < len(variables) else "time" for i in range(SLOTS)}
    binds["speed"] = "omega" if composes(model, port, "omega") else "time"
    binds["effort"] = "drive_effort" if composes(model, port, "drive_effort") else "time"
    return Effect(f"{UNNAMED}{port}", (*heights, *fixed), {port: any_curve},
                  note=f"empirical: no name is claimed{curve_note}", binds=binds)  # fmt: skip
