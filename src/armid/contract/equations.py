"""The contracts of plants and of effects."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

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
from armid.engine import FINE, along, calibrate, simulate
from armid.engine.calibrate import difference
from armid.errors import ArmidError
from armid.model import PLANTS, Array, Effect, Manoeuvre, Model, Plant, is_late_as_a_whole, refusal_of
from armid.model.effect import Equation

# Shares of the size of an output: at null, and against scipy.
NULL_TOLERANCE, REFERENCE_TOLERANCE = 1e-12, 1e-5
N_CANDIDATES, AWAY = 16, 0.3
# Shares of the range at which the response to a strength is compared, and by how much it may bend between them. The
# share up to which an effect may do nothing, such as a limit: a search tries it, too.
SMALL, BENT, THRESHOLD = np.array([1e-4, 2e-4]), 0.05, 0.4


def check_plant(plant: Plant) -> Iterator[ContractPoint]:
    """Try a plant and its siblings on trial manoeuvres, and yield each point when it is done."""
    for p in (plant, *plant.variants):
        try:
            model = Model(p)
            simulate(model, trial_manoeuvres(p)[0].shortened(2), nominal(model))
        except ArmidError as error:
            here: Iterable[ContractPoint] = [ContractPoint("binds", False, str(error))]
        else:
            here = plant_points(model)
        yield from (replace(f, name=f"{f.name}, {p.name} in {units_of(p)}") for f in here)


def plant_points(model: Model) -> Iterator[ContractPoint]:
    plant, graph = model.plant, model.graph
    ports = ", ".join(plant.ports) or "none"
    asked = {key for node in graph.nodes.values() for key in node.needs}
    idle = [g.name for g in plant.guards if graph.is_static(f"guard__{g.name}") or (g.latch and g.name not in asked)]
    text = f"{len(model.parameters)} parameters, {len(model.states)} states; records {units_of(plant)}; ports: {ports}"
    yield ContractPoint("binds", True, text)
    yield from check_parameters(plant.parameters)
    is_printed = all(o.signal in str(model) for o in plant.outputs)
    yield ContractPoint("printed", is_printed, "print(model) shows its equations")
    if is_late_as_a_whole(plant):
        text = ("a part of drive_effort follows the motion: a late voltage acts as a late drive and another "
                "inertia; name what drives the motor `voltage` and add a port `winding` [V] to it")  # fmt: skip
        yield ContractPoint("late drive", True, text)
    used = f"all of {len(plant.guards)} guards are used"
    yield finding("guards", idle, "nothing depends on guard {}, or it never moves", used)
    manoeuvres, x = trial_manoeuvres(plant), nominal(model)
    moved = [float(np.ptp(y)) for m in manoeuvres for y in simulate(model, m, x).outputs]
    size = f"the signal runs over {', '.join(f'{v:.2g}' for v in moved)} {units_of(plant)}"
    yield ContractPoint("moves", 0.0 not in moved, size)
    yield finite(model, manoeuvres, over_box(model, N_CANDIDATES))
    yield deterministic(model, manoeuvres[0], over_box(model, 9))
    for i, m in enumerate(manoeuvres):
        yield replace(agrees(model, model, x, m), name=f"compiled (manoeuvre {i + 1})")


def check_effect(effect: Effect, plants: Mapping[str, Plant] = PLANTS) -> Iterator[ContractPoint]:
    """Try an effect, in each of its forms, on every plant that offers its ports; yield each point when it is done."""
    yield from (point for _, point in check_effects([effect], plants))


def check_effects(
    effects: Sequence[Effect], plants: Mapping[str, Plant] = PLANTS
) -> Iterator[tuple[str, ContractPoint]]:
    """Try several effects as `check_effect` does each, with as little to compile as possible; yield name and point.

    All effects that a plant takes stand in one model, which is compiled once; all but the one that is tried are at
    their nulls, where they add exactly nothing. Further forms of effects share a model in the same way.
    """
    taken = {e.name for e in effects if any(not refusal_of(f, p) for f in e.every_form for p in siblings(plants))}
    for k in range(max((len(effect.every_form) for effect in effects), default=0)):
        forms = {effect.name: effect.every_form[k] for effect in effects if k < len(effect.every_form)}
        fits: dict[str, list[Model]] = {}
        for name, form in forms.items():
            fits[name], refusals = composed(form, plants)
            yield from ((name, of_form(p, form)) for p in declared(form, fits[name], refusals, name in taken))
        for plant in siblings(plants):
            models = {name: model for name, several in fits.items() for model in several if model.plant is plant}
            joint = joint_model(plant, [forms[name] for name in models])
            for name, model in models.items():
                yield from ((name, of_form(p, forms[name])) for p in check_on(forms[name], model, joint or model))


def of_form(point: ContractPoint, form: Effect) -> ContractPoint:
    return replace(point, name=f"{point.name} in the form {form.form}") if form.form else point


def siblings(plants: Mapping[str, Plant]) -> list[Plant]:
    return [p for given in plants.values() for p in (given, *given.variants)]


def composed(form: Effect, plants: Mapping[str, Plant]) -> tuple[list[Model], list[str]]:
    models, refusals = [], []
    for plant in siblings(plants):
        try:
            models.append(Model(plant) + form)
        except ArmidError as error:
            refusals.append(f"{plant.name}: {error}")
    return models, refusals


def declared(form: Effect, models: Sequence[Model], refusals: list[str], is_taken: bool) -> list[ContractPoint]:
    """Tell which plants take a form of an effect, else why none does; and what its declaration says.

    A function without a docstring is named, and no fault. is_taken: whether a plant takes any form of it.
    """
    fits = f"fits {', '.join(m.plant.name for m in models)}" if models else (
        f"fits no plant ({'; '.join(refusals)}); --plugin FILE.py:attribute has it tried on your own")  # fmt: skip
    nulls = [p.name for p in form.parameters if p.null is not None]
    vanishes = f"vanishes where {', '.join(nulls)} is null" if nulls else "no parameter has a null value"
    silent = [name for name, f in functions_of(form) if not (f.__doc__ or "").strip()]
    documented = f"no docstring: {', '.join(silent)}" if silent else "every function has a docstring"
    return [
        ContractPoint("binds", is_taken, fits),
        *check_parameters(form.parameters),
        ContractPoint("null values", bool(nulls), vanishes),
        ContractPoint("documented", True, documented),
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


def check_on(effect: Effect, alone: Model, model: Model) -> Iterator[ContractPoint]:
    """Try an effect on one plant; alone: the plant with the effect; model: the same or one with other effects."""
    where = f"on {alone.plant.name} in {units_of(alone.plant)}"
    manoeuvres = trial_manoeuvres(alone.plant)
    try:
        simulate(model, manoeuvres[0].shortened(2), nominal(model))
    except ArmidError as error:
        yield ContractPoint(f"compiles {where}", False, str(error))
        return
    yield from (replace(p, name=f"{p.name} {where}") for p in effect_points(effect, alone, model, manoeuvres))


def effect_points(effect: Effect, alone: Model, model: Model, manoeuvres: list[Manoeuvre]) -> Iterator[ContractPoint]:
    yield printed(effect, alone)
    yield null_law(alone, model, manoeuvres)
    yield acts(effect, model, manoeuvres)
    yield responds(effect, model, manoeuvres)
    spread = within(model, alone, over_box(alone, N_CANDIDATES))
    yield finite(model, manoeuvres, np.concatenate([spread, corners(model, effect)]))
    yield deterministic(model, manoeuvres[0], within(model, alone, over_box(alone, 9)))
    yield on_arrays(effect, alone)
    yield agrees(model, alone, away(alone, effect, AWAY), manoeuvres[0])


def within(model: Model, part: Model, candidates: Array) -> Array:
    """Return candidates of a part of a model as candidates of the model, all else nominal."""
    whole = np.tile(nominal(model), (len(candidates), 1))
    places = list(model.parameters)
    whole[:, [places.index(name) for name in part.parameters]] = candidates
    return whole


def printed(effect: Effect, model: Model) -> ContractPoint:
    text = str(model)
    missing = [port for port in effect.adds if f"{effect.name}.{port} = " not in text]
    return finding("printed", missing, "print(model) does not show port {}", "print(model) shows what it adds")


def null_law(alone: Model, model: Model, manoeuvres: list[Manoeuvre]) -> ContractPoint:
    """Tell whether at null, whatever its other parameters are, the model moves as it does without the effect.

    Where all that it adds is exactly 0 along the motion, that motion is the plant's own; else the two are compared.
    """
    population = at_null(alone, N_CANDIDATES)
    if adds_nothing(alone, model, population, manoeuvres):
        return ContractPoint("null law", True, "at null it adds exactly 0 all along the motion")
    bare = Model(model.plant)
    own = [n in bare.parameters for n in alone.parameters]
    full = within(model, alone, population)
    apart = max(distance(bare, population[:, own], model, full, m) for m in manoeuvres)
    kept = apart <= NULL_TOLERANCE * model.plant.sizes[0]
    return ContractPoint("null law", kept, f"at null the signal differs by {apart:.2g} {model.plant.output_unit}")


def adds_nothing(alone: Model, model: Model, population: Array, manoeuvres: list[Manoeuvre]) -> bool:
    """Tell whether all that the last effect of a model adds is exactly 0 along the motions of a population."""
    effect = alone.effects[-1]
    terms = [f"{effect.name}.{port}" for port in effect.adds]
    for m in manoeuvres:
        schedule = calibrate(model, m, within(model, alone, population), spans=False).schedule
        for candidate in within(model, alone, population):
            with np.errstate(all="ignore"):
                try:
                    values = along(model, m, candidate, schedule, terms).values()
                except (TypeError, ValueError):  # statements that arrays cannot take: the compiled models are compared
                    return False
            if not all(np.array_equal(value, np.zeros_like(value)) for value in values):
                return False
    return True


def acts(effect: Effect, model: Model, manoeuvres: list[Manoeuvre]) -> ContractPoint:
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
    return difference(a, b, one)


def responds(effect: Effect, model: Model, manoeuvres: list[Manoeuvre]) -> ContractPoint:
    """Tell whether the signal answers in proportion to each small strength, or not at all below a threshold.

    Without that nothing finds the effect.
    """
    shares = np.append(SMALL, THRESHOLD)
    strengths, still = from_null(model, effect, shares), nominal(model)[np.newaxis]
    if not strengths.size:
        return ContractPoint("responds", False, "no parameter has a null value")
    answers = np.zeros((len(strengths), len(shares)))
    for m in manoeuvres:
        both = np.concatenate([still, strengths.reshape(-1, still.shape[1])])
        run = simulate(model, m, both, calibrate(model, m, both, spans=False).schedule)
        output = run.joint(model.plant.sizes)
        moved = np.abs(output[1:] - output[0]).max(axis=1).reshape(answers.shape) / shares
        tells_more = (moved[:, 1] > answers[:, 1]) | ((moved[:, 1] == answers[:, 1]) & (moved[:, 2] > answers[:, 2]))
        answers = np.where(tells_more[:, np.newaxis], moved, answers)
    names = [p.name for p in strengths_of(effect)]
    first, second, far = answers.T
    in_proportion = (second > 0.0) & (np.abs(first - second) <= BENT * second)
    steady = in_proportion | ((second == 0.0) & (far > 0.0))
    bent = [n for n, kept in zip(names, steady, strict=True) if not kept]
    return finding("responds", bent, "at null the signal does not answer in proportion to {}: nothing would trace it",
                   "at null the signal answers in proportion to each strength")  # fmt: skip


def finite(model: Model, manoeuvres: list[Manoeuvre], spread: Array) -> ContractPoint:
    failed = 0
    for m in manoeuvres:
        run = simulate(model, m, spread, calibrate(model, m, spread, spans=False).schedule, states=True)
        moved = np.array(list(run.states.values()))
        failed += int((run.failed | ~np.isfinite(moved).all(axis=(0, 2))).sum())
    text = f"{failed} of {len(spread) * len(manoeuvres)} candidates over the box diverge"
    return ContractPoint("finite", failed == 0, text)


def deterministic(model: Model, manoeuvre: Manoeuvre, candidates: Array) -> ContractPoint:
    runs = [np.moveaxis(simulate(model, manoeuvre, candidates).outputs, 1, 0) for _ in range(2)]
    differ = np.flatnonzero([not np.array_equal(a, b, equal_nan=True) for a, b in zip(*runs, strict=True)])
    text = f"candidate {differ[0] + 1} moves differently when it is simulated again" if differ.size else (
        "the same candidates move the same, bit for bit")  # fmt: skip
    return ContractPoint("deterministic", not differ.size, text)


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
    run = simulate(model, manoeuvre, compiled, calibrate(model, manoeuvre, compiled, FINE).schedule)
    try:
        with np.errstate(all="ignore"):
            missed = np.abs(run.outputs[:, 0] - simulate_plainly(alone, manoeuvre, candidate)).max(axis=1)
    except ArmidError as refused:
        return ContractPoint("compiled", False, str(refused))
    error = float(np.max(missed / model.plant.sizes)) * model.plant.sizes[0]
    return ContractPoint("compiled", error <= REFERENCE_TOLERANCE * model.plant.sizes[0],
                   f"the compiled model is within {error:.2g} of its plain functions under scipy")  # fmt: skip


def units_of(plant: Plant) -> str:
    return ", ".join(o.unit for o in plant.outputs)


def functions_of(effect: Effect) -> Iterator[tuple[str, Equation]]:
    yield from ((f"{effect.name}__{port}", f) for port, f in effect.adds.items())
    for state in effect.states:
        yield f"rate__{effect.name}__{state.name}", state.rate
        yield f"initial__{effect.name}__{state.name}", state.initial
    yield from ((f"{effect.name}__{delay.name}", delay.of) for delay in effect.delays)
    yield from ((f"guard__{effect.name}__{guard.name}", guard.function) for guard in effect.guards)
