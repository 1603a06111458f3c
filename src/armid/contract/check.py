"""One entrance to all contracts."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from armid.contract.analysis import check_analysis
from armid.contract.effect import check_effect
from armid.contract.fitness import check_fitness
from armid.contract.identifier import check_identifier
from armid.contract.plant import check_plant
from armid.contract.trials import Finding
from armid.errors import ArmidError
from armid.identifiers import as_identifier
from armid.model import PLANTS, Effect, Model, Plant
from armid.problem.fitness import as_fitness
from armid.problem.replay import replays
from armid.problem.space import Space, space_of
from armid.record import Campaign, Record


def check_thing(kind: str, name: str, thing: Any, plants: Mapping[str, Plant] = PLANTS) -> list[Finding]:
    """Run the contract of a plant, an effect, a fitness, an identifier or an analysis.

    kind: "plants", "effects", "fitness", "identifiers" or "analyses". plants: those on which an effect is tried.
    Raises ArmidError for an object that does not even have the form of its kind.
    """
    if kind == "plants":
        return check_plant(thing)
    if kind == "effects":
        return check_effect(thing, plants)
    if kind == "fitness":
        return check_fitness(as_fitness(name, thing))
    if kind == "analyses":
        return check_analysis(name, thing)
    return check_identifier(as_identifier(name, thing))


def check_campaign(campaign: Campaign, effects: dict[str, Effect]) -> list[Finding]:
    """Try a campaign that was read: its model composes, and moves in every record.

    effects: name -> those that it may declare.
    """
    told = [roles(campaign), *(noise_told(r) for r in campaign.records)]
    try:
        model = campaign.model(effects)
        space = space_of(model, campaign.parameters)
        free = ", ".join(space.free_names) or "nothing"
        found = [Finding("model", True, f"{model.plant.name} with {len(model.effects)} effects, free: {free}")]
        return [*told, *found, *moves(campaign, model, space)]
    except ArmidError as error:
        return [*told, Finding("model", False, str(error))]


def roles(campaign: Campaign) -> Finding:
    """Tell how many records there are to train on and to hold out; none held out is only said."""
    n_train, n_holdout = len(campaign.train), len(campaign.holdout)
    text = f"{n_train} to train on, {n_holdout} held out"
    return Finding("records", n_train > 0, text if n_holdout else f"{text}: nothing will judge what is found")


def noise_told(record: Record) -> Finding:
    """Tell what was read of a record."""
    noise, n = record.noise, record.measured.size
    text = f"{n} samples at {1.0 / record.manoeuvre.interval:.6g} Hz, noise {noise.rms:.3g} {record.unit}"
    return Finding(f"{record.file}, {record.role}", True, f"{text} (from {noise.source})")


def moves(campaign: Campaign, model: Model, space: Space) -> list[Finding]:
    """Tell whether the model follows every record to its end, its free parameters in the middle of their range."""
    middle = 0.5 * (space.low + space.high)[space.free]
    found = []
    for replay in replays(campaign.records, model, space):
        signal = replay.signal(space.complete(middle[np.newaxis]))[0]
        whole = bool(np.isfinite(signal).all())
        size = f"up to {np.max(np.abs(signal)):.3g}" if whole else "diverges"
        text = f"simulated {size}, measured up to {np.max(np.abs(replay.measured)):.3g} {replay.record.unit}"
        found.append(Finding(f"moves in {replay.record.file}", whole, text))
    return found
