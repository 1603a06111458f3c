"""A term without a physical name, fitted where the signal is missing; marked as empirical wherever it is shown."""

from collections.abc import Mapping, Sequence

import numpy as np

from armid.discrepancy.bundles import applies
from armid.discrepancy.curve import any_curve
from armid.discrepancy.dependence import N_KNOTS, Dependence, knows, variable_names
from armid.discrepancy.names import UNNAMED
from armid.model import ArmidError, Effect, Model, Parameter

SLOTS = 8
FACTORS = {"1": "one", "direction": "direction", "drive_effort": "driven"}
# Heights may grow to so many times the largest that was guessed.
GROWTH = 20.0


def key_of(port: str) -> str:
    """Return the name under which the term at a port is compiled."""
    return f"{UNNAMED}{port}"


def terms_of(model: Model) -> dict[str, Effect]:
    """Return port -> the term that may be added there, at rest: which curve it is, is decided by its parameters.

    Ports that need what every variable is made of (a circle) have none.
    """
    found = {}
    for port in model.plant.ports:
        variables = usable(model, port)
        if variables:
            found[port] = term_at(model, port, variables, None)
    return found


def empirical_effect(model: Model, found: Dependence) -> tuple[Effect, dict[str, float]]:
    """Return the term with the shape of a dependence, and the heights from which a fit may start (name -> SI).

    Raises ArmidError where the port needs what the term would be made of: a circle.
    """
    variables = usable(model, found.port)
    driven = found.factor == "drive_effort"
    if found.variable not in variables or (driven and not composes(model, found.port, "drive_effort")):
        raise ArmidError(f"a curve over {found.variable} cannot stand at port {found.port}, which it is made of")
    effect = term_at(model, found.port, variables, found)
    return effect, {f"{effect.name}.h{i}": float(h) for i, h in enumerate(found.heights)}


def usable(model: Model, port: str) -> list[str]:
    """Return the variables over which a curve can stand at a port, as many as there are slots."""
    return [v for v in variable_names(model) if composes(model, port, v)][:SLOTS]


def composes(model: Model, port: str, variable: str) -> bool:
    """Tell whether a term at a port may use a variable."""
    one = Parameter("one", "1", 0.0, 1.0, null=0.0)
    trial = Effect("trial", (one,), {port: product}, binds={"variable": variable})
    return knows(model, variable) and applies(model, trial)


def product(variable, one):  # type: ignore[no-untyped-def]
    """Return a variable times a parameter: the least that a term could be."""
    return one * variable


def term_at(model: Model, port: str, variables: Sequence[str], found: Dependence | None) -> Effect:
    """Return the term at a port with the values that make it one curve; at rest where no dependence is told."""
    span = GROWTH * (float(np.abs(found.heights).max()) if found is not None else 1.0) or GROWTH
    unit = model.plant.ports[port]
    heights = [Parameter(f"h{i}", unit, -span, span, null=0.0) for i in range(N_KNOTS)]
    chosen = chosen_values(model, variables, found)
    note = "of the curve: which one it is"
    fixed = [Parameter(name, "1", v - 1.0, v + 1.0, fixed=v, note=note) for name, v in chosen.items()]
    told = "" if found is None else f"; a curve over {found.variable}, times {found.factor}"
    return Effect(key_of(port), (*heights, *fixed), {port: any_curve}, note=f"empirical: no name is claimed{told}",
                  binds=bound(model, port, variables))  # fmt: skip


def chosen_values(model: Model, variables: Sequence[str], found: Dependence | None) -> dict[str, float]:
    """Return the parameters that choose variable, factor and range."""
    weights = {f"w{i}": 0.0 for i in range(SLOTS)}
    factors = dict.fromkeys(FACTORS.values(), 0.0)
    ends = {"first": -1.0, "last": 1.0}
    if found is not None:
        weights[f"w{variables.index(found.variable)}"] = 1.0
        factors[FACTORS[found.factor]] = 1.0
        ends = {"first": found.first, "last": found.last}
    return weights | factors | ends | {"width": 0.005 * model.plant.scales.speed}


def bound(model: Model, port: str, variables: Sequence[str]) -> Mapping[str, str]:
    """Return what the arguments of the curve stand for; slots without a variable take the time, at weight 0."""
    slots = {f"v{i}": variables[i] if i < len(variables) else "time" for i in range(SLOTS)}
    effort = "drive_effort" if composes(model, port, "drive_effort") else "time"
    return slots | {"speed": "omega" if composes(model, port, "omega") else "time", "effort": effort}
