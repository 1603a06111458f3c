"""Candidates on which contracts are tried."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from armid.model import Effect, Model, Parameter
from armid.simulation import probes

Array = NDArray[np.float64]


def nominal(model: Model) -> Array:
    """Return nominal or middle values, effects at their null, (n_parameters,)."""
    return np.array([middle(p) if p.null is None else p.null for p in model.parameters.values()])


def middle(p: Parameter) -> float:
    """Return the nominal value, else the fixed one, else the middle of the range."""
    return next((v for v in (p.nominal, p.fixed) if v is not None), 0.5 * (p.low + p.high))


def over_box(model: Model, n_candidates: int) -> Array:
    """Return candidates spread over the bounds of all parameters, (n_candidates, n_parameters)."""
    parameters = model.parameters.values()
    low, high = (np.array([getattr(p, side) for p in parameters]) for side in ("low", "high"))
    return probes(low, high, n_candidates)


def at_null(model: Model, n_candidates: int) -> Array:
    """Return candidates spread over the bounds, what has a null value at it, (n_candidates, n_parameters)."""
    nulls = np.array([np.nan if p.null is None else p.null for p in model.parameters.values()])
    return np.where(np.isnan(nulls), over_box(model, n_candidates), nulls)


def away(model: Model, effect: Effect, share: float) -> Array:
    """Return nominal values, those of an effect at a share of the way from null to its farther bound."""
    values = dict(zip(model.parameters, nominal(model), strict=True))
    for own in effect.parameters:
        name = f"{effect.name}.{own.name}"
        p = model.parameters[name]
        if p.null is not None:
            farther = p.high if p.high - p.null >= p.null - p.low else p.low
            values[name] = p.null + share * (farther - p.null)
    return np.array(list(values.values()))


def corners(model: Model, effect: Effect) -> Array:
    """Return nominal values with every combination of the bounds of an effect's free parameters."""
    names = [f"{effect.name}.{p.name}" for p in effect.parameters if p.fixed is None]
    bounds = [(model.parameters[n].low, model.parameters[n].high) for n in names]
    values = dict(zip(model.parameters, nominal(model), strict=True))
    return np.array([list((values | dict(zip(names, corner, strict=True))).values()) for corner in product(*bounds)])


def strengths_of(effect: Effect) -> list[Parameter]:
    """Return the parameters with a null value; one that is fixed by declaration is none, as nothing traces by it."""
    return [p for p in effect.parameters if p.null is not None and p.fixed is None]


def from_null(model: Model, effect: Effect, shares: Array) -> Array:
    """Return nominal values with each strength of an effect in turn at shares of its range from its null.

    Shape (n_strengths, n_shares, n_parameters); into the range where the null is a bound.
    """
    start, names = nominal(model), list(model.parameters)
    moved = []
    for name in (f"{effect.name}.{p.name}" for p in strengths_of(effect)):
        p, rows = model.parameters[name], np.tile(start, (len(shares), 1))
        assert p.null is not None
        rows[:, names.index(name)] += shares * (p.high - p.low) * (1.0 if p.high > p.null else -1.0)
        moved.append(rows)
    return np.array(moved)
