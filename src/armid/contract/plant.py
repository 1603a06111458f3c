"""The contract of a plant."""

from dataclasses import replace

import numpy as np

from armid.contract.effect import agrees, deterministic, finite
from armid.contract.trials import Finding, check_parameters, finding, nominal, trial_manoeuvres
from armid.engine import simulate
from armid.errors import ArmidError
from armid.model import Model, Plant

UNITS = ("rad/s", "m/s")


def check_plant(plant: Plant) -> list[Finding]:
    """Try a plant and its siblings on trial manoeuvres."""
    return [f for p in (plant, *plant.variants) for f in check_one(p)]


def check_one(plant: Plant) -> list[Finding]:
    """Try one plant."""
    try:
        model = Model(plant)
        simulate(model, trial_manoeuvres(plant)[0].shortened(2), nominal(model))
    except ArmidError as error:
        found = [Finding("binds", False, str(error))]
    else:
        found = [*declared(model), *moving(model)]
    where = f"{plant.name} in {plant.output_unit}"
    return [Finding(f"{f.name}, {where}", f.passed, f.sentence) for f in found]


def declared(model: Model) -> list[Finding]:
    """Check what can be told without moving."""
    plant = model.plant
    ports = ", ".join(plant.ports) or "none"
    return [
        Finding("binds", True, f"{len(model.parameters)} parameters, {len(model.states)} states; ports: {ports}"),
        *check_parameters(plant.parameters),
        Finding("unit", plant.output_unit in UNITS, f"records {plant.output_unit}, {' or '.join(UNITS)} is expected"),
        Finding("printed", plant.output in str(model), "print(model) shows its equations"),
        finding("guards", idle_guards(model), "nothing depends on guard {}, or it never moves",
                f"all of {len(plant.guards)} guards are used"),
    ]  # fmt: skip


def idle_guards(model: Model) -> list[str]:
    """Return switches that no equation asks for, and guards that cannot change."""
    graph = model.graph
    asked = {key for node in graph.nodes.values() for key in node.needs}
    return [
        g.name for g in model.plant.guards if graph.is_static(f"guard__{g.name}") or (g.latch and g.name not in asked)
    ]


def moving(model: Model) -> list[Finding]:
    """Check how the plant moves."""
    manoeuvres, x = trial_manoeuvres(model.plant), nominal(model)
    moved = [float(np.ptp(simulate(model, m, x).output)) for m in manoeuvres]
    size = f"the signal runs over {', '.join(f'{v:.2g}' for v in moved)} {model.plant.output_unit}"
    return [
        Finding("moves", 0.0 not in moved, size), finite(model, manoeuvres),
        deterministic(model, manoeuvres[0]),
        *(replace(agrees(model, x, m), name=f"compiled (manoeuvre {i + 1})") for i, m in enumerate(manoeuvres)),
    ]  # fmt: skip
