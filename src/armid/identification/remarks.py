"""What a reader must know of an identification, one sentence each."""

import numpy as np

from armid.identifiability import MISFIT, collinear
from armid.identification.errors import record_errors
from armid.identification.identify import Identification
from armid.identification.words import SHOWN, shown
from armid.problem import Replay

# S2 below the first with S1 above the second: landmarks that do not match, not signals that differ.
SHAPE_FALLS, NUMBERS_AGREE = 0.9, 0.95
# A least-squares step of more standard deviations than this: a search by another fitness ends within a few.
FAR_FROM_MINIMUM = 4.0
# A mean square on held-out records of more times that on the fitted ones than this.
CARRIES_OVER = 1.5
# More records than this are told of together.
MOST_NAMED = 6


def remarks(found: Identification) -> list[str]:
    """Return what a reader must know, one sentence each."""
    said = [bound_remark(found, int(i)) for i in np.flatnonzero(found.at_bound)] + convergence_remarks(found)
    for a, b, r in collinear(found.information):
        said.append(f"{a} and {b} can hardly be told apart on these records (correlation {r:+.3f}): "
                    "a change of one is made up for by the other.")  # fmt: skip
    lost = [n for n, d in zip(found.information.names, found.information.deviation, strict=True) if not np.isfinite(d)]
    said += [f"{name} is not determined by these records." for name in lost]
    if found.n_failed:
        said.append(f"{found.n_failed} of {found.used} candidates diverged and were given a penalty.")
    return said + shape_remarks(found) + engine_remarks(found) + noise_remarks(found)


def shape_remarks(found: Identification) -> list[str]:
    """Return a sentence for each record on which S2 falls though the residual is no more than noise.

    S2 pairs few intervals between landmarks; one landmark that is only noise, near an end, can unpair them all.
    """
    said = []
    for replay in (*found.train_replays, *found.holdout_replays):
        e = record_errors(replay, found.candidate)
        only_noise = e.chi2_per_sample is not None and e.chi2_per_sample < MISFIT
        if e.s2 < SHAPE_FALLS and e.s1 > NUMBERS_AGREE and only_noise:
            said.append(f"{replay.record.file}: S2 is {e.s2:.3f} though S1 is {e.s1:.3f}: the shape similarity pairs "
                        "a few intervals by order, and a landmark of noise unpairs them; look at S1 and RMSE.")
    return said


def engine_remarks(found: Identification) -> list[str]:
    """Return a sentence for each record on which the engine is less accurate than it promises."""
    name, factor = SHOWN[found.campaign.unit]
    return [
        f"{r.record.file}: the engine is off by up to {factor * r.engine_error:.2g} {name} even at its "
        "finest steps: the equations are stiff there, or switch somewhere without a guard."
        for r in (*found.train_replays, *found.holdout_replays) if not all(c.reached for c in r.calibrations)
    ]  # fmt: skip


def bound_remark(found: Identification, i: int) -> str:
    """Return the sentence for a parameter at its bound."""
    name, value = found.space.names[i], found.candidate[i]
    null = found.model.parameters[name].null
    margin = 1e-3 * (found.space.high[i] - found.space.low[i])
    if null is not None and abs(value - null) <= margin:
        return f"{name} sits at its null value: no such effect is seen on these records by this search."
    return (f"{name} sits on its bound: the search was held there, so neither it nor its interval, nor what is "
            "correlated with it, can be trusted.")  # fmt: skip


def convergence_remarks(found: Identification) -> list[str]:
    """Return what is to be said of a search that has not come to the minimum, or of one that does not carry over."""
    said = []
    steps = np.abs(np.nan_to_num(found.information.step))
    if len(steps) and steps.max() > FAR_FROM_MINIMUM:
        name = found.information.names[int(np.argmax(steps))]
        said.append(f"The search has not come to the least-squares minimum: a step from here would move {name} by "
                    f"{steps.max():.3g} of its standard deviations, so the intervals do not hold; a larger budget, "
                    "another seed, fitness rmse or --option velocity_limit=0.2 may get there.")  # fmt: skip
    train, holdout = found.train.chi2_per_sample, None if found.holdout is None else found.holdout.chi2_per_sample
    if train is not None and holdout is not None and holdout > CARRIES_OVER * max(train, 1.0):
        said.append(f"The fit does not carry over: its mean square is {holdout:.3g} times that of the noise on the "
                    f"held-out records, {train:.3g} times on those fitted.")  # fmt: skip
    return said


def noise_remarks(found: Identification) -> list[str]:
    """Return what is to be said of the noise, its mean at rest, and a residual far above it."""
    replays, unit = found.train_replays, found.campaign.unit
    named = [r for r in replays if len(replays) <= MOST_NAMED]
    said = [noise_remark(r, unit) for r in named]
    if not named:
        values = [shown(r.record.noise.rms, unit)[0] for r in replays]
        said.append(f"{len(replays)} records: noise {min(values):.3g} to {max(values):.3g} {SHOWN[unit][0]} rms.")
    pairs = zip(replays, found.information.levels, strict=True)
    above = [(r.record, level.rms) for r, level in pairs if level.from_residual]
    searched = bool(found.space.free.any())
    said += [misfit_remark(record.file, rms, record.noise.rms, searched) for record, rms in above[:MOST_NAMED]]
    if len(above) > MOST_NAMED:
        said.append(f"So it is with {len(above) - MOST_NAMED} more records.")
    return said


def noise_remark(replay: Replay, unit: str) -> str:
    """Return the noise of one record in words."""
    noise = replay.record.noise
    value, name = shown(noise.rms, unit)
    text = f"{replay.record.file}: noise {value:.3g} {name} rms"
    if noise.source == "rest":
        mean = shown(noise.mean or 0.0, unit)[0]
        return f"{text} and mean {mean:+.3g} {name} (shown, not subtracted) from {noise.n_samples} samples at rest."
    return f"{text} from high-frequency differences of the motion, as fewer than 50 samples were recorded at rest."


def misfit_remark(file: str, rms: float, noise: float, searched: bool) -> str:
    """Return the sentence for a record whose residual is far above its noise; searched: some parameter was free."""
    times = rms / noise if noise else np.inf
    if not searched:
        return (f"{file}: the residual is {times:.3g} times the noise: the model, in which nothing is free, lacks "
                "something.")  # fmt: skip
    return (f"{file}: the residual is {times:.3g} times the noise: the model lacks something, or the search has not "
            "come to the minimum; the intervals are widened to the residual and its correlation in time, and hold only "
            "as far as what is lacking averages out.")  # fmt: skip
