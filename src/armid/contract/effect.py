"""The contract of an effect."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from armid.contract.finding import Finding
from armid.contract.manoeuvres import trial_manoeuvres
from armid.contract.reference import simulate_plainly
from armid.model import ArmidError, Effect, Manoeuvre, Model, Parameter, Plant
from armid.simulation import FINE, calibrate, probes, simulate

Array = NDArray[np.float64]
NULL_TOLERANCE, REFERENCE_TOLERANCE = 1e-12, 1e-5


def check_effect(effect: Effect, plants: Mapping[str, Plant]) -> list[Finding]:
    """Try an effect on every plant that offers its ports and names."""
    models, refusals = [], []
    for plant in (p for given in plants.values() for p in (given, *given.variants)):
        try:
            models.append(Model(plant) + effect)
        except ArmidError as error:
            refusals.append(f"{plant.name}: {error}")
    fits = f"fits {', '.join(m.plant.name for m in models)}" if models else f"fits no plant ({'; '.join(refusals)})"
    findings = [Finding("binds", bool(models), fits), null_in_bounds(effect), documented(effect)]
    return findings + [f for model in models for f in check_on(effect, model)]


def null_in_bounds(effect: Effect) -> Finding:
    """Tell whether the effect has null values, and each lies in its bounds."""
    nulls = [p for p in effect.parameters if p.null is not None]
    out = [p.name for p in nulls if p.null is not None and not p.low <= p.null <= p.high]
    text = f"null of {', '.join(out)} is outside its bounds" if out else f"{len(nulls)} parameters have a null value"
    return Finding("null values", bool(nulls) and not out, text)


def documented(effect: Effect) -> Finding:
    """Tell whether every function of the effect says what it is."""
    functions = [*effect.adds.values()]
    silent = [f.__name__ for f in functions if not (f.__doc__ or "").strip()]
    text = f"no docstring: {', '.join(silent)}" if silent else "every port has a docstring"
    return Finding("documented", not silent, text)


def values_of(model: Model, share: float, effect: Effect | None = None) -> Array:
    """Return a candidate: nominal or middle values, the effect's at a share of the way from null to the upper bound."""
    mine = () if effect is None else effect.parameters
    own = {f"{effect.name}.{p.name}" for p in mine if effect is not None and p.null is not None}
    return np.array([
        away(p, share) if name in own else middle(p) for name, p in model.parameters.items()
    ])  # fmt: skip


def middle(p: Parameter) -> float:
    """Return the nominal value, else the fixed one, else the middle of the range."""
    return next((v for v in (p.nominal, p.fixed) if v is not None), 0.5 * (p.low + p.high))


def away(p: Parameter, share: float) -> float:
    """Return a value between null and the upper bound."""
    null = p.null or 0.0
    return null + share * ((p.high if p.high > null else p.low) - null)


def check_on(effect: Effect, model: Model) -> list[Finding]:
    """Try the effect on one plant."""
    bare, where = model - effect.name, model.plant.name
    scale = model.plant.scales.speed
    manoeuvres = trial_manoeuvres(model.plant)
    null = max(distance(bare, model, m, values_of(bare, 0.0), values_of(model, 0.0, effect)) for m in manoeuvres)
    moved = max(distance(bare, model, m, values_of(bare, 0.0), values_of(model, 0.3, effect)) for m in manoeuvres)
    return [
        Finding(f"null law on {where}", null <= NULL_TOLERANCE * scale, f"at null the signal differs by {null:.2g}"),
        Finding(f"acts on {where}", 0.0 < moved < np.inf, f"at 30 % of its range it moves the signal by {moved:.2g}"),
        on_arrays(effect, model),
        finite(effect, model, manoeuvres),
        agrees(effect, model, manoeuvres),
    ]


def distance(bare: Model, model: Model, manoeuvre: Manoeuvre, x: Array, y: Array) -> float:
    """Return the largest difference of two models' signals, on the same schedule."""
    schedule = calibrate(model, manoeuvre, y[np.newaxis], FINE, spans=False).schedule
    a, b = simulate(bare, manoeuvre, x, schedule).output, simulate(model, manoeuvre, y, schedule).output
    return float(np.max(np.abs(a - b)))


def on_arrays(effect: Effect, model: Model) -> Finding:
    """Tell whether the plain functions work on arrays, as tracing and figures use them."""
    bad = []
    for port, function in effect.adds.items():
        node = model.graph.nodes[f"{effect.name}__{port}"]
        value = function(**{a: np.full(5, 0.3) for a, _ in node.arguments})
        if np.shape(value) not in ((5,), ()):
            bad.append(port)
    text = f"wrong shape at {', '.join(bad)}" if bad else "the plain functions keep the shape of arrays"
    return Finding(f"arrays on {model.plant.name}", not bad, text)


def finite(effect: Effect, model: Model, manoeuvres: list[Manoeuvre]) -> Finding:
    """Tell whether the signal stays finite over the box of the effect."""
    own = np.array([name.startswith(f"{effect.name}.") for name in model.parameters])
    low = np.array([p.low if o else middle(p) for p, o in zip(model.parameters.values(), own, strict=True)])
    high = np.array([p.high if o else middle(p) for p, o in zip(model.parameters.values(), own, strict=True)])
    failed = 0
    for m in manoeuvres:
        spread = probes(low, high, 16)
        failed += int(simulate(model, m, spread, calibrate(model, m, spread, spans=False).schedule).failed.sum())
    text = f"{failed} of {16 * len(manoeuvres)} candidates diverge"
    return Finding(f"finite on {model.plant.name}", failed == 0, text)


def agrees(effect: Effect, model: Model, manoeuvres: list[Manoeuvre]) -> Finding:
    """Tell whether the compiled model agrees with its plain functions under scipy."""
    x, m = values_of(model, 0.3, effect), manoeuvres[0]
    schedule = calibrate(model, m, x[np.newaxis], FINE).schedule
    error = float(np.max(np.abs(simulate(model, m, x, schedule).output[0] - simulate_plainly(model, m, x))))
    return Finding(f"compiled on {model.plant.name}", error <= REFERENCE_TOLERANCE * model.plant.scales.speed,
                   f"the compiled model is within {error:.2g} of its plain functions under scipy")  # fmt: skip
