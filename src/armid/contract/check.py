"""The entrance to all contracts; those of a campaign and of a fitness."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from armid.contract.equations import check_effect, check_plant
from armid.contract.identifier import check_identifier
from armid.contract.trials import ContractPoint
from armid.engine import accuracy_against, calibrate
from armid.errors import ArmidError
from armid.estimation.corrections import DataIssue
from armid.estimation.data_checks import data_issues
from armid.identifiers import as_identifier
from armid.model import PLANTS, Array, Effect, Model, Plant
from armid.problem.fitness import Fitness, as_fitness
from armid.problem.problem import ReadyRecord
from armid.problem.space import space_of
from armid.record import Campaign, Record

INTERVAL, NOISE = 1e-3, 0.01


def check_thing(kind: str, name: str, thing: Any, plants: Mapping[str, Plant] = PLANTS) -> Iterator[ContractPoint]:
    """Run the contract of a plant, an effect, a fitness or an identifier, and yield each point when done.

    kind: "plants", "effects", "fitness" or "identifiers". plants: those on which an effect is tried. Raises ArmidError
    for an analysis.
    """
    if kind == "plants":
        yield from check_plant(thing)
    elif kind == "effects":
        yield from check_effect(thing, plants)
    elif kind == "fitness":
        yield from check_fitness(as_fitness(name, thing))
    elif kind == "analyses":
        raise ArmidError(f"analysis '{name}' has no contract: `armid report DIR --plugin FILE.py:{name}` tries it on "
                         "the stored runs of a study")  # fmt: skip
    else:
        yield from check_identifier(as_identifier(name, thing))


def check_campaign(campaign: Campaign, effects: dict[str, Effect]) -> Iterator[ContractPoint]:
    """Try a campaign that was read: its model composes, and follows every record to its end; records are plausible.

    Free parameters are in the middle of their range. effects: name -> those that it may declare.
    """
    n_train, n_holdout = len(campaign.train), len(campaign.holdout)
    text = f"{n_train} to train on, {n_holdout} held out"
    yield ContractPoint("records", n_train > 0, text if n_holdout else f"{text}: nothing will judge what is found")
    for record in campaign.records:
        noise, n = record.noise, record.measured.size
        data = record.signals[0].data
        own = f"{n}" if data is None else f"{int(data.sum())} of {n}"
        text = f"{own} samples at {1.0 / record.manoeuvre.interval:.6g} Hz, noise {noise.rms:.3g} {record.unit}"
        yield ContractPoint(f"{record.file}, {record.role}", True, f"{text} (from {noise.source})")
    try:
        model = campaign.model(effects)
        space = space_of(model, campaign.parameters)
        free = ", ".join(space.free_names) or "nothing"
        yield ContractPoint("model", True, f"{model.plant.name} with {len(model.effects)} effects, free: {free}")
        if campaign.taken_as_exact:
            names = ", ".join(campaign.taken_as_exact)
            text = f"taken as exact: {names}; [tolerances] of campaign.toml says how well each is known"
            yield ContractPoint("constants", True, text)
        middle = space.complete(0.5 * (space.low + space.high)[np.newaxis, space.free])
        for replay in (one for record in campaign.records for one in ready_at(middle, record, model).each):
            signal = replay.signal(middle)[0]
            is_finite = bool(np.isfinite(signal).all())
            size = f"up to {np.max(np.abs(signal)):.3g}" if is_finite else "diverges"
            measured = f"{np.max(np.abs(replay.measured)):.3g} {replay.record.unit}"
            text = f"simulated {size} at mid-range, measured up to {measured}"
            yield ContractPoint(f"moves in {replay.record.file}", is_finite, text)
        yield from plausible(data_issues(campaign, model, space))
    except ArmidError as error:
        yield ContractPoint("model", False, str(error))


def ready_at(candidate: Array, record: Record, model: Model) -> ReadyRecord:
    """Make a record ready to be simulated with one candidate; to calibrate the whole box takes far longer."""
    record, accuracy = record.until_window_end(), accuracy_against(record.noises, model)
    calibrations = (calibrate(model, p.manoeuvre, candidate, accuracy, spans=False) for p in record.pieces)
    return ReadyRecord(record, model, tuple(calibrations))


def plausible(issues: Sequence[DataIssue]) -> list[ContractPoint]:
    alike: dict[tuple[str, str], list[str]] = {}
    for s in issues:
        # what holds for several records is one sentence with their names
        of_record, said = s.sentence.startswith(f"{s.record}: "), s.sentence.removeprefix(f"{s.record}: ")
        alike.setdefault((s.kind, said), []).extend([s.record] if of_record else [])
    wrong = [ContractPoint(f"plausible ({kind})", kind == "unjudged", f"{', '.join(files)}: {said}" if files else said)
             for (kind, said), files in alike.items()]  # fmt: skip
    right = "no sign, unit, clock or manoeuvre of a record looks wrong, as far as the declared model can tell"
    return wrong or [ContractPoint("plausible", True, right)]


def check_fitness(fitness: Fitness) -> list[ContractPoint]:
    """Try a fitness on a bump, the same bump disturbed more and more, and a candidate that failed."""
    measured, simulated = trial_series()
    try:
        values, again = value(fitness, measured, simulated), value(fitness, measured, simulated)
        alone = value(fitness, measured, simulated[2:3])
        failed = value(fitness, measured, np.vstack([simulated, np.full_like(measured, np.nan)]))
    except ArmidError as error:
        return [ContractPoint("one value per candidate", False, str(error))]
    given = trial_series()
    fitness(*given, INTERVAL, NOISE)
    untouched = all(np.array_equal(a, b) for a, b in zip(given, trial_series(), strict=True))
    text = "the arrays are as they were" if untouched else "the arrays that it was given have changed"
    apart = np.array_equal(failed[:-1], values) and np.array_equal(alone, values[2:3])
    points = [
        ("one value per candidate", values.shape == (4,), f"shape {values.shape} for 4 candidates"),
        ("finite", np.isfinite(values).all(), f"values {np.array2string(values, precision=3)}"),
        ("least at a perfect match", np.argmin(values) == 0, f"{values[0]:.3g} at the measured series"),
        ("a failed candidate is worst", failed[-1] > values.max(), f"{failed[-1]:.3g} for a NaN row"),
        (
            "others untouched",
            apart,
            "compared: a candidate alone, and next to a failed one",
        ),
        ("leaves its arguments alone", untouched, text),
        ("deterministic", np.array_equal(values, again), "a second call is compared with the first"),
    ]
    return [ContractPoint(name, bool(holds), seen) for name, holds, seen in points]


def trial_series() -> tuple[Array, Array]:
    times = INTERVAL * np.arange(300)
    measured = np.sin(12.0 * times) * np.exp(-2.0 * times)
    disturbances = np.array([0.0, 0.05, 0.2, 0.6])
    return measured, measured + disturbances[:, np.newaxis] * np.cos(23.0 * times)


def value(fitness: Fitness, measured: Array, simulated: Array) -> Array:
    return fitness(measured.copy(), simulated.copy(), INTERVAL, NOISE)
