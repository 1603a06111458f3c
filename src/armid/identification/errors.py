"""How far a candidate is from records: the same figures for train and holdout."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armid.fitness import chi_square, mean_square, similarity
from armid.problem import Replay

Array = NDArray[np.float64]


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
