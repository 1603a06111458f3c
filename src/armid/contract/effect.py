"""The contract of an effect."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armid.contract.reference import simulate_plainly
from armid.contract.trials import (
    Finding,
    at_null,
    away,
    check_parameters,
    corners,
    finding,
    from_null,
    nominal,
    over_box,
    strengths_of,
    trial_manoeuvres,
)
from armid.engine import FINE, calibrate, simulate
from armid.errors import ArmidError
from armid.model import PLANTS, Effect, Manoeuvre, Model, Plant
from armid.model.effect import Equation

Array = NDArray[np.float64]
# Shares of the plant's speed scale: at null, and against scipy.
NULL_TOLERANCE, REFERENCE_TOLERANCE = 1e-12, 1e-5
N_CANDIDATES, AWAY = 16, 0.3
# Shares of the range at which the response to a strength is compared, and by how much it may bend between them.
SMALL, BENT = np.array([1e-4, 2e-4]), 0.05


def check_on(effect: Effect, model: Model) -> list[Finding]:
    """Try an effect on one plant, the model being that plant with the effect."""
    where = f"on {model.plant.name} in {model.plant.output_unit}"
    manoeuvres = trial_manoeuvres(model.plant)
    try:
        simulate(model, manoeuvres[0].shortened(2), nominal(model))
    except ArmidError as error:
        return [Finding(f"compiles {where}", False, str(error))]
    found = [
        shown(effect, model), null_law(effect, model, manoeuvres), acts(effect, model, manoeuvres),
        responds(effect, model, manoeuvres), finite(model, manoeuvres, corners(model, effect)),
        deterministic(model, manoeuvres[0]), on_arrays(effect, model),
        agrees(model, away(model, effect, AWAY), manoeuvres[0]),
    ]  # fmt: skip
    return [Finding(f"{f.name} {where}", f.passed, f.sentence) for f in found]


def shown(effect: Effect, model: Model) -> Finding:
    """Tell whether the printed equations show what the effect adds."""
    text = str(model)
    missing = [port for port in effect.adds if f"{effect.name}.{port} = " not in text]
    return finding("printed", missing, "print(model) does not show port {}", "print(model) shows what it adds")


def null_law(effect: Effect, model: Model, manoeuvres: list[Manoeuvre]) -> Finding:
    """Tell whether at null, whatever its other parameters are, the model moves as it does without the effect."""
    bare = model - effect.name
    own = [n in bare.parameters for n in model.parameters]
    population = at_null(model, N_CANDIDATES)
    difference = max(distance(bare, population[:, own], model, population, m) for m in manoeuvres)
    kept = difference <= NULL_TOLERANCE * model.plant.scales.speed
    return Finding("null law", kept, f"at null the signal differs by {difference:.2g} {model.plant.output_unit}")


def acts(effect: Effect, model: Model, manoeuvres: list[Manoeuvre]) -> Finding:
    """Tell whether the effect moves the signal away from its null."""
    still, moving = nominal(model)[np.newaxis], away(model, effect, AWAY)[np.newaxis]
    moved = max(distance(model, still, model, moving, m) for m in manoeuvres)
    text = f"at {AWAY:.0%} of its range it moves the signal by {moved:.2g} {model.plant.output_unit}"
    return Finding("acts", 0.0 < moved < np.inf, text)


def distance(one: Model, x: Array, other: Model, y: Array, manoeuvre: Manoeuvre) -> float:
    """Return the largest difference of two models' signals on the same schedule, infinite where only one diverges."""
    # The weights are those of one model's parameters, and change no result.
    schedule = replace(calibrate(other, manoeuvre, y, spans=False).schedule, weights=None)
    a, b = simulate(one, manoeuvre, x, schedule), simulate(other, manoeuvre, y, schedule)
    if not np.array_equal(a.failed, b.failed):
        return np.inf
    return float(np.max(np.abs(a.output[~a.failed] - b.output[~b.failed]), initial=0.0))


def responds(effect: Effect, model: Model, manoeuvres: list[Manoeuvre]) -> Finding:
    """Tell whether the signal answers in proportion to each small strength: what has no slope at null is not traced."""
    strengths, still = from_null(model, effect, SMALL), nominal(model)[np.newaxis]
    if not strengths.size:
        return Finding("responds", False, "no parameter has a null value")
    answers = np.zeros((len(strengths), 2))
    for m in manoeuvres:
        both = np.concatenate([still, strengths.reshape(-1, still.shape[1])])
        output = simulate(model, m, both, calibrate(model, m, both, spans=False).schedule).output
        moved = np.abs(output[1:] - output[0]).max(axis=1).reshape(len(strengths), 2) / SMALL
        answers = np.where(moved[:, 1:] > answers[:, 1:], moved, answers)
    names = [p.name for p in strengths_of(effect)]
    steady = (answers[:, 1] > 0.0) & (np.abs(answers[:, 0] - answers[:, 1]) <= BENT * answers[:, 1])
    bent = [n for n, kept in zip(names, steady, strict=True) if not kept]
    return finding("responds", bent, "at null the signal does not answer in proportion to {}: nothing would trace it",
                   "at null the signal answers in proportion to each strength")  # fmt: skip


def finite(model: Model, manoeuvres: list[Manoeuvre], more: Array | None = None) -> Finding:
    """Tell whether signal and states stay finite over the box of all parameters, and for more candidates."""
    spread = over_box(model, N_CANDIDATES)
    spread = spread if more is None else np.concatenate([spread, more])
    failed = 0
    for m in manoeuvres:
        run = simulate(model, m, spread, calibrate(model, m, spread, spans=False).schedule, states=True)
        moved = np.array(list(run.states.values()))
        failed += int((run.failed | ~np.isfinite(moved).all(axis=(0, 2))).sum())
    text = f"{failed} of {len(spread) * len(manoeuvres)} candidates over the box diverge"
    return Finding("finite", failed == 0, text)


def deterministic(model: Model, manoeuvre: Manoeuvre) -> Finding:
    """Tell whether the same candidates give the same signal again, bit for bit."""
    first, second = (simulate(model, manoeuvre, over_box(model, 9)).output for _ in range(2))
    same = bool(np.array_equal(first, second, equal_nan=True))
    return Finding("deterministic", same, "the same candidates move the same, bit for bit" if same else
                   "the same candidates move differently when they are simulated again")  # fmt: skip


def on_arrays(effect: Effect, model: Model) -> Finding:
    """Tell whether what the effect adds works on arrays, as tracing and figures use it."""
    wrong = []
    for port, function in effect.adds.items():
        bound = [a for a, _ in model.graph.nodes[f"{effect.name}__{port}"].arguments]
        try:
            with np.errstate(all="ignore"):
                shape = np.shape(function(**dict.fromkeys(bound, np.full(5, 0.3))))
        except (TypeError, ValueError):
            shape = (-1,)
        if shape not in ((5,), ()):
            wrong.append(port)
    return finding("on arrays", wrong, "what it adds at {} does not keep the shape of arrays: np.where chooses there",
                   "the plain functions keep the shape of arrays")  # fmt: skip


def agrees(model: Model, candidate: Array, manoeuvre: Manoeuvre) -> Finding:
    """Tell whether the compiled model agrees with its plain functions under scipy."""
    schedule = calibrate(model, manoeuvre, candidate[np.newaxis], FINE).schedule
    found = simulate(model, manoeuvre, candidate, schedule).output[0]
    try:
        with np.errstate(all="ignore"):
            error = float(np.max(np.abs(found - simulate_plainly(model, manoeuvre, candidate))))
    except ArmidError as refused:
        return Finding("compiled", False, str(refused))
    return Finding("compiled", error <= REFERENCE_TOLERANCE * model.plant.scales.speed,
                   f"the compiled model is within {error:.2g} of its plain functions under scipy")  # fmt: skip


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
