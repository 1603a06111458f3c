"""Choose how finely time is cut, from the error measured on a spread of candidates."""

from bisect import bisect_left
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armid.engine.generate import LONGEST_SPAN
from armid.engine.simulate import Schedule, Simulation, simulate, stages_as_stable_as
from armid.errors import ArmidError
from armid.model import Array, Manoeuvre, Model, Plant

STANDARD, FINE = "standard", "fine"
# Errors of the recorded signals that are allowed, as shares of their sizes (arm: 2 rad/s).
ALLOWED = {STANDARD: 5e-6, FINE: 1e-7}
# What steps over several samples may change: for good (all of them together, shares of the speed scale; one step does a
# hundredth of it, which no derivative sees), and between their ends (shares of the allowed error).
LASTING, PASSING = 1.5e-8, 0.1
SUBSTEPS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
MARGIN_OF_STEPS = 0.5
# From so many steps between samples on it is tried whether rough samples alone ask for them, and which these are: those
# in which a step is uncertain by such a share of the range of a state.
FEWEST_SPARED, SHARES_OF_ERROR = 4, (1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
# Below this many times the engine's standard error the noise no longer hides that error.
NOISE_HIDES = 10.0
# How many candidates must not have switched yet for a long step to count as tried.
N_UNSWITCHED = 8
N_PROBES = 48
# Values of a simulation of all candidates that are in memory at a time (64 MB); more are tried in parts of so many.
MOST_OF_PROBES, PART = 2**23, 8


@dataclass(frozen=True)
class Calibration:
    """A schedule and the error that was measured for it on the probes, of all outputs the largest share of its size."""

    schedule: Schedule
    error: float
    reached: bool

    @property
    def fineness(self) -> tuple[int, float]:
        """What orders schedules of one piece: steps in a sample, then how rough a sample may be without them."""
        rough = self.schedule.rough
        return self.schedule.substeps, 0.0 if rough is None else -float(np.min(rough))


def accuracy_against(noise: Mapping[str, float], model: Model) -> str:
    """Return "fine" where noise (output -> rms) would not hide the standard error of an output, else "standard"."""
    hidden = all(rms >= hiding_noise(model.plant, name, STANDARD) for name, rms in noise.items())
    return STANDARD if hidden else FINE


def hiding_noise(plant: Plant, output: str, accuracy: str) -> float:
    """Return the rms of the noise of an output, "" for the first, that hides the engine's error at an accuracy."""
    sizes = {"": plant.sizes[0]} | {o.name: size for o, size in zip(plant.outputs, plant.sizes, strict=True)}
    return NOISE_HIDES * ALLOWED[accuracy] * sizes[output]


def probes(low: Array, high: Array, n_probes: int = N_PROBES) -> Array:
    """Return candidates spread evenly between bounds (Kronecker sequence).

    x_i = frac(i a), a_j = g**-j with g the root of g**(d + 1) = g + 1. Source: Roberts 2018, generalised golden ratio.

    Parameters
    ----------
    low, high : array, SI, (n_parameters,)
        The bounds.
    n_probes : int
        How many.

    Returns
    -------
    array, SI, (n_probes, n_parameters)
    """
    return low + (high - low) * ((np.arange(1, n_probes + 1)[:, np.newaxis] * golden_steps(len(low))) % 1.0)


def golden_steps(n: int) -> Array:
    """Return the steps a_j of the Kronecker sequence of `probes` in n dimensions, shape (n,)."""
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (n + 1))
    return np.asarray(ratio ** -np.arange(1.0, n + 1.0))


def calibrate(
    model: Model, manoeuvre: Manoeuvre, candidates: Array, accuracy: str = STANDARD, spans: bool = True
) -> Calibration:
    """Choose the coarsest schedule whose error on the candidates stays within half of what is allowed.

    The error of n steps between samples is estimated from the difference to 2n steps: fourth order, 16/15 of it. Steps
    at which a candidate fails that does not fail with the finest ones are too coarse, whatever the others do.

    Parameters
    ----------
    model, manoeuvre
        What moves, and what it is made to do.
    candidates : (n_candidates, n_parameters), SI
        Usually `probes` of the bounds.
    accuracy : "standard" or "fine"
        5e-6 or 1e-7 of the size of each output (of a speed, the plant's speed scale).
    spans
        Look for steps over several samples too, and for rough ones, which pays when many populations follow.

    Returns
    -------
    Calibration
        The schedule, and the error of the engine with it.

    Raises
    ------
    ArmidError
        For an unknown accuracy.
    """
    if accuracy not in ALLOWED:
        raise ArmidError(f"accuracy '{accuracy}' is unknown: {' or '.join(ALLOWED)} is expected")
    if len(candidates) > PART and len(candidates) * manoeuvre.n_samples > MOST_OF_PROBES:
        return in_parts(model, manoeuvre, candidates, accuracy)
    allowed = ALLOWED[accuracy] * model.plant.sizes[0]
    runs: dict[int, Simulation] = {}

    def run(n: int) -> Simulation:
        return runs.setdefault(n, simulate(model, manoeuvre, candidates, Schedule(n)) if n not in runs else runs[n])

    error = np.inf
    for n in SUBSTEPS:
        error = difference(run(n), run(2 * n), model) * 16 / 15
        if run(n).failed.any():
            failed, finest = run(n).failed, run(SUBSTEPS[-1]).failed
            error = np.inf if (failed & ~finest).any() or finest.all() else error
        if error <= MARGIN_OF_STEPS * allowed:
            break
        if n != SUBSTEPS[-1]:
            del runs[n]
    schedule = Schedule(n, weights=switch_weights(candidates, run(n)))
    if spans:
        schedule = replace(schedule, plan=long_steps(model, manoeuvre, candidates, schedule, run(n), allowed))
    # Where noise does not hide the error it has to change evenly from candidate to candidate.
    if spans and accuracy == STANDARD and schedule.plan is None and error <= allowed:

        def error_of(tried: Simulation, finer: Simulation) -> float:
            return np.inf if (tried.failed & ~finer.failed).any() else difference(tried, finer, model) * 16 / 15

        def is_good(tried: Simulation, finer: Simulation) -> bool:
            return error_of(tried, finer) <= MARGIN_OF_STEPS * allowed

        spared = with_rough_samples(model, manoeuvre, candidates, schedule, is_good)
        if spared is not None:
            return Calibration(spared[0], error_of(*spared[1:]), True)
    return Calibration(schedule, error, bool(error <= allowed))


def with_rough_samples(
    model: Model, manoeuvre: Manoeuvre, candidates: Array, schedule: Schedule,
    is_good: Callable[[Simulation, Simulation], bool],
) -> tuple[Schedule, Simulation, Simulation] | None:  # fmt: skip
    """Return a schedule that cuts rough samples alone as finely as another cuts all; None where that spares nothing.

    Steps may be fine for the sake of a few samples (friction as it changes its sign); where many are rough for the sake
    of stability (friction that holds), one stable step serves. is_good: whether a simulation is accurate enough, from
    one in twice as many steps everywhere; both are returned with the schedule.
    """
    n = schedule.substeps
    if n < FEWEST_SPARED:
        return None
    finer = simulate(model, manoeuvre, candidates, Schedule(2 * n), states=True)
    ranges = np.array([np.max(np.ptp(state, axis=-1)) for state in finer.states.values()])
    for stages, share in product((stages_as_stable_as(n), 0), SHARES_OF_ERROR):
        rough = np.where(ranges > 0.0, share * ranges, np.inf)
        tried = replace(schedule, rough=rough, refinement=max(schedule.refinement, n), stages=stages)
        run = simulate(model, manoeuvre, candidates, tried)
        if run.n_steps < n and is_good(run, finer):
            return tried, run, finer
    return None


def in_parts(model: Model, manoeuvre: Manoeuvre, candidates: Array, accuracy: str) -> Calibration:
    """Return the finest of the calibrations of parts of the candidates: all at once would fill the memory."""
    parts = [candidates[first : first + PART] for first in range(0, len(candidates), PART)]
    calibrations = [calibrate(model, manoeuvre, part, accuracy, spans=False) for part in parts]
    schedule = Schedule(max(c.schedule.substeps for c in calibrations))
    return Calibration(schedule, max(c.error for c in calibrations), all(c.reached for c in calibrations))


def switch_weights(candidates: Array, run: Simulation) -> Array | None:
    if not run.switch_times or len(candidates) < 2 * candidates.shape[1] + 2:
        return None
    times = np.array(next(iter(run.switch_times.values())))
    known = np.isfinite(times)
    if known.sum() < candidates.shape[1] + 2 or np.ptp(times[known]) == 0.0:
        return None
    times[~known] = times[known].max()
    spread = np.where(np.ptp(candidates, axis=0) > 0, np.ptp(candidates, axis=0), 1.0)
    design = np.column_stack([np.ones(len(candidates)), candidates / spread])
    return np.asarray(np.linalg.lstsq(design, times, rcond=None)[0][1:] / spread)


def long_steps(
    model: Model, manoeuvre: Manoeuvre, candidates: Array, schedule: Schedule, run: Simulation, allowed: float
) -> NDArray[np.int64] | None:
    """Return from which sample on a step may span 2, 4 and 8 samples before the switch; None where none may."""
    if not model.latches or model.plant.inputs or manoeuvre.n_samples < 2 * LONGEST_SPAN:
        return None
    if model.delays:
        # a candidate with a dead time takes every sample, whatever the plan says
        candidates = candidates.copy()
        candidates[:, [list(model.parameters).index(name) for name in model.delays]] = 0.0
        run = simulate(model, manoeuvre, candidates, schedule)
    lasting = LASTING * model.plant.scales.speed
    plan = np.ones(manoeuvre.n_samples - 1, dtype=np.int64)
    # The last sample at which enough candidates are still before their first switch.
    switched = (np.min(list(run.switch_times.values()), axis=0) - manoeuvre.start_time) / manoeuvre.interval
    samples = np.where(np.isfinite(switched), switched, manoeuvre.n_samples - 1)
    start, last = 0, int(np.sort(samples)[-min(N_UNSWITCHED, len(samples))])

    def longer(first: int, span: int) -> NDArray[np.int64]:
        return np.where(np.arange(len(plan)) < first, plan, span)

    def holds(first: int, span: int) -> bool:
        tried = simulate(model, manoeuvre, candidates, replace(schedule, plan=longer(first, span)))
        kept = lasting_difference(tried, run, manoeuvre.interval) <= lasting
        return kept and difference(tried, run, model) <= PASSING * allowed

    for span in (2, 4, 8):
        places = range(start + 10 - start % 10, last - span, 10 if start < 200 else 40)
        # the later long steps begin, the less they change
        index = bisect_left(places, True, key=partial(holds, span=span))
        if index == len(places):
            break
        start = places[index]
        plan = longer(start, span)
    return plan if plan.max() > 1 else None


def difference(a: Simulation, b: Simulation, model: Model) -> float:
    good, (x, y) = ~(a.failed | b.failed), (run.joint(model.plant.sizes) for run in (a, b))
    # row by row: of a long record all differences at once would fill the memory
    return max((float(np.max(np.abs(x[i] - y[i]))) for i in np.flatnonzero(good)), default=0.0)


def lasting_difference(a: Simulation, b: Simulation, interval: float) -> float:
    """Return the largest difference of two simulations after the first switch, where long steps have ended."""
    switched = np.min(list(a.switch_times.values()), axis=0)
    good = ~(a.failed | b.failed) & np.isfinite(switched)
    after = np.arange(a.output.shape[1]) * interval > switched[good, None]
    return float(np.max(np.abs(a.output[good] - b.output[good])[after], initial=0.0))
