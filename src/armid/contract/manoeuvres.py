"""Manoeuvres on which contracts are tried."""

import numpy as np

from armid.model import Manoeuvre, Plant

N_SAMPLES, INTERVAL = 401, 2e-3


def trial_manoeuvres(plant: Plant) -> list[Manoeuvre]:
    """Return two manoeuvres of a plant: there and back; inputs are a sine and a sawtooth of the effort scale."""
    times = INTERVAL * np.arange(N_SAMPLES)
    shapes = (np.sin(9.0 * times), 2.0 * ((1.3 * times) % 1.0) - 1.0)
    return [
        Manoeuvre(INTERVAL, N_SAMPLES, constants_of(plant, turned), {i.name: size(plant) * shape for i in plant.inputs})
        for turned, shape in enumerate(shapes)
    ]


def size(plant: Plant) -> float:
    """Return a size for inputs: half the effort scale, per unit of gain."""
    gain = next((c.value for c in plant.constants if c.name == "gain"), 1.0)
    return 0.5 * plant.scales.effort / (gain or 1.0)


def constants_of(plant: Plant, turned: int) -> dict[str, float]:
    """Return the constants of a manoeuvre; turned: start and target change places where the plant has both."""
    keys = {k.key: k.constant for k in plant.keys}
    values = {c.name: c.value for c in plant.constants}
    start, target = keys.get("start_angle_deg"), keys.get("target_angle_deg")
    if not turned or start is None or target is None:
        return {}
    return {start: values[target], target: values[start]}
