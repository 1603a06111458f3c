"""What a user's own plant, effect, fitness, identifier or campaign has to keep."""

from armid.contract.campaign import check_campaign
from armid.contract.check import check_thing
from armid.contract.effect import check_effect
from armid.contract.finding import Finding
from armid.contract.fitness import check_fitness
from armid.contract.identifier import check_identifier
from armid.contract.plant import check_plant
from armid.contract.reference import simulate_plainly

__all__ = [
    "Finding", "check_campaign", "check_effect", "check_fitness", "check_identifier", "check_plant", "check_thing",
    "simulate_plainly",
]  # fmt: skip
