"""The entrance to all contracts; those of a campaign, of a fitness and of an identifier."""

import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from pymoo.optimize import minimize

from armid.contract.equations import check_effect, check_plant
from armid.contract.trials import ContractPoint
from armid.engine import accuracy_against, calibrate
from armid.errors import ArmidError
from armid.estimation.corrections import DataIssue
from armid.estimation.data_checks import data_issues, roomy_space
from armid.identifiers import Identifier, as_identifier
from armid.identifiers.own import OutsideWarning, global_generators
from armid.model import PLANTS, Array, Effect, Model, Plant
from armid.problem.fitness import Fitness, as_fitness
from armid.problem.meter import BudgetIgnoredError, Meter, Metered, MeterTermination
from armid.problem.problem import ReadyRecord
from armid.record import Campaign, Record

CHECK_INTERVAL, NOISE_OF_TRIAL = 1e-3, 0.01
# So many times smaller or larger than is typical an input is probably in another unit.
FAR = 100.0


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
        noise, signal, n = record.noise, record.signals[0], record.measured.size
        n_seen = n if signal.data is None else int(signal.data.sum())
        # a grid that is finer than the sensor has no sample to lose at most of its times
        own = f"{n_seen} of {n}" if n_seen < n and signal.every == 1 else f"{n_seen}"
        text = f"{own} samples at {1.0 / record.spacing:.6g} Hz, noise {noise.rms:.3g} {record.unit}"
        unused = f"; not used: {', '.join(record.unused)}" if record.unused else ""
        yield ContractPoint(f"{record.file}, {record.role}", True, f"{text} (from {noise.source}){unused}")
    try:
        model = campaign.model(effects)
        space = roomy_space(campaign, model)
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
            size = f"simulated up to {np.max(np.abs(signal)):.3g}" if is_finite else "its simulation diverges"
            text = f"{size} with parameters in the middle of their ranges, measured up to "
            text += f"{np.max(np.abs(replay.measured)):.3g} {replay.record.unit}"
            text += "" if is_finite else ": other ranges are expected, or equations that give a number there"
            yield ContractPoint(f"moves in {replay.name}", is_finite, text)
        yield from far_from_typical(campaign, model.plant)
        yield from never_changing(campaign, model.plant)
        yield from plausible(data_issues(campaign, model, space))
    except ArmidError as error:
        yield ContractPoint("model", False, str(error))


def far_from_typical(campaign: Campaign, plant: Plant) -> Iterator[ContractPoint]:
    """Ask about the unit of inputs that are a hundred times smaller or larger than what is typical of a plant."""
    for of in plant.inputs:
        if of.typical is None:
            continue
        low, high = of.typical
        largest = {r.file: max(float(np.max(np.abs(p.manoeuvre.inputs[of.name]))) for p in r.pieces)
                   for r in campaign.records}  # fmt: skip
        files = [f for f, x in largest.items() if x > 0.0 and not 1 / FAR < x / max(-low, high) < FAR]
        if files:
            text = f"{', '.join(files)}: up to {max(largest[f] for f in files):.3g} {of.unit}, while {low:g} to "
            text += f"{high:g} {of.unit} is typical of plant '{plant.name}': look at the unit of the column"
            yield ContractPoint(f"input {of.name}", True, text, unclear=True)


def never_changing(campaign: Campaign, plant: Plant) -> Iterator[ContractPoint]:
    """Ask about inputs where none that a plant requires changes in any train record."""
    columns = {i.name: np.concatenate([p.manoeuvre.inputs[i.name] for r in campaign.train for p in r.pieces])
               for i in plant.inputs if i.required and campaign.train}  # fmt: skip
    if columns and all(np.ptp(values) == 0.0 for values in columns.values()):
        said = ", ".join(f"{name} is {values[0]:g}" for name, values in columns.items())
        text = f"{said} in all samples of the train records: a drive that moves the machine is expected to change"
        yield ContractPoint("inputs", True, text, unclear=True)


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
    unclear = "unjudged"
    wrong = [ContractPoint(f"plausible ({kind})", kind == unclear, f"{', '.join(files)}: {said}" if files else said,
                           kind == unclear) for (kind, said), files in alike.items()]  # fmt: skip
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
    fitness(*given, CHECK_INTERVAL, NOISE_OF_TRIAL)
    untouched = all(np.array_equal(a, b) for a, b in zip(given, trial_series(), strict=True))
    text = "the arrays are as they were" if untouched else "the arrays that it was given have changed"
    apart = np.array_equal(failed[:-1], values) and np.array_equal(alone, values[2:3])
    points = [
        ("one value per candidate", values.shape == (4,), f"shape {values.shape} for 4 candidates"),
        ("finite", np.isfinite(values).all(), f"values {np.array2string(values, precision=3)}"),
        ("least at a perfect match", np.argmin(values) == 0, f"{values[0]:.3g} at the measured series"),
        ("a failed candidate is worst", failed[-1] > values.max(), f"{failed[-1]:.3g} for a NaN row"),
        ("others untouched", apart, "compared: a candidate alone, and next to a failed one"),
        ("leaves its arguments alone", untouched, text),
        ("deterministic", np.array_equal(values, again), "a second call is compared with the first"),
    ]
    return [ContractPoint(name, bool(holds), seen) for name, holds, seen in points]


def trial_series() -> tuple[Array, Array]:
    times = CHECK_INTERVAL * np.arange(300)
    measured = np.sin(12.0 * times) * np.exp(-2.0 * times)
    disturbances = np.array([0.0, 0.05, 0.2, 0.6])
    return measured, measured + disturbances[:, np.newaxis] * np.cos(23.0 * times)


def value(fitness: Fitness, measured: Array, simulated: Array) -> Array:
    return fitness(measured.copy(), simulated.copy(), CHECK_INTERVAL, NOISE_OF_TRIAL)


class Trial(Metered):
    """A bent valley in a box of very different units; with holes, simulations fail in a fifth of the box.

    10 (b - a^2)^2 + (a - 0.3)^2 + (c - 0.8)^2 in the unit cube; the failures are where a > 0.8. bare: they come out as
    NaN instead of the penalty that armid's problems give. watch: called with the candidates before they are evaluated.
    outside: candidates outside the box. moved: the warning about those that were moved into it before, "" without any.
    """

    def __init__(
        self, meter: Meter, holes: bool = False, bare: bool = False, watch: Callable[[Array], None] | None = None
    ) -> None:
        low, high = np.array([2.0e6, 0.5, -1.0]), np.array([3.0e6, 1.5, 1.0])
        super().__init__(meter, n_var=3, n_obj=1, xl=low, xu=high)
        self.holes, self.bare, self.watch = holes, bare, watch
        self.outside, self.moved = 0, ""

    def evaluated(self, X: Array, residuals: bool) -> tuple[Array, Array | None]:
        """Return the height of the valley, (n_candidates,), and the three terms whose squares it sums."""
        if self.watch is not None:
            self.watch(X)
        z = (X - self.xl) / (self.xu - self.xl)
        self.outside += int(((z < 0.0) | (z > 1.0)).any(axis=1).sum())
        a, b, c = z.T
        terms = np.column_stack([np.sqrt(10.0) * (b - a**2), a - 0.3, c - 0.8])
        failed = (a > 0.8) & self.holes
        return np.where(failed, np.inf, (terms**2).sum(axis=1)), terms if residuals else None

    def _evaluate(self, X: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        super()._evaluate(X, out, *args, **kwargs)
        if self.bare:
            failed = self.holes & ((X[:, 0] - self.xl[0]) / (self.xu[0] - self.xl[0]) > 0.8)
            out["F"][failed] = np.nan


TRIAL_BUDGET = 403
# Where the trial's simulations begin to raise: inside a generation.
RAISES_AT = 50


def check_identifier(identifier: Identifier) -> Iterator[ContractPoint]:
    """Try an identifier on a trial problem: as it is, with failing simulations, and with an error."""
    try:
        meter, problem = run(identifier, 1)
    except BudgetIgnoredError as error:
        yield ContractPoint("exact budget", False, str(error))
        return
    if not meter.used:
        yield ContractPoint("exact budget", False, f"0 of {TRIAL_BUDGET} simulations used: it asked for no candidate")
        return
    log = meter.log()
    best = f"the best of the log is {np.min(log.F):.3g}, the best that is kept {meter.best_f:.3g}"
    yield ContractPoint(
        "exact budget", 0 < meter.used <= TRIAL_BUDGET, f"{meter.used} of {TRIAL_BUDGET} simulations used"
    )
    text = problem.moved or f"{problem.outside} candidates outside the bounds"
    yield ContractPoint("inside the box", problem.outside == 0 and not problem.moved, text)
    yield ContractPoint("best never lost", meter.best_f == float(np.min(log.F)), best)
    early = float(np.median(log.F[:20]))
    yield ContractPoint("improves", meter.best_f < early, f"from {early:.3g}, the median of its first 20, to "
                        f"{meter.best_f:.3g}")  # fmt: skip
    again = difference(meter, run(identifier, 1, noise=2)[0])
    text = "the same seed asks for the same candidates, bit for bit"
    yield ContractPoint("reproducible", not again, f"the same seed again {again}" if again else text)
    other = difference(meter, run(identifier, 2)[0])
    says = "stochastic" if identifier.is_stochastic else "not stochastic"
    text = f"declared {says}, and another seed {other or 'asks for the same candidates'}"
    yield ContractPoint("seed", bool(other) == identifier.is_stochastic, text)
    yield failing(identifier, meter, "survives failures", bare=False)
    yield failing(identifier, meter, "survives NaN", bare=True)
    yield raising(identifier)


def failing(identifier: Identifier, undisturbed: Meter, name: str, bare: bool) -> ContractPoint:
    """Tell whether it searches on and improves where a fifth of the box fails; bare: with NaN instead of a penalty.

    One that ends before a third of the undisturbed run has been stopped by a failure.
    """
    meter, problem = run(identifier, 1, Trial(Meter(TRIAL_BUDGET), holes=True, bare=bare))
    log = meter.log()
    first = log.F[~log.failed][:20]
    improves = first.size > 0 and meter.best_f < float(np.median(first))
    value = "NaN" if bare else "a penalty"
    text = f"{meter.n_failed} of {meter.used} failed and gave {value}, best {meter.best_f:.3g}"
    return ContractPoint(name, improves and problem.outside == 0 and 3 * meter.used >= undisturbed.used, text)


class BrokenError(Exception):
    """Stand for whatever a user's model may raise."""


def raising(identifier: Identifier) -> ContractPoint:
    before = set(threading.enumerate())
    seen = 0

    def watch(X: Array) -> None:
        nonlocal seen
        seen += len(X)
        if seen > RAISES_AT:
            raise BrokenError

    came = "nothing"
    try:
        run(identifier, 1, Trial(Meter(TRIAL_BUDGET), watch=watch))
    except Exception as error:
        came = type(error).__name__
    ended_before = came == "nothing" and seen <= RAISES_AT
    left = [t.name for t in threading.enumerate() if t not in before]
    came_out = "the search ended before" if ended_before else f"{came} came out"
    text = f"a problem that raises BrokenError: {came_out}, {len(left)} threads are left"
    return ContractPoint("errors come out", (came == BrokenError.__name__ or ended_before) and not left, text)


def run(identifier: Identifier, seed: int, problem: Trial | None = None, noise: int = 1) -> tuple[Meter, Trial]:
    """Run an identifier on a trial problem; noise: state of the global generators, which must not matter."""
    trial = Trial(Meter(TRIAL_BUDGET)) if problem is None else problem
    assert trial.meter is not None
    with global_generators(noise), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", OutsideWarning)
        minimize(trial, identifier.build(TRIAL_BUDGET), MeterTermination(trial.meter), seed=seed, copy_algorithm=False)
    for warning in caught:
        if warning.category is OutsideWarning:
            trial.moved = str(warning.message)
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    return trial.meter, trial


def difference(one: Meter, other: Meter) -> str:
    """Return from which candidate on two runs differ, in words, "" where requests and answers were the same."""
    a, b = one.log(), other.log()
    n = min(len(a.F), len(b.F))
    alike = (a.X[:n] == b.X[:n]).all(axis=1) & (a.F[:n] == b.F[:n]) if n else np.ones(0, np.bool_)
    if alike.all() and len(a.F) == len(b.F):
        return ""
    return f"differs from candidate {(n if alike.all() else int(np.argmin(alike))) + 1} on"
