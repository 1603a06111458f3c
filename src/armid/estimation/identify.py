"""Find the parameters of a model from the train records of a campaign."""

import platform
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray
from pymoo.core.algorithm import Algorithm
from pymoo.optimize import minimize

from armid.errors import ArmidError
from armid.estimation.information import Information, information_at
from armid.estimation.least_squares import (
    held_by_bound,
)
from armid.identifiers import Identifier, can_run_directly, run_directly
from armid.model import Model
from armid.problem.fitness import Fitness, chi_square, mean_square
from armid.problem.meter import Meter, MeterTermination
from armid.problem.problem import IdentificationProblem, Replay, fitness_of, replays, weights_of
from armid.problem.similarity import similarity
from armid.problem.space import Space
from armid.record import Campaign

Array = NDArray[np.float64]


INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class Errors:
    """Hold errors of one candidate on some records.

    rmse: pooled over all samples [rad/s or m/s]; nrmse: each record divided by its rms; chi2_per_sample: mean of
    (residual / noise)^2, None without noise; s, s1, s2: similarity degrees, mean weighted by duration.
    """

    rmse: float
    nrmse: float
    chi2_per_sample: float | None
    s: float
    s1: float
    s2: float


@dataclass(frozen=True, eq=False)
class Identification:
    """Hold the result of one run.

    candidate: whole, SI, in the order of the model's parameters. information: of the free ones. train, holdout: errors
    (None without such records). trace: evaluations and best fitness at each improvement.
    """

    campaign: Campaign
    model: Model
    space: Space
    fitness: Fitness
    identifier: str
    candidate: Array
    value: float
    information: Information
    train: Errors
    holdout: Errors | None
    trace: tuple[NDArray[np.int64], Array]
    train_replays: tuple[Replay, ...]
    holdout_replays: tuple[Replay, ...]
    budget: int
    used: int
    n_failed: int
    seed: int
    stopped: str

    @property
    def at_bound(self) -> NDArray[np.bool_]:
        """Which of all parameters are free and sit on a bound."""
        found = self.space.free.copy()
        found[found] = held_by_bound(self.space, self.candidate[self.space.free])
        return found


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
    progress: Callable[[Meter], None] | None = None,
) -> Identification:
    """Search the free parameters on the train records, then judge the best candidate on train and holdout.

    Holdout records are simulated once, after the search. Ctrl-C ends the search and not the run: the best candidate so
    far is judged, `stopped` is "interrupted".

    Parameters
    ----------
    campaign, model, space
        The records, the model and the box of its parameters.
    fitness, identifier, seed
        What is minimised, by which method, and the seed of its random numbers.
    budget : int
        Simulations; one candidate through all train records counts as one.
    target : float
        Fitness at which to stop (the paper's step 7).
    accuracy : {"standard", "fine"}
        Of the engine; None: as the noise of each record asks for.
    progress : callable
        Called with the meter after each generation.

    Raises
    ------
    ArmidError
        For a negative seed, a fitness that the identifier cannot minimise, and when every candidate diverged.
    """
    if seed < 0:
        raise ArmidError(f"the seed is {seed}, a whole number of at least 0 is expected")
    identifier.refuse(fitness)
    identifier.build(Meter(budget, target).budget)  # refuses bad options before anything is calibrated
    train = replays(campaign.train, model, space, accuracy)
    meter = Meter(budget, target)
    if space.free.any():
        stopped = search(IdentificationProblem(space, train, fitness, meter), meter, identifier, seed, progress)
        if meter.best_x is None:
            raise ArmidError(
                f"none of {meter.used} candidates has a fitness: each diverged, or the fitness was no finite number"
            )
        x = meter.best_x
    else:
        stopped, x = "no parameter is free", np.empty(0)
    candidate = space.complete(x[np.newaxis])[0]
    if len(x):
        value = meter.best_f
    else:  # nobody has asked for its fitness yet
        signals = [r.signal(candidate[np.newaxis]) for r in train]
        value = float(fitness_of(fitness, train, [r.measured for r in train], signals, weights_of(fitness, train))[0])
    holdout = replays(campaign.holdout, model, space, accuracy)
    errors = campaign_errors(train, candidate)
    assert errors is not None
    trace = meter.trace()
    return Identification(
        campaign, model, space, fitness, identifier.name, candidate, value, information_at(train, space, x),
        errors, campaign_errors(holdout, candidate), (trace.evaluation, trace.value), train, holdout,
        budget, meter.used, meter.n_failed, seed, stopped,
    )  # fmt: skip


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
            if can_run_directly(algorithm):
                run_directly(algorithm, problem, seed, is_over)
            else:
                run_by_pymoo(algorithm, problem, meter, seed, is_over)
        except (KeyboardInterrupt, SystemError) as error:
            # also where compiled code has wrapped it
            is_interrupt = isinstance(error, KeyboardInterrupt) or isinstance(error.__cause__, KeyboardInterrupt)
            if meter.best_x is None or not is_interrupt:
                raise
            return INTERRUPTED
    if meter.reached:
        return "target reached"
    if interrupted():
        return INTERRUPTED
    if meter.exhausted:
        return "budget used" if meter.target is None else "budget used, target not reached"
    return f"{identifier.name} stopped by itself"


def run_by_pymoo(
    algorithm: Algorithm, problem: IdentificationProblem, meter: Meter, seed: int, is_over: Callable[[], bool]
) -> None:
    def after_generation(running: Algorithm) -> None:
        if is_over():
            running.termination.terminate()
            running.termination.update(running)

    options = {"seed": seed, "callback": after_generation, "copy_algorithm": False}
    minimize(problem, algorithm, MeterTermination(meter), **options)


def versions_of(packages: Sequence[str]) -> dict[str, str]:
    return {"python": platform.python_version(), **{p: version(p) for p in packages}}


def record_errors(replay: Replay, candidate: Array) -> Errors:
    """Return the errors of one whole candidate on one record, infinite where it diverged."""
    measured, simulated = replay.measured, replay.signal(candidate[np.newaxis])
    square = float(mean_square(measured, simulated)[0])
    s, s1, s2 = (float(v[0]) for v in similarity(measured, simulated, replay.pieces[0].manoeuvre.interval))
    noise = replay.record.noise.rms
    chi2 = float(chi_square(measured, simulated, noise)[0]) / len(measured) if noise > 0.0 else None
    return Errors(np.sqrt(square), np.sqrt(square / float(np.mean(measured**2))), chi2, s, s1, s2)


def campaign_errors(replays: tuple[Replay, ...], candidate: Array) -> Errors | None:
    """Return the joined errors of one whole candidate, None without records."""
    if not replays:
        return None
    each = [record_errors(r, candidate) for r in replays]
    n = np.array([r.record.n_samples for r in replays], dtype=float)
    duration = np.array([r.record.duration for r in replays])

    def pooled(values: list[float], weights: Array) -> float:
        return float(np.sum(np.array(values) * weights) / weights.sum())

    chi2 = [e.chi2_per_sample for e in each if e.chi2_per_sample is not None]
    return Errors(
        rmse=float(np.sqrt(pooled([e.rmse**2 for e in each], n))),
        nrmse=float(np.sqrt(pooled([e.nrmse**2 for e in each], n))),
        chi2_per_sample=pooled(chi2, n) if len(chi2) == len(each) else None,
        s=pooled([e.s for e in each], duration),
        s1=pooled([e.s1 for e in each], duration),
        s2=pooled([e.s2 for e in each], duration),
    )


@contextmanager
def ctrl_c_waits() -> Iterator[Callable[[], bool]]:
    """Hold Ctrl-C back and yield a function that says whether it came; a second one interrupts at once.

    Raised inside a compiled function it would come out as a SystemError, or not at all. Only the main thread gets it.
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    before = signal.getsignal(signal.SIGINT) or signal.default_int_handler

    def first(number: int, _: object) -> None:
        came.append(number)
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, first)
    try:
        yield lambda: bool(came)
    finally:
        signal.signal(signal.SIGINT, before)
