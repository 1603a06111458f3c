"""Manoeuvres on which contracts are tried."""

import numpy as np
from numpy.typing import NDArray

from armid.model import Input, Manoeuvre, Plant

Array = NDArray[np.float64]
N_SAMPLES, INTERVAL = 401, 2e-3
GRAVITY = 0.4


def trial_manoeuvres(plant: Plant) -> list[Manoeuvre]:
    """Return two manoeuvres of a plant: there and back; inputs are a sine and a sawtooth over their typical range."""
    times = INTERVAL * np.arange(N_SAMPLES)
    shapes = (np.sin(9.0 * times), 2.0 * ((1.3 * times) % 1.0) - 1.0)
    return [
        Manoeuvre(INTERVAL, N_SAMPLES, constants_of(plant, turned), inputs_of(plant, shape))
        for turned, shape in enumerate(shapes)
    ]


def inputs_of(plant: Plant, shape: Array) -> dict[str, Array]:
    """Return every input, all moving alike."""
    return {i.name: moved(plant, i, shape) for i in plant.inputs}


def moved(plant: Plant, driven: Input, shape: Array) -> Array:
    """Return an input that moves with a shape from -1 to 1 over its typical range, else over the effort scale."""
    if driven.typical is None:
        return size(plant) * shape
    low, high = driven.typical
    return 0.5 * (low + high) + 0.5 * (high - low) * shape


def size(plant: Plant) -> float:
    """Return a size for inputs: half the effort scale, per unit of gain."""
    gain = next((c.value for c in plant.constants if c.name == "gain"), 1.0)
    return 0.5 * plant.scales.effort / (gain or 1.0)


def constants_of(plant: Plant, turned: int) -> dict[str, float]:
    """Return the constants of a manoeuvre; turned: start and target change places where the plant has both.

    A moment of gravity that is 0 by default becomes part of the effort scale: what acts on it is then seen.
    """
    keys = {k.key: k.constant for k in plant.keys}
    values = {c.name: c.value for c in plant.constants}
    if values.get("gravity_moment") == 0.0:
        return {"gravity_moment": GRAVITY * plant.scales.effort}
    start, target = keys.get("start_angle_deg"), keys.get("target_angle_deg")
    if not turned or start is None or target is None:
        return {}
    return {start: values[target], target: values[start]}
