"""The entrance to all contracts; those of a campaign, a fitness and an analysis."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from armid.contract.equations import check_effect, check_plant
from armid.contract.identifier import check_identifier
from armid.contract.trials import ContractPoint
from armid.engine import accuracy_against, calibrate
from armid.errors import ArmidError
from armid.estimation.mends import Suspicion
from armid.estimation.screen import screen
from armid.identifiers import as_identifier
from armid.model import PLANTS, Array, Effect, Model, Plant
from armid.problem.fitness import Fitness, as_fitness
from armid.problem.problem import Replay
from armid.problem.space import space_of
from armid.record import Campaign, Record
from armid.report.style import pyplot

if TYPE_CHECKING:
    from pandas import DataFrame


SEEDS = range(1, 6)
# Parameter -> truth in each case, SI.
TRUTHS = {"p0": {"row 1": 3.2e6, "row 2": 3.1e6}, "k": {"row 1": 1.0, "row 2": 0.95}}


def check_analysis(name: str, function: Callable[..., Any]) -> list[ContractPoint]:
    """Try an analysis on made-up runs of two identifiers, one of which has failed."""
    if not callable(function):
        raise ArmidError(f"analysis '{name}' is of type {type(function).__name__}: a function of runs is expected")
    runs = synthetic_runs()
    try:
        parts = parts_of(name, function(runs))
        again = parts_of(name, function(synthetic_runs()))
    except Exception as error:
        text = str(error) if isinstance(error, ArmidError) else f"{type(error).__name__}: {error}"
        return [ContractPoint("tables and figures", False, text)]
    unchanged, same = runs.equals(synthetic_runs()), content(parts) == content(again)
    text = "the runs are as they were" if unchanged else "the runs that it was given have changed"
    return [
        ContractPoint("tables and figures", True, f"{len(parts)}: {', '.join(parts)}"),
        ContractPoint("leaves its argument alone", unchanged, text),
        ContractPoint("deterministic", same, "a second call is compared with the first"),
    ]


def parts_of(name: str, found: Any) -> dict[str, Any]:
    """Return title -> DataFrame or matplotlib figure of what an analysis returned.

    found: a DataFrame, a figure (or what carries one, such as axes), or a dict, tuple or list of these; None: nothing.
    """
    from matplotlib.figure import Figure
    from pandas import DataFrame

    if found is None:
        return {}
    if isinstance(found, Mapping):
        titled = {str(title): part for title, part in found.items()}
    elif isinstance(found, tuple | list):
        titled = {f"{name} {i}": part for i, part in enumerate(found, 1)}
    else:
        titled = {name: found}
    parts = {title: part if isinstance(part, DataFrame) else getattr(part, "figure", part)
             for title, part in titled.items()}  # fmt: skip
    for title, part in parts.items():
        if not isinstance(part, DataFrame | Figure):
            raise ArmidError(f"analysis '{name}' returns a {type(part).__name__} as '{title}': a pandas DataFrame, a "
                             "matplotlib figure, or a dict or tuple of these is expected")  # fmt: skip
        if isinstance(part, DataFrame):
            names = [str(n) for n in (*(n for n in part.index.names if n is not None), *part.columns)]
            if twice := [n for n in names if names.count(n) > 1]:
                raise ArmidError(f"analysis '{name}' returns a table '{title}' with '{twice[0]}' twice as a column or "
                                 "index: each name once is expected")  # fmt: skip
    return parts


def content(parts: Mapping[str, Any]) -> dict[str, object]:
    """Return what tables and figures show, comparable; figures are closed."""
    found: dict[str, object] = {}
    for title, part in parts.items():
        if hasattr(part, "canvas"):
            part.canvas.draw()
            found[title] = bytes(part.canvas.buffer_rgba())
            pyplot().close(part)
        else:
            found[title] = part.to_csv()
    return found


def synthetic_runs() -> "DataFrame":
    """Return made-up runs, one row a run, with every column that an analysis is given.

    Two identifiers ran on two cases under two noise levels with five seeds; the last run failed.

    ==================================  ==========================================================================
    study, run                          names of the study and of the run
    case, identifier, fitness           what was identified, who searched, what was minimised
    noise_deg_s, window, seed           noise that the study added (NaN: records' own), part of the motion
    variant, setting                    identifier (with its fitness where it ran on several); noise in words
    status, error, stopped              "done" or "failed" and why; why the search stopped
    budget, used, n_failed              simulations: allowed, used, diverged
    value                               best fitness
    train_rmse, holdout_rmse            errors of the result, SI
    train_s, train_s1, train_s2         similarity degrees of the result
    seconds                             duration
    largest_error                       largest relative error of a parameter; inf: failed, NaN: truth not known
    NAME                                value of each free parameter, SI
    NAME_truth, NAME_error              its truth, and abs(value - truth)/abs(truth), NaN where it is not known
    NAME_deviation, NAME_at_bound       its Cramer-Rao standard deviation; whether it ended on its bound
    ==================================  ==========================================================================
    """
    from pandas import DataFrame

    pyplot()
    rng = np.random.default_rng(1)
    rows: list[dict[str, Any]] = []
    searches, settings = (("pso", 1e-3), ("de", 1e-5)), ((0.0, "noise-free"), (0.3, "0.3 deg/s"))
    for case, (identifier, scale), (noise, setting), seed in product(TRUTHS["k"], searches, settings, SEEDS):
        errors = {name: scale * float(rng.lognormal()) for name in TRUTHS}
        row = {
            "study": "made_up", "run": f"r{len(rows)}", "case": case, "identifier": identifier, "fitness": "rmse",
            "noise_deg_s": noise, "window": "whole", "seed": seed, "variant": identifier, "setting": setting,
            "status": "done", "error": "", "stopped": "budget used", "budget": 3000, "used": 3000 - seed,
            "n_failed": seed, "value": scale, "train_rmse": 0.01, "holdout_rmse": 0.02, "train_s": 0.99,
            "train_s1": 0.99, "train_s2": 1.0, "seconds": 1.0, "largest_error": max(errors.values()),
        }  # fmt: skip
        for name, truth in TRUTHS.items():
            row |= {
                name: truth[case] * (1.0 + errors[name]), f"{name}_truth": truth[case], f"{name}_error": errors[name],
                f"{name}_deviation": 1e-3 * truth[case], f"{name}_at_bound": False,
            }  # fmt: skip
        rows.append(row)
    found = [f"{name}{end}" for name in TRUTHS for end in ("", "_error", "_deviation")]
    results = ["value", "train_rmse", "holdout_rmse", "train_s", "train_s1", "train_s2", *found]
    rows[-1] |= dict.fromkeys(results, np.nan) | {
        "status": "failed", "error": "it broke", "stopped": "", "used": 0, "n_failed": 0, "largest_error": np.inf,
    }  # fmt: skip
    return DataFrame(rows)


INTERVAL, NOISE = 1e-3, 0.01


def check_thing(kind: str, name: str, thing: Any, plants: Mapping[str, Plant] = PLANTS) -> Iterator[ContractPoint]:
    """Run the contract of a plant, an effect, a fitness, an identifier or an analysis, and yield each point when done.

    kind: "plants", "effects", "fitness", "identifiers" or "analyses". plants: those on which an effect is tried.
    """
    if kind == "plants":
        yield from check_plant(thing)
    elif kind == "effects":
        yield from check_effect(thing, plants)
    elif kind == "fitness":
        yield from check_fitness(as_fitness(name, thing))
    elif kind == "analyses":
        yield from check_analysis(name, thing)
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
        own = f"{n}" if record.data is None else f"{int(record.data.sum())} of {n}"
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
        for replay in (one for record in campaign.records for one in replay_at(middle, record, model).each):
            signal = replay.signal(middle)[0]
            whole = bool(np.isfinite(signal).all())
            size = f"up to {np.max(np.abs(signal)):.3g}" if whole else "diverges"
            measured = f"{np.max(np.abs(replay.measured)):.3g} {replay.record.unit}"
            text = f"simulated {size} at mid-range, measured up to {measured}"
            yield ContractPoint(f"moves in {replay.record.file}", whole, text)
        yield from plausible(screen(campaign, model, space))
    except ArmidError as error:
        yield ContractPoint("model", False, str(error))


def replay_at(candidate: Array, record: Record, model: Model) -> Replay:
    """Make a record ready to be simulated with one candidate; to calibrate the whole box takes far longer."""
    pieces, accuracy = tuple(p.until_window_end() for p in record.pieces), accuracy_against(record.noises, model)
    calibrations = (calibrate(model, p.manoeuvre, candidate, accuracy, spans=False) for p in pieces)
    return Replay(record, model, pieces, tuple(calibrations))


def plausible(found: Sequence[Suspicion]) -> list[ContractPoint]:
    alike: dict[tuple[str, str], list[str]] = {}
    for s in found:
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
        ("others untouched", apart, "alone, and beside a failed one, a candidate is compared with itself"),
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
