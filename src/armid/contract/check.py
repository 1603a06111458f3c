"""The entrance to all contracts; those of a campaign and of a fitness."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.contract.analysis import check_analysis
from armid.contract.equations import check_effect, check_plant
from armid.contract.identifier import check_identifier
from armid.contract.trials import Finding
from armid.errors import ArmidError
from armid.identifiers import as_identifier
from armid.model import PLANTS, Effect, Plant
from armid.problem.fitness import Fitness, as_fitness
from armid.problem.replay import replays
from armid.problem.space import space_of
from armid.record import Campaign

Array = NDArray[np.float64]
INTERVAL, NOISE = 1e-3, 0.01


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
    """Try a campaign that was read: its model composes, and follows every record to its end.

    Free parameters are in the middle of their range. effects: name -> those that it may declare.
    """
    n_train, n_holdout = len(campaign.train), len(campaign.holdout)
    text = f"{n_train} to train on, {n_holdout} held out"
    found = [Finding("records", n_train > 0, text if n_holdout else f"{text}: nothing will judge what is found")]
    for record in campaign.records:
        noise, n = record.noise, record.measured.size
        text = f"{n} samples at {1.0 / record.manoeuvre.interval:.6g} Hz, noise {noise.rms:.3g} {record.unit}"
        found.append(Finding(f"{record.file}, {record.role}", True, f"{text} (from {noise.source})"))
    try:
        model = campaign.model(effects)
        space = space_of(model, campaign.parameters)
        free = ", ".join(space.free_names) or "nothing"
        moves = [Finding("model", True, f"{model.plant.name} with {len(model.effects)} effects, free: {free}")]
        middle = 0.5 * (space.low + space.high)[space.free]
        for replay in replays(campaign.records, model, space):
            signal = replay.signal(space.complete(middle[np.newaxis]))[0]
            whole = bool(np.isfinite(signal).all())
            size = f"up to {np.max(np.abs(signal)):.3g}" if whole else "diverges"
            text = f"simulated {size}, measured up to {np.max(np.abs(replay.measured)):.3g} {replay.record.unit}"
            moves.append(Finding(f"moves in {replay.record.file}", whole, text))
    except ArmidError as error:
        moves = [Finding("model", False, str(error))]
    return found + moves


def check_fitness(fitness: Fitness) -> list[Finding]:
    """Try a fitness on a bump, the same bump disturbed more and more, and a candidate that failed."""
    measured, simulated = trial_series()
    try:
        values, again = value(fitness, measured, simulated), value(fitness, measured, simulated)
        alone = value(fitness, measured, simulated[2:3])
        failed = value(fitness, measured, np.vstack([simulated, np.full_like(measured, np.nan)]))
    except ArmidError as error:
        return [Finding("one value per candidate", False, str(error))]
    given = trial_series()
    fitness(*given, INTERVAL, NOISE)
    untouched = all(np.array_equal(a, b) for a, b in zip(given, trial_series(), strict=True))
    text = "the arrays are as they were" if untouched else "the arrays that it was given have changed"
    apart = np.array_equal(failed[:-1], values) and np.array_equal(alone, values[2:3])
    return [
        Finding("one value per candidate", values.shape == (4,), f"shape {values.shape} for 4 candidates"),
        Finding("finite", bool(np.isfinite(values).all()), f"values {np.array2string(values, precision=3)}"),
        Finding("least at a perfect match", int(np.argmin(values)) == 0, f"{values[0]:.3g} at the measured series"),
        Finding("a failed candidate is worst", bool(failed[-1] > values.max()), f"{failed[-1]:.3g} for a NaN row"),
        Finding("others untouched", bool(apart), "alone, and beside a failed one, a candidate is compared with itself"),
        Finding("leaves its arguments alone", untouched, text),
        Finding("deterministic", bool(np.array_equal(values, again)), "a second call is compared with the first"),
    ]


def trial_series() -> tuple[Array, Array]:
    """Return a measured bump, (n_samples,), and that bump disturbed more and more, (4, n_samples)."""
    times = INTERVAL * np.arange(300)
    measured = np.sin(12.0 * times) * np.exp(-2.0 * times)
    disturbances = np.array([0.0, 0.05, 0.2, 0.6])
    return measured, measured + disturbances[:, np.newaxis] * np.cos(23.0 * times)


def value(fitness: Fitness, measured: Array, simulated: Array) -> Array:
    """Return the value of each candidate, the function working on copies."""
    return fitness(measured.copy(), simulated.copy(), INTERVAL, NOISE)
