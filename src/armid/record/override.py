"""What a campaign says of parameters: other bounds, or a fixed value."""

from collections.abc import Mapping
from typing import Any

from armid.model import ArmidError, Effect, Parameter, Plant
from armid.model.scales import resolve
from armid.record.schema import Override, unknown_name, validated


def overrides_of(
    tables: Mapping[str, Mapping[str, Any]], plant: Plant, effects: Mapping[str, Effect], where: str
) -> dict[str, Override]:
    """Return qualified parameter name (`p0`, `coulomb.level`) -> Override.

    tables: [parameters] of the file; an effect's parameter is written [parameters."coulomb.level"] or
    [parameters.coulomb.level]. plant: with its scales set. effects: all that are known, used or not.

    Raises ArmidError for an unknown parameter, an unknown key, bounds of which low is not below high, and bounds of a
    parameter that is fixed.
    """
    known = known_parameters(plant, effects)
    overrides = {}
    for name, table in flattened(tables).items():
        if name not in known:
            raise unknown_name("parameter", name, known, where)
        overrides[name] = validated(Override, table, f"{where}, parameters.{name}")
        check_bounds(overrides[name], resolve(known[name], plant.scales), f"{where}, parameters.{name}")
    return overrides


def known_parameters(plant: Plant, effects: Mapping[str, Effect]) -> dict[str, Parameter]:
    """Return qualified name -> declaration, of the plant and of every known effect."""
    own = {p.name: p for p in plant.parameters}
    return own | {f"{e.name}.{p.name}": p for e in effects.values() for p in e.parameters}


def flattened(tables: Mapping[str, Mapping[str, Any]]) -> dict[str, object]:
    """Return qualified name -> table, also where the name was written as nested tables."""
    flat: dict[str, object] = {}
    for name, table in tables.items():
        inner = {key: value for key, value in table.items() if isinstance(value, dict)}
        for key, value in inner.items():
            flat[f"{name}.{key}"] = value
        if len(inner) < len(table) or not table:
            flat[name] = {key: value for key, value in table.items() if key not in inner}
    return flat


def check_bounds(override: Override, declared: Parameter, where: str) -> None:
    """Refuse bounds that leave nothing between them, and bounds beside a fixed value, which would not count.

    The declared bound (SI) stands for one that is not given.
    """
    if override.fixed is not None and (override.low, override.high) != (None, None):
        raise ArmidError(f"{where}: 'fixed' and a bound are both there, a fixed value or bounds are expected")
    low = declared.low if override.low is None else override.low
    high = declared.high if override.high is None else override.high
    if not low < high:
        raise ArmidError(f"{where}: low is {low:g} and high is {high:g}, low below high is expected")
