"""What contracts find, and the candidates and manoeuvres on which they are tried."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armid.engine import probes
from armid.model import Effect, Input, Manoeuvre, Model, Parameter, Plant

Array = NDArray[np.float64]
N_SAMPLES, INTERVAL = 401, 2e-3
# The moment of gravity that a hanging axis gets, as a share of the effort scale.
GRAVITY = 0.4


@dataclass(frozen=True)
class Finding:
    """Hold one point of a contract: its name, whether it holds, and what was seen."""

    name: str
    passed: bool
    sentence: str


def check_parameters(parameters: Iterable[Parameter]) -> list[Finding]:
    """Tell whether bounds are finite, other values lie between them, and units are named."""
    given = list(parameters)
    outside = [
        p.name for p in given if not all(p.low <= v <= p.high for v in (p.null, p.fixed, p.nominal) if v is not None)
    ]
    named = "the only parameter" if len(given) == 1 else f"all {len(given)} parameters"
    return [
        finding("bounds", [p.name for p in given if not np.isfinite([p.low, p.high]).all()],
                "bounds of {} are not finite", f"finite and ordered for {named}"),
        finding("values", outside,
                "null, fixed or nominal value of {} is outside the bounds", f"inside the bounds for {named}"),
        finding("units", [p.name for p in given if not p.unit.strip()],
                "{} has no unit: '1' is expected for a plain number", f"named for {named}"),
    ]  # fmt: skip


def finding(name: str, wrong: list[str], says: str, otherwise: str) -> Finding:
    """Return a finding that fails where names are wrong, and tells them."""
    return Finding(name, not wrong, says.format(", ".join(wrong)) if wrong else otherwise)


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
    """Return the parameters with a null value; one that is fixed by declaration is none, as nothing is found by it."""
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


def trial_manoeuvres(plant: Plant) -> list[Manoeuvre]:
    """Return two manoeuvres of a plant: there and back; inputs are a sine and a sawtooth over their typical range.

    An input without one moves over half the effort scale, per unit of gain.
    """
    times = INTERVAL * np.arange(N_SAMPLES)
    shapes = (np.sin(9.0 * times), 2.0 * ((1.3 * times) % 1.0) - 1.0)
    gain = next((c.value for c in plant.constants if c.name == "gain"), 1.0)
    size = 0.5 * plant.scales.effort / (gain or 1.0)

    def moved(driven: Input, shape: Array) -> Array:
        if driven.typical is None:
            return size * shape
        low, high = driven.typical
        return 0.5 * (low + high) + 0.5 * (high - low) * shape

    return [
        Manoeuvre(INTERVAL, N_SAMPLES, constants_of(plant, turned), {i.name: moved(i, shape) for i in plant.inputs})
        for turned, shape in enumerate(shapes)
    ]


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
