"""What the quantities of a model do along a simulated motion: the very equations that were simulated, on arrays."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.model import ArmidError, Manoeuvre, Model, nearest
from armid.simulation.simulate import Schedule, simulate

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
    known = leaves(model, manoeuvre, candidate, manoeuvre.times())
    known |= {flat(name): values[0] for name, values in run.states.items()}
    known |= {flat(name): np.where(known["time"] >= when[0], 1.0, 0.0) for name, when in run.switch_times.items()}
    return evaluated(model, known, names)


def evaluated(model: Model, known: Mapping[str, Any], names: Sequence[str]) -> dict[str, Array]:
    """Return names from what is known by key: parameters, constants, inputs, states, latches and `time` on a grid.

    Raises ArmidError for a name that the model does not have.
    """
    values = dict(known)
    keys = {name: key_of(model, name) for name in names}
    for node in model.graph.order(keys.values()):
        if node.kind == "port":
            values[node.key] = sum((values[t] for t in node.terms), np.zeros(1))
        elif node.key not in values:
            assert node.function is not None
            values[node.key] = node.function(**{a: values[k] for a, k in node.arguments})
    shape = np.shape(values["time"])
    return {name: np.broadcast_to(np.asarray(values[key], dtype=float), shape).copy() for name, key in keys.items()}


def leaves(model: Model, manoeuvre: Manoeuvre, candidate: Array, times: Array) -> dict[str, Any]:
    """Return what is known without a simulation at some times, by key; inputs run straight between samples."""
    known: dict[str, Any] = dict(zip(map(flat, model.parameters), map(float, candidate), strict=True))
    known |= dict(zip(model.constants, model.constant_values(manoeuvre.constants), strict=True))
    grid = manoeuvre.times()
    known |= {i.name: np.interp(times, grid, manoeuvre.inputs[i.name]) for i in model.plant.inputs}
    return known | {"time": times}


def flat(name: str) -> str:
    """Return the key of a qualified name."""
    return name.replace(".", "__")


def key_of(model: Model, name: str) -> str:
    """Return the key of a name, aliases resolved; refuse an unknown one with ArmidError."""
    key = flat(model.plant.aliases.get(name, name))
    if key not in model.graph.nodes:
        raise ArmidError(f"'{name}' is no name of plant '{model.plant.name}': {nearest(name, model.graph.nodes)}")
    return key
