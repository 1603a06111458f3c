"""One entrance to all contracts."""

from collections.abc import Mapping
from typing import Any

from armid.contract.effect import check_effect
from armid.contract.finding import Finding
from armid.contract.fitness import check_fitness
from armid.contract.identifier import check_identifier
from armid.contract.plant import check_plant
from armid.fitness import as_fitness
from armid.identifiers import as_identifier
from armid.model import PLANTS, Plant


def check_thing(kind: str, name: str, thing: Any, plants: Mapping[str, Plant] = PLANTS) -> list[Finding]:
    """Run the contract of a plant, an effect, a fitness or an identifier.

    kind: "plants", "effects", "fitness" or "identifiers". plants: those on which an effect is tried.
    Raises ArmidError for an object that does not even have the form of its kind.
    """
    if kind == "plants":
        return check_plant(thing)
    if kind == "effects":
        return check_effect(thing, plants)
    if kind == "fitness":
        return check_fitness(as_fitness(name, thing))
    return check_identifier(as_identifier(name, thing))
