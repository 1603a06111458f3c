"""Find the parameters of a model from the train records of a campaign."""

import platform
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError
from armid.estimation.bootstrap import Refined, Scatter, bootstrap, without
from armid.estimation.corrections import DataIssue
from armid.estimation.information import Information, collinear, covariance_by_inputs, information_at
from armid.estimation.input_noise import moved_by_inputs, pooled_noise
from armid.estimation.least_squares import held_by_bound, refine, with_fitted_starts
from armid.estimation.noise_model import MISFIT, Level, NoiseModel, known_level, level_of
from armid.identifiers import Identifier, run
from armid.identifiers.own import OUT_OF_BOX
from armid.model import Array, Model
from armid.problem.fitness import Fitness, chi_square, mean_square
from armid.problem.meter import BudgetIgnoredError, Meter
from armid.problem.problem import (
    IdentificationProblem,
    Replay,
    by_output,
    by_record,
    fitness_of,
    judged_by,
    output_sizes,
    replays,
    residual_weights,
    signals_of,
    weights_of,
)
from armid.problem.similarity import similarity
from armid.problem.space import Space
from armid.problem.starts import with_starts
from armid.record import Campaign
from armid.report.result import IDENTIFICATION, Kind, Result
from armid.units import angles_in, scale_of

if TYPE_CHECKING:
    from pandas import DataFrame

# Share of a range within which a parameter is on its bound.
ON_BOUND = 1e-12

WAS_INTERRUPTED = "interrupted"
# Two estimates of one model that are more of their standard deviations apart than this are not of the same minimum.
APART_IN_DEVIATIONS = 5.0
# A least-squares step of more standard deviations than this: a search by another fitness ends within a few.
FAR_FROM_MINIMUM = 4.0
# Share of the squares that such a step removes. Above it the search has not converged, and the model is not to blame.
MOST_GAIN = 0.5
# An estimate that is biased by more standard deviations has an interval that misses the truth in more than 8 %.
BIASED = 0.5
# Why there is no interval.
NOT_ASKED = "none was asked for"
# Where only noise is left, S2 below the first with S1 above the second: S2 pairs the few intervals between landmarks by
# order, and a landmark of noise unpairs them, so that neither S2 nor S is usable.
SHAPE_FALLS, NUMBERS_AGREE = 0.9, 0.95


@dataclass(frozen=True)
class Errors:
    """Errors of one candidate on some records of one output.

    rmse: pooled over all samples; nrmse: each record divided by its rms; chi2_per_sample: mean of (residual / noise)^2,
    None without noise; s, s1, s2: similarity degrees, mean weighted by duration of the records where they are usable,
    NaN where they are in none. span: from the smallest to the largest value that was measured.
    """

    rmse: float
    nrmse: float
    chi2_per_sample: float | None
    s: float
    s1: float
    s2: float
    unit: str = ""
    span: float = np.nan


@dataclass(frozen=True)
class JointErrors(Errors):
    """Errors of the plant's first output, NaN where no record holds it, and the errors of each output.

    joint_nrmse: root of the mean square, over the outputs, of rmse over span.
    """

    joint_nrmse: float = np.nan
    outputs: Mapping[str, Errors] = field(default_factory=dict)


@dataclass(frozen=True)
class ParameterEstimate:
    """Hold one parameter, SI.

    low, high: ends of its 95 % interval, None without one. bound_low, bound_high: of the search, None if it is fixed.
    interval_doubt: why the interval does not hold, or "". interval_by: "sensitivities" or "bootstrap", which
    gives the bias too.
    """

    value: float
    unit: str
    low: float | None = None
    high: float | None = None
    bound_low: float | None = None
    bound_high: float | None = None
    bound_active: bool = False
    interval_holds: bool = False
    interval_doubt: str = ""
    interval_by: str = ""
    bias: float | None = None

    @property
    def doubt(self) -> str:
        """Why the interval does not hold, or ""."""
        return self.interval_doubt


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Result):
    """The result of one run; it prints itself, and has a table, figures and files.

    candidate: whole, SI, in the order of the model's parameters. information: of the free ones. train, holdout: errors
    (None without such records). trace: evaluations and best fitness at each improvement. improved: the free parameters
    at each improvement, SI, (n_improvements, n_free). issues: of the data checks.
    scatter: of the draws of a bootstrap, where these give the intervals; None where least squares does.
    """

    kind: ClassVar[Kind] = IDENTIFICATION
    campaign: Campaign
    model: Model
    space: Space
    fitness: Fitness
    identifier: str
    candidate: Array
    value: float
    information: Information
    train: JointErrors
    holdout: JointErrors | None
    trace: tuple[NDArray[np.int64], Array]
    train_replays: tuple[Replay, ...]
    holdout_replays: tuple[Replay, ...]
    budget: int
    used: int
    n_failed: int
    seed: int
    stopped: str
    improved: Array
    issues: tuple[DataIssue, ...] = ()
    scatter: Scatter | None = None

    @cached_property
    def parameters(self) -> dict[str, ParameterEstimate]:
        """Name -> value, 95 % interval and what stands against it, SI: `identification.parameters["p0"].low`."""
        return {name: self._estimate(i) for i, name in enumerate(self.space.names)}

    def _estimate(self, i: int) -> ParameterEstimate:
        name, value, space = self.space.names[i], float(self.candidate[i]), self.space
        if not space.free[i]:
            return ParameterEstimate(value, space.units[i])
        k, doubt, scatter = self.information.names.index(name), self.interval_doubts[name], self.scatter
        half = self.uncertainty.half_width[k]
        low, high = (value - half, value + half) if scatter is None else (scatter.low[k], scatter.high[k])
        known = bool(np.isfinite([low, high]).all())
        low, high = space.of_one_sign(name, float(low), float(high))
        return ParameterEstimate(
            value, space.units[i], low if known else None, high if known else None, float(space.low[i]),
            float(space.high[i]), bool(self.at_bound[i]), not doubt, doubt,
            "sensitivities" if scatter is None else "bootstrap", None if scatter is None else float(scatter.bias[k]),
        )  # fmt: skip

    @property
    def replays(self) -> tuple[Replay, ...]:
        """All records ready to be simulated, those that were fitted first."""
        return (*self.train_replays, *self.holdout_replays)

    @cached_property
    def outputs(self) -> dict[str, dict[str, Any]]:
        """Output -> its unit, the noise of its records, and how far noise of their inputs moves the model."""
        return entries_of_noise(
            self.replays, [known_level(r) for r in self.replays], self.candidate, self.holdout_replays
        )

    @cached_property
    def interval_doubts(self) -> dict[str, str]:
        """Free parameter -> why its interval does not hold, "" where it does."""
        information, held = self.information, [self.space.names[i] for i in np.flatnonzero(self.at_bound)]
        if self.scatter is not None and self.scatter.doubt:
            return dict.fromkeys(information.names, self.scatter.doubt)
        if self.is_far_from_minimum:
            return dict.fromkeys(information.names, "the search has not come to the minimum")
        if any(level.from_residual for level in information.levels):
            return dict.fromkeys(information.names, "what the model leaves is more than the noise")
        doubts = dict.fromkeys(information.names, "")
        if self.scatter is not None:
            doubts |= dict.fromkeys(
                self.widened_by_inputs, "noise of the inputs moves it by more than noise of sensors"
            )
            shares = zip(information.names, self.scatter.bias / information.deviation, strict=True)
            doubts |= {name: f"its estimate is biased by {share:.2g} standard deviations"
                       for name, share in shares if abs(share) > BIASED}  # fmt: skip
        doubts |= dict.fromkeys(held, "it rests at its bound")
        for pair in (pair[:2] for pair in collinear(self.uncertainty)):
            for name, other in (pair, pair[::-1]):
                if other in held and not doubts[name]:
                    doubts[name] = f"it is correlated with {other}, which rests at its bound"
        return doubts

    @cached_property
    def by_inputs(self) -> Array:
        """Covariance of the estimate by noise of the inputs, SI, (n_free, n_free)."""
        return covariance_by_inputs(self.train_replays, self.space, self.candidate[self.space.free])

    @cached_property
    def uncertainty(self) -> Information:
        """The information with noise of the inputs; a bootstrap draws noise of the sensors alone."""
        if self.scatter is not None or not self.by_inputs.any():
            return self.information
        return self.information.widened(self.by_inputs)

    @property
    def widened_by_inputs(self) -> tuple[str, ...]:
        """Free parameters that noise of the inputs moves by more than noise of the sensors does."""
        more = np.sqrt(np.diag(self.by_inputs)) > self.information.deviation
        return tuple(name for name, wider in zip(self.information.names, more, strict=True) if wider)

    @property
    def is_far_from_minimum(self) -> bool:
        """Whether a step from the estimate would move some parameter far, or take away most of what is left."""
        if self.scatter is not None:
            return self.scatter.is_far
        moved = np.nan_to_num(np.abs(self.information.step)).max(initial=0.0)
        return bool(moved > FAR_FROM_MINIMUM or self.information.gain > MOST_GAIN)

    @property
    def table(self) -> "DataFrame":
        """Parameters as people read them; `low` and `high` are numbers in the unit of the value."""
        parameters = self.parameters.values()
        with angles_in(self.campaign.angle):
            scales = [scale_of(p.unit, p.value)[1] for p in parameters]
        # None becomes NaN
        ends = {end: np.array([getattr(p, end) for p in parameters], float) * scales for end in ("low", "high")}
        return super().table.assign(**ends)

    @property
    def at_bound(self) -> NDArray[np.bool_]:
        """Which of all parameters are free and sit on a bound."""
        mask = self.space.free.copy()
        mask[mask] = held_by_bound(self.space, self.candidate[self.space.free])
        return mask


def identify(
    campaign: Campaign,
    model: Model,
    space: Space,
    fitness: Fitness,
    identifier: Identifier,
    budget: int = 12_000,
    seed: int = 1,
    target: float | None = None,
    accuracy: str | None = None,
    progress: Callable[[Meter | Refined], None] | None = None,
    interval: bool = True,
    threads: int = 1,
) -> Identification:
    """Search the free parameters on the train records, then judge the best candidate on train and holdout.

    Starts of train records in motion are fitted with the parameters, about those of the least-squares estimate. Holdout
    records are simulated once, after the search. After Ctrl-C the best candidate so far is judged, and `stopped` is
    "interrupted". Intervals come from sensitivities for a sum of squares, from a bootstrap for any other fitness.
    Arguments are those of `armid.identify`. Raises ArmidError for a negative seed,
    a budget too large, a target that is not finite, a fitness that the identifier cannot minimise, and when every
    candidate diverged.
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ArmidError(f"the seed is {seed!r}, a whole number of at least 0 is expected")
    if target is not None and isinstance(target, int | float) and np.isinf(target):
        raise ArmidError(f"the target is {target}, a finite fitness is expected")
    identifier.refuse(fitness)
    # a bad budget or target, and bad options, are refused before anything is calibrated
    identifier.build(Meter(budget, target).budget)
    train = with_fitted_starts(replays(campaign.train, model, space, accuracy, threads), space)
    holdout = replays(campaign.holdout, model, space, accuracy, spans=False)
    return identified(campaign, train, holdout, space, fitness, identifier, budget, seed, target, progress, interval)


def identified(
    campaign: Campaign, train: tuple[Replay, ...], holdout: tuple[Replay, ...], space: Space, fitness: Fitness,
    identifier: Identifier, budget: int, seed: int, target: float | None = None,
    progress: Callable[[Any], None] | None = None, interval: bool = False,
) -> Identification:  # fmt: skip
    """Identify from records that are ready to be simulated, all of one model; arguments and errors as `identify`."""
    meter, seen, model = Meter(budget, target), judged_by(fitness, train), train[0].model
    if space.free.any():
        stopped = search(IdentificationProblem(space, train, fitness, meter), meter, identifier, seed, progress)
        if meter.best_x is None:
            why = "each diverged, or the fitness was no finite number"
            none = f"identifier '{identifier.name}' asked for no candidate, at least one is expected"
            raise ArmidError(f"none of {meter.used} candidates has a fitness: {why}" if meter.used else none)
        # what rounding alone keeps off a bound is held by it
        low, high = space.low[space.free], space.high[space.free]
        left = np.flatnonzero(np.maximum(low - meter.best_x, meter.best_x - high) > OUT_OF_BOX * (high - low))
        if left.size:
            i, (name, value) = left[0], (space.free_names[left[0]], meter.best_x[left[0]])
            raise ArmidError(f"identifier '{identifier.name}' leaves the box: its best candidate has {name} = "
                             f"{value:.6g}, {low[i]:.6g} to {high[i]:.6g} is expected")  # fmt: skip
        x = np.where(meter.best_x - low < ON_BOUND * (high - low), low, meter.best_x)
        x, value = np.where(high - x < ON_BOUND * (high - low), high, x), meter.best_f
    else:
        stopped, x = "no parameter is free", np.empty(0)
        signals, measured = signals_of(seen, space.complete(x[np.newaxis])), [r.measured for r in seen]
        value = float(fitness_of(fitness, seen, measured, signals, weights_of(fitness, seen), output_sizes(seen))[0])
    candidate = space.complete(x[np.newaxis])[0]
    holdout = with_starts(holdout, candidate)
    information, scatter = judged(fitness, seen, space, x, seed, progress, interval and stopped != WAS_INTERRUPTED)
    trace = meter.trace()
    return Identification(
        campaign, model, space, fitness, identifier.name, candidate, value, information,
        campaign_errors(train, candidate), campaign_errors(holdout, candidate) if holdout else None,
        (trace.evaluation, trace.value), train, holdout,
        meter.budget, meter.used, meter.n_failed, int(seed), stopped, meter.log().X[trace.evaluation - 1],
        scatter=scatter,
    )  # fmt: skip


def judged(
    fitness: Fitness, replays: tuple[Replay, ...], space: Space, x: Array, seed: int,
    progress: Callable[[Any], None] | None, interval: bool,
) -> tuple[Information, Scatter | None]:  # fmt: skip
    """Return covariance and noise at the estimate of a fitness, and the scatter of a bootstrap where it gives them.

    Whether a record holds more than noise is judged at the least-squares estimate near by: the residual of another
    estimate may be smooth without anything that the model lacks. Where both are further apart than they scatter, the
    search has ended in a local minimum: no interval holds.
    """
    if fitness.weigh is not None:
        weights = residual_weights(fitness, replays, output_sizes(replays))
        information = information_at(replays, space, x, weights=weights)
        return information, None if interval else without(x, NOT_ASKED)
    if not interval or not len(x):
        return information_at(replays, space, x), without(x, NOT_ASKED)
    least = refine(replays, space, x)
    information = information_at(replays, space, x, tuple(level_of(r, space, least) for r in replays))
    with ctrl_c_waits() as interrupted:

        def is_over(refined: Refined) -> bool:
            if progress is not None:
                progress(refined)
            return interrupted()

        scatter = bootstrap(fitness, replays, space, x, information, seed, is_over)
    if len(scatter.draws) > 1:
        deviation = scatter.draws.std(axis=0, ddof=1)
        both = np.hypot(deviation, information.deviation)
        apart = float(np.max(np.abs(x - scatter.bias - least) / both))
        if apart > APART_IN_DEVIATIONS and not scatter.doubt:
            doubt = f"it lies {apart:.3g} standard deviations from the least-squares estimate, as a local minimum does"
            scatter = replace(scatter, doubt=doubt)
        information = replace(information, deviation=deviation, step=scatter.moved,
                              correlation=np.atleast_2d(np.corrcoef(scatter.draws.T)))  # fmt: skip
    return information, scatter


def search(
    problem: IdentificationProblem,
    meter: Meter,
    identifier: Identifier,
    seed: int,
    progress: Callable[[Meter], None] | None,
) -> str:
    """Run the identifier until the meter, the user or it itself stops it; say which."""
    algorithm = identifier.build(meter.budget)
    with ctrl_c_waits() as interrupted:

        def is_over() -> bool:
            if progress is not None:
                progress(meter)
            return interrupted() or meter.reached or meter.exhausted

        try:
            run(algorithm, problem, seed, is_over)
        except BudgetIgnoredError:
            if meter.best_x is None:
                raise
            return f"{identifier.name} went on after its budget and was stopped"
        except (KeyboardInterrupt, SystemError) as error:
            # also where compiled code has wrapped it
            is_interrupt = isinstance(error, KeyboardInterrupt) or isinstance(error.__cause__, KeyboardInterrupt)
            if meter.best_x is None or not is_interrupt:
                raise
            return WAS_INTERRUPTED
    if meter.reached:
        return "target reached"
    if interrupted():
        return WAS_INTERRUPTED
    if meter.exhausted:
        return "budget used" if meter.target is None else "budget used, target not reached"
    return f"{identifier.name} stopped by itself"


def versions_of(packages: Sequence[str]) -> dict[str, str]:
    return {"python": platform.python_version(), **{p: version(p) for p in packages}}


def record_errors(replay: Replay, candidate: Array) -> Errors:
    simulated = replay.signal(candidate[np.newaxis])
    measured = replay.zeroed(simulated[0])
    square = float(mean_square(measured, simulated)[0])
    noise, interval = replay.record.noise.rms, replay.record.spacing
    s, s1, s2 = (float(v[0]) for v in similarity(measured, simulated, interval, noise=noise))
    chi2 = float(chi_square(measured, simulated, noise)[0]) / len(measured) if not replay.record.is_noise_free else None
    if s2 < SHAPE_FALLS and s1 > NUMBERS_AGREE and chi2 is not None and chi2 < MISFIT:
        s = s2 = np.nan
    nrmse = np.sqrt(square / float(np.mean(measured**2)))
    return Errors(np.sqrt(square), nrmse, chi2, s, s1, s2, replay.record.unit, float(np.ptp(measured)))


def campaign_errors(replays: Sequence[Replay], candidate: Array) -> JointErrors:
    plant = replays[0].model.plant
    groups = by_output(replays, replays)
    outputs = {plant.outputs[place].name: output_errors(group, candidate) for place, group in groups.items()}
    joint = float(np.sqrt(np.mean([(e.rmse / e.span) ** 2 for e in outputs.values()])))
    absent = Errors(np.nan, np.nan, None, np.nan, np.nan, np.nan, plant.outputs[0].unit)
    return JointErrors(**vars(outputs.get(plant.outputs[0].name, absent)), joint_nrmse=joint, outputs=outputs)


def output_errors(replays: Sequence[Replay], candidate: Array) -> Errors:
    errors = [record_errors(r, candidate) for r in replays]
    n = np.array([r.record.n_samples for r in replays], dtype=float)
    duration = np.array([r.record.duration for r in replays])

    def pooled(values: list[float], weights: Array) -> float:
        known = ~np.isnan(values)
        return float(np.sum(np.array(values)[known] * weights[known]) / weights[known].sum()) if known.any() else np.nan

    chi2 = [e.chi2_per_sample for e in errors if e.chi2_per_sample is not None]
    return Errors(
        rmse=float(np.sqrt(pooled([e.rmse**2 for e in errors], n))),
        nrmse=float(np.sqrt(pooled([e.nrmse**2 for e in errors], n))),
        chi2_per_sample=pooled(chi2, n) if len(chi2) == len(errors) else None,
        **{name: pooled([getattr(e, name) for e in errors], duration) for name in ("s", "s1", "s2")},
        unit=errors[0].unit,
        span=float(np.ptp(np.concatenate([r.measured for r in replays]))),
    )


def entries_of_noise(
    replays: Sequence[Replay], levels: Sequence[Level | NoiseModel], candidate: Array, unseen: Sequence[Replay]
) -> dict[str, dict[str, Any]]:  # fmt: skip
    """Return what is known of the noise of each output, for JSON.

    Its unit, its noise (the mean over records) and in words what is special about it, how far noise of inputs moves it
    on records that were fitted and on the unseen ones. levels: of each replay.
    """
    outputs, fitted = replays[0].model.plant.outputs, [r for r in replays if r not in unseen]
    noise = pooled_noise([ready.record for ready in by_record([*fitted, *unseen])])
    moved, moved_unseen = (moved_by_inputs(some, candidate, noise) for some in (fitted, unseen))
    return {outputs[place].name: {
        "unit": outputs[place].unit, "noise_rms": float(np.mean([level.rms for level in of])),
        "moved_by_inputs": moved.get(outputs[place].name, 0.0),
        "moved_by_inputs_holdout": moved_unseen.get(outputs[place].name, 0.0) if unseen else None,
        "noise_in_motion": next((level.remark for level in of if level.remark), ""),
    } for place, of in by_output(replays, levels).items()}  # fmt: skip


def errors_by_file(replays: Sequence[Replay], candidate: Array) -> dict[str, JointErrors]:
    files = dict.fromkeys(r.record.file for r in replays)
    return {file: campaign_errors([r for r in replays if r.record.file == file], candidate) for file in files}


@contextmanager
def ctrl_c_waits() -> Iterator[Callable[[], bool]]:
    """Hold Ctrl-C back and yield a function that says whether it came; a second one interrupts at once.

    Raised inside a compiled function it would come out as a SystemError, or not at all. Only the main thread gets it;
    a process that ignores it goes on ignoring it, and holds back SIGTERM where a command has given that a meaning.
    """
    came: list[int] = []
    asked = signal.SIGTERM if signal.getsignal(signal.SIGINT) is signal.SIG_IGN else signal.SIGINT
    before = signal.getsignal(asked) or signal.default_int_handler
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield lambda: False
        return

    def first(number: int, _: object) -> None:
        came.append(number)
        signal.signal(asked, before)

    signal.signal(asked, first)
    try:
        yield lambda: bool(came)
    finally:
        signal.signal(asked, before)
