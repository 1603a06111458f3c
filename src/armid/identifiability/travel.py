"""Keys of a plant that stand for places, and the travel between their ends."""

import inspect

from armid.model import ManoeuvreKey, Plant, State


def key_travel(plant: Plant) -> dict[str, tuple[float, float]]:
    """Return state -> its range, SI, where the state starts at the constant of a key that has a range."""
    found = {}
    for key in plant.keys:
        for state in plant.states:
            if key.low is not None and key.high is not None and starts_at(state, key.constant, key.factor * key.low):
                ends = sorted((key.factor * key.low, key.factor * key.high))
                found[state.name] = (ends[0], ends[1])
    return found


def starts_at(state: State, constant: str, value: float) -> bool:
    """Tell whether a state begins at the value of a constant, tried with one value."""
    return list(inspect.signature(state.initial).parameters) == [constant] and state.initial(value) == value


def is_place(plant: Plant, key: ManoeuvreKey) -> bool:
    """Tell whether a key is a place of the travel: where a state starts, or a target that must be unlike it."""
    if key.boolean or key.low is None or key.high is None:
        return False
    low = key.factor * key.low
    starts = {k.constant for k in plant.keys for s in plant.states if starts_at(s, k.constant, low)}
    return key.constant in starts or key.unlike in starts
