"""The contract of an effect."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from armid.contract.effect_on_plant import check_on
from armid.contract.finding import Finding
from armid.contract.parameters import check_parameters, finding
from armid.model import PLANTS, ArmidError, Effect, Model, Plant
from armid.model.effect import Equation


def check_effect(effect: Effect, plants: Mapping[str, Plant] = PLANTS, strict: bool = False) -> list[Finding]:
    """Try an effect, in each of its forms, on every plant that offers its ports and names.

    strict: a function without a docstring fails; otherwise that is only said.
    """
    return [f for form in effect.every_form for f in check_form(form, plants, strict)]


def check_form(effect: Effect, plants: Mapping[str, Plant], strict: bool) -> list[Finding]:
    """Try one form of an effect."""
    models, refusals = [], []
    for plant in (p for given in plants.values() for p in (given, *given.variants)):
        try:
            models.append(Model(plant) + effect)
        except ArmidError as error:
            refusals.append(f"{plant.name}: {error}")
    fits = f"fits {', '.join(m.plant.name for m in models)}" if models else fits_none(refusals)
    own = [*check_parameters(effect.parameters), has_null(effect), documented(effect, strict)]
    found = [Finding("binds", bool(models), fits), *own, *(f for model in models for f in check_on(effect, model))]
    return [replace(f, name=f"{f.name} in the form {effect.form}") for f in found] if effect.form else found


def fits_none(refusals: list[str]) -> str:
    """Return why an effect fits no plant, and how a plant of one's own comes to be tried."""
    return f"fits no plant ({'; '.join(refusals)}); --plugin FILE.py:attribute has it tried on your own"


def has_null(effect: Effect) -> Finding:
    """Tell whether there is a value at which the effect vanishes."""
    names = [p.name for p in effect.parameters if p.null is not None]
    text = f"vanishes where {', '.join(names)} is null" if names else "no parameter has a null value"
    return Finding("null values", bool(names), text)


def documented(effect: Effect, strict: bool) -> Finding:
    """Tell whether every function of the effect says what it is."""
    silent = [name for name, f in functions_of(effect) if not (f.__doc__ or "").strip()]
    found = finding("documented", silent, "no docstring: {}", "every function has a docstring")
    return Finding(found.name, found.passed or not strict, found.sentence)


def functions_of(effect: Effect) -> Iterator[tuple[str, Equation]]:
    """Return every function of an effect with the name under which it stands in the graph."""
    yield from ((f"{effect.name}__{port}", f) for port, f in effect.adds.items())
    for state in effect.states:
        yield f"rate__{effect.name}__{state.name}", state.rate
        yield f"initial__{effect.name}__{state.name}", state.initial
    yield from ((f"guard__{effect.name}__{guard.name}", guard.function) for guard in effect.guards)
