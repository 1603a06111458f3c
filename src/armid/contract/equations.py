"""The contracts of plants and of effects."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armid.contract.trials import (
    ContractPoint,
    at_null,
    away,
    check_parameters,
    corners,
    finding,
    from_null,
    nominal,
    over_box,
    simulate_plainly,
    strengths_of,
    trial_manoeuvres,
)
from armid.engine import FINE, calibrate, simulate
from armid.errors import ArmidError
from armid.model import PLANTS, Effect, Manoeuvre, Model, Plant
from armid.model.effect import Equation

Array = NDArray[np.float64]
UNITS = ("rad/s", "m/s")
# Shares of the plant's speed scale: at null, and against scipy.
NULL_TOLERANCE, REFERENCE_TOLERANCE = 1e-12, 1e-5
N_CANDIDATES, AWAY = 16, 0.3
# Shares of the range at which the response to a strength is compared, and by how much it may bend between them.
SMALL, BENT = np.array([1e-4, 2e-4]), 0.05


def check_plant(plant: Plant) -> list[ContractPoint]:
    """Try a plant and its siblings on trial manoeuvres."""
    found = []
    for p in (plant, *plant.variants):
        try:
            model = Model(p)
            simulate(model, trial_manoeuvres(p)[0].shortened(2), nominal(model))
        except ArmidError as error:
            here = [ContractPoint("binds", False, str(error))]
        else:
            here = [*plant_declared(model), *plant_moves(model)]
        found += [replace(f, name=f"{f.name}, {p.name} in {p.output_unit}") for f in here]
    return found


def plant_declared(model: Model) -> list[ContractPoint]:
    """Check what can be told of a plant without moving; idle are switches that nobody asks for, and static guards."""
    plant, graph = model.plant, model.graph
    ports = ", ".join(plant.ports) or "none"
    asked = {key for node in graph.nodes.values() for key in node.needs}
    idle = [g.name for g in plant.guards if graph.is_static(f"guard__{g.name}") or (g.latch and g.name not in asked)]
    return [
        ContractPoint("binds", True, f"{len(model.parameters)} parameters, {len(model.states)} states; ports: {ports}"),
        *check_parameters(plant.parameters),
        ContractPoint("unit", plant.output_unit in UNITS,
                      f"records {plant.output_unit}, {' or '.join(UNITS)} is expected"),
        ContractPoint("printed", plant.output in str(model), "print(model) shows its equations"),
        finding("guards", idle, "nothing depends on guard {}, or it never moves",
                f"all of {len(plant.guards)} guards are used"),
    ]  # fmt: skip


def plant_moves(model: Model) -> list[ContractPoint]:
    manoeuvres, x = trial_manoeuvres(model.plant), nominal(model)
    moved = [float(np.ptp(simulate(model, m, x).output)) for m in manoeuvres]
    size = f"the signal runs over {', '.join(f'{v:.2g}' for v in moved)} {model.plant.output_unit}"
    return [
        ContractPoint("moves", 0.0 not in moved, size), finite(model, manoeuvres, over_box(model, N_CANDIDATES)),
        deterministic(model, manoeuvres[0], over_box(model, 9)),
        *(replace(agrees(model, model, x, m), name=f"compiled (manoeuvre {i + 1})") for i, m in enumerate(manoeuvres)),
    ]  # fmt: skip


def check_effect(effect: Effect, plants: Mapping[str, Plant] = PLANTS, strict: bool = False) -> list[ContractPoint]:
    """Try an effect, in each of its forms, on every plant that offers its ports and names.

    strict: a function without a docstring fails; otherwise that is only said.
    """
    return check_effects([effect], plants, strict)[0]


def check_effects(
    effects: Sequence[Effect], plants: Mapping[str, Plant] = PLANTS, strict: bool = False
) -> list[list[ContractPoint]]:
    """Try several effects as `check_effect` does each, with as little to compile as possible.

    All effects that a plant takes stand in one model, which is compiled once; all but the one that is tried are at
    their nulls, where they add exactly nothing. Further forms of effects share a model in the same way.
    """
    found: list[list[ContractPoint]] = [[] for _ in effects]
    for k in range(max((len(effect.every_form) for effect in effects), default=0)):
        places = [i for i, effect in enumerate(effects) if k < len(effect.every_form)]
        forms = [effects[i].every_form[k] for i in places]
        for i, form, here in zip(places, forms, check_forms(forms, plants, strict), strict=True):
            found[i] += [replace(f, name=f"{f.name} in the form {form.form}") if form.form else f for f in here]
    return found


def check_forms(forms: Sequence[Effect], plants: Mapping[str, Plant], strict: bool) -> list[list[ContractPoint]]:
    """Try effects, each in the form that it has, on every plant and its siblings."""
    moved: list[list[ContractPoint]] = [[] for _ in forms]
    fitting: list[list[str]] = [[] for _ in forms]
    refusals: list[list[str]] = [[] for _ in forms]
    for plant in (p for given in plants.values() for p in (given, *given.variants)):
        models: dict[int, Model] = {}
        for i, form in enumerate(forms):
            try:
                models[i] = Model(plant) + form
                fitting[i].append(plant.name)
            except ArmidError as error:
                refusals[i].append(f"{plant.name}: {error}")
        joint = joint_model(plant, [forms[i] for i in models])
        for i, model in models.items():
            moved[i] += check_on(forms[i], model, joint or model)
    return [
        [binding(*names), *check_parameters(form.parameters), has_null(form), documented(form, strict), *on_plants]
        for form, names, on_plants in zip(forms, zip(fitting, refusals, strict=True), moved, strict=True)
    ]


def joint_model(plant: Plant, effects: Sequence[Effect]) -> Model | None:
    """Return one compiled model of a plant with several effects, None where they are one or do not compile together."""
    if len(effects) < 2:
        return None
    try:
        model = Model(plant, tuple(effects))
        simulate(model, trial_manoeuvres(plant)[0].shortened(2), nominal(model))
    except ArmidError:
        return None
    return model


def check_on(effect: Effect, alone: Model, model: Model) -> list[ContractPoint]:
    """Try an effect on one plant; alone: the plant with the effect; model: the same or one with other effects."""
    where = f"on {alone.plant.name} in {alone.plant.output_unit}"
    manoeuvres = trial_manoeuvres(alone.plant)
    try:
        simulate(model, manoeuvres[0].shortened(2), nominal(model))
    except ArmidError as error:
        return [ContractPoint(f"compiles {where}", False, str(error))]
    spread = np.concatenate([within(model, alone, over_box(alone, N_CANDIDATES)), corners(model, effect)])
    found = [
        printed(effect, alone), null_law(alone, model, manoeuvres), acts(effect, model, manoeuvres),
        responds(effect, model, manoeuvres), finite(model, manoeuvres, spread),
        deterministic(model, manoeuvres[0], within(model, alone, over_box(alone, 9))), on_arrays(effect, alone),
        agrees(model, alone, away(alone, effect, AWAY), manoeuvres[0]),
    ]  # fmt: skip
    return [replace(f, name=f"{f.name} {where}") for f in found]


def within(model: Model, part: Model, candidates: Array) -> Array:
    """Return candidates of a part of a model as candidates of the model, all else nominal, (n, n_parameters)."""
    whole = np.tile(nominal(model), (len(candidates), 1))
    places = list(model.parameters)
    whole[:, [places.index(name) for name in part.parameters]] = candidates
    return whole


def printed(effect: Effect, model: Model) -> ContractPoint:
    """Tell whether the printed equations show what the effect adds."""
    text = str(model)
    missing = [port for port in effect.adds if f"{effect.name}.{port} = " not in text]
    return finding("printed", missing, "print(model) does not show port {}", "print(model) shows what it adds")


def null_law(alone: Model, model: Model, manoeuvres: list[Manoeuvre]) -> ContractPoint:
    """Tell whether at null, whatever its other parameters are, the model moves as it does without the effect."""
    bare = Model(model.plant)
    population = at_null(alone, N_CANDIDATES)
    own = [n in bare.parameters for n in alone.parameters]
    full = within(model, alone, population)
    difference = max(distance(bare, population[:, own], model, full, m) for m in manoeuvres)
    kept = difference <= NULL_TOLERANCE * model.plant.scales.speed
    return ContractPoint("null law", kept, f"at null the signal differs by {difference:.2g} {model.plant.output_unit}")


def acts(effect: Effect, model: Model, manoeuvres: list[Manoeuvre]) -> ContractPoint:
    """Tell whether the effect moves the signal away from its null."""
    still, moving = nominal(model)[np.newaxis], away(model, effect, AWAY)[np.newaxis]
    moved = max(distance(model, still, model, moving, m) for m in manoeuvres)
    text = f"at {AWAY:.0%} of its range it moves the signal by {moved:.2g} {model.plant.output_unit}"
    return ContractPoint("acts", 0.0 < moved < np.inf, text)


def distance(one: Model, x: Array, other: Model, y: Array, manoeuvre: Manoeuvre) -> float:
    """Return the largest difference of two models' signals on the same schedule, infinite where only one diverges."""
    # The weights are those of one model's parameters, and change no result.
    schedule = replace(calibrate(other, manoeuvre, y, spans=False).schedule, weights=None)
    a, b = simulate(one, manoeuvre, x, schedule), simulate(other, manoeuvre, y, schedule)
    if not np.array_equal(a.failed, b.failed):
        return np.inf
    return float(np.max(np.abs(a.output[~a.failed] - b.output[~b.failed]), initial=0.0))


def responds(effect: Effect, model: Model, manoeuvres: list[Manoeuvre]) -> ContractPoint:
    """Tell whether the signal answers in proportion to each small strength, without which nothing finds the effect."""
    strengths, still = from_null(model, effect, SMALL), nominal(model)[np.newaxis]
    if not strengths.size:
        return ContractPoint("responds", False, "no parameter has a null value")
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


def finite(model: Model, manoeuvres: list[Manoeuvre], spread: Array) -> ContractPoint:
    """Tell whether signal and states of candidates stay finite."""
    failed = 0
    for m in manoeuvres:
        run = simulate(model, m, spread, calibrate(model, m, spread, spans=False).schedule, states=True)
        moved = np.array(list(run.states.values()))
        failed += int((run.failed | ~np.isfinite(moved).all(axis=(0, 2))).sum())
    text = f"{failed} of {len(spread) * len(manoeuvres)} candidates over the box diverge"
    return ContractPoint("finite", failed == 0, text)


def deterministic(model: Model, manoeuvre: Manoeuvre, candidates: Array) -> ContractPoint:
    """Tell whether the same candidates give the same signal again, bit for bit."""
    first, second = (simulate(model, manoeuvre, candidates).output for _ in range(2))
    same = bool(np.array_equal(first, second, equal_nan=True))
    return ContractPoint("deterministic", same, "the same candidates move the same, bit for bit" if same else
                   "the same candidates move differently when they are simulated again")  # fmt: skip


def on_arrays(effect: Effect, model: Model) -> ContractPoint:
    """Tell whether what the effect adds works on arrays, as the loop and figures use it."""
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


def agrees(model: Model, alone: Model, candidate: Array, manoeuvre: Manoeuvre) -> ContractPoint:
    """Tell whether the compiled model agrees with plain functions under scipy; alone, candidate: what they simulate."""
    compiled = within(model, alone, candidate[np.newaxis])
    found = simulate(model, manoeuvre, compiled, calibrate(model, manoeuvre, compiled, FINE).schedule).output[0]
    try:
        with np.errstate(all="ignore"):
            error = float(np.max(np.abs(found - simulate_plainly(alone, manoeuvre, candidate))))
    except ArmidError as refused:
        return ContractPoint("compiled", False, str(refused))
    return ContractPoint("compiled", error <= REFERENCE_TOLERANCE * model.plant.scales.speed,
                   f"the compiled model is within {error:.2g} of its plain functions under scipy")  # fmt: skip


def binding(fitting: list[str], refusals: list[str]) -> ContractPoint:
    """Tell which plants take an effect; else why none does, and how a plant of one's own comes to be tried."""
    text = f"fits {', '.join(fitting)}" if fitting else (
        f"fits no plant ({'; '.join(refusals)}); --plugin FILE.py:attribute has it tried on your own")  # fmt: skip
    return ContractPoint("binds", bool(fitting), text)


def has_null(effect: Effect) -> ContractPoint:
    """Tell whether there is a value at which the effect vanishes."""
    names = [p.name for p in effect.parameters if p.null is not None]
    text = f"vanishes where {', '.join(names)} is null" if names else "no parameter has a null value"
    return ContractPoint("null values", bool(names), text)


def documented(effect: Effect, strict: bool) -> ContractPoint:
    silent = [name for name, f in functions_of(effect) if not (f.__doc__ or "").strip()]
    found = finding("documented", silent, "no docstring: {}", "every function has a docstring")
    return ContractPoint(found.name, found.passed or not strict, found.sentence)


def functions_of(effect: Effect) -> Iterator[tuple[str, Equation]]:
    yield from ((f"{effect.name}__{port}", f) for port, f in effect.adds.items())
    for state in effect.states:
        yield f"rate__{effect.name}__{state.name}", state.rate
        yield f"initial__{effect.name}__{state.name}", state.initial
    yield from ((f"guard__{effect.name}__{guard.name}", guard.function) for guard in effect.guards)
