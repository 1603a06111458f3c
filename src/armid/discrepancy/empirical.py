"""A term without a physical name, fitted where the signal is missing; marked as empirical wherever it is shown."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from armid.discrepancy.curve import curve, directed, driven
from armid.discrepancy.dependence import N_KNOTS, Dependence
from armid.discrepancy.names import UNNAMED
from armid.model import Effect, Model, Parameter


def empirical_effect(model: Model, found: Dependence) -> tuple[Effect, dict[str, float]]:
    """Return an effect with the shape of a dependence, and the heights from which a fit may start (name -> SI).

    Raises ArmidError where the port needs what the term would be made of: a circle.
    """
    function, binds, width = form_of(model, found)
    span = float(np.abs(found.heights).max()) or 1.0
    unit = unit_of(model, found)
    parameters = [Parameter(f"h{i}", unit, -20.0 * span, 20.0 * span, null=0.0) for i in range(N_KNOTS)]
    shape = {"first": found.first, "last": found.last} | width
    fixed = [Parameter(name, "1", v - 1.0, v + 1.0, fixed=v, note="of the curve's range") for name, v in shape.items()]
    note = f"empirical: no name is claimed; a curve over {found.variable}, times {found.factor}"
    effect = Effect(key_of(found), (*parameters, *fixed), {found.port: function}, note=note, binds=binds)
    _ = model + effect
    return effect, {f"{effect.name}.h{i}": float(h) for i, h in enumerate(found.heights)}


def key_of(found: Dependence) -> str:
    """Return the name under which a term is compiled."""
    times = "" if found.factor == "1" else f"_times_{found.factor}"
    return f"{UNNAMED}{found.port}_by_{found.variable.replace('.', '_')}{times}"


def unit_of(model: Model, found: Dependence) -> str:
    """Return the unit of the curve."""
    unit = model.plant.ports[found.port]
    return f"{unit}/({model.plant.scales.effort_unit})" if found.factor == "drive_effort" else unit


def form_of(model: Model, found: Dependence) -> tuple[Callable[..., Any], Mapping[str, str], dict[str, float]]:
    """Return function, bindings and further fixed parameters of the term."""
    if found.factor == "direction":
        binds = {"variable": found.variable, "speed": "omega"}
        return directed, binds, {"width": 0.005 * model.plant.scales.speed}
    if found.factor == "drive_effort":
        return driven, {"variable": found.variable, "effort": "drive_effort"}, {}
    return curve, {"variable": found.variable}, {}
