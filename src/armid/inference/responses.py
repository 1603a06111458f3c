"""How the whitened signal answers to candidates about a fit."""

from collections.abc import Mapping, Sequence

import numpy as np

from armid.inference.library import Activation, EffectKey, idle
from armid.inference.model import Fit
from armid.inference.whitening import WhiteRecords
from armid.model import Array


def responses(
    current: Fit, records: WhiteRecords, grid: Sequence[Activation], without: EffectKey | None = None
) -> Array:
    """Return the change of the whitened signal per full strength of each activation, (n_activations, n_samples).

    without: an effect of the fit that is put to its null before.
    """
    rest = candidate_at(records, current.values)
    population = np.tile(rest if without is None else at_null(records, rest, without), (len(grid) + 1, 1))
    for row, activation in zip(population[1:], grid, strict=True):
        for n, value in activation.at(activation.share).items():
            row[records.space.index(n)] = value
    signals = records.whole_signals(population)
    return np.asarray((signals[1:] - signals[0]) / np.array([a.share for a in grid])[:, np.newaxis])


def free_values(records: WhiteRecords, values: Mapping[str, float]) -> Array:
    """Return the free parameters of a problem, SI: given values, the others where they rest, (n_free,)."""
    declared = records.model.parameters
    return np.array([values.get(n, idle(declared[n])) for n in records.space.free_names])


def candidate_at(records: WhiteRecords, values: Mapping[str, float]) -> Array:
    """Return the whole candidate of a problem at some values, as `free_values` takes them, SI, (n_parameters,)."""
    return np.asarray(records.space.complete(free_values(records, values)[np.newaxis])[0])


def at_null(records: WhiteRecords, candidate: Array, key: EffectKey) -> Array:
    model, changed = records.model, candidate.copy()
    for i, name in enumerate(records.space.names):
        if key.owns(name) and model.parameters[name].null is not None:
            changed[i] = idle(model.parameters[name])
    return changed
