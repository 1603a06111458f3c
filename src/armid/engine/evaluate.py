"""What the quantities of a model do along a simulated motion: the very equations that were simulated, on arrays."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.engine.simulate import Schedule, simulate
from armid.errors import ArmidError, nearest
from armid.model import Manoeuvre, Model

Array = NDArray[np.float64]


def along(
    model: Model, manoeuvre: Manoeuvre, candidate: Array, schedule: Schedule, names: Sequence[str]
) -> dict[str, Array]:
    """Return states, inputs, quantities, ports or `time` of one candidate on the samples, name -> (n_samples,), SI.

    candidate: whole, SI, (n_parameters,). names: as equations spell them; an effect's own are qualified
    (`shell_rocking.twist`), aliases are understood.
    Raises ArmidError for a name that the model does not have.
    """
    run = simulate(model, manoeuvre, candidate[np.newaxis], schedule, states=True)
    times = manoeuvre.times()
    values = leaves(model, manoeuvre, candidate) | {"time": times}
    values |= {flat(name): state[0] for name, state in run.states.items()}
    values |= {flat(name): np.where(times >= when[0], 1.0, 0.0) for name, when in run.switch_times.items()}
    keys = {name: key_of(model, name) for name in names}
    for node in model.graph.order(keys.values()):
        if node.kind == "port":
            values[node.key] = sum((values[t] for t in node.terms), np.zeros(1))
        else:
            assert node.function is not None
            values[node.key] = node.function(**{a: values[k] for a, k in node.arguments})
    found = {name: np.asarray(values[key], dtype=float) for name, key in keys.items()}
    return {name: np.broadcast_to(value, times.shape).copy() for name, value in found.items()}


def leaves(model: Model, manoeuvre: Manoeuvre, candidate: Array) -> dict[str, Any]:
    """Return parameters, constants and inputs, by key."""
    known: dict[str, Any] = dict(zip(map(flat, model.parameters), map(float, candidate), strict=True))
    known |= dict(zip(model.constants, model.constant_values(manoeuvre.constants), strict=True))
    return known | {i.name: np.asarray(manoeuvre.inputs[i.name], dtype=float) for i in model.plant.inputs}


def flat(name: str) -> str:
    """Return the key of a qualified name."""
    return name.replace(".", "__")


def key_of(model: Model, name: str) -> str:
    """Return the key of a name, aliases resolved; refuse an unknown one with ArmidError."""
    key = flat(model.plant.aliases.get(name, name))
    if key not in model.graph.nodes:
        raise ArmidError(f"'{name}' is no name of plant '{model.plant.name}': {nearest(name, model.graph.nodes)}")
    return key
