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
    values: dict[str, Any] = dict(zip(map(flat, model.parameters), map(float, candidate), strict=True))
    values |= dict(zip(model.constants, model.constant_values(manoeuvre.constants), strict=True))
    values |= {i.name: np.asarray(manoeuvre.inputs[i.name], dtype=float) for i in model.plant.inputs}
    values |= {flat(name): state[0] for name, state in run.states.items()} | {"time": times}
    values |= {flat(name): np.where(times >= when[0], 1.0, 0.0) for name, when in run.switch_times.items()}
    keys = {name: flat(model.plant.aliases.get(name, name)) for name in names}
    for name, key in keys.items():
        if key not in model.graph.nodes:
            raise ArmidError(f"'{name}' is no name of plant '{model.plant.name}': {nearest(name, model.graph.nodes)}")
    for node in model.graph.order(keys.values()):
        if node.kind == "port":
            values[node.key] = sum((values[t] for t in node.terms), np.zeros(1))
        else:
            assert node.function is not None
            values[node.key] = node.function(**{a: values[k] for a, k in node.arguments})
    return {
        name: np.broadcast_to(np.asarray(values[key], dtype=float), times.shape).copy() for name, key in keys.items()
    }


def flat(name: str) -> str:
    """Return the key of a qualified name."""
    return name.replace(".", "__")
