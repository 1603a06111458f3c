"""How far records scatter, and how heavily each of them weighs."""

from collections.abc import Sequence

import numpy as np

from armid.identifiability.information import Array, Level, level_of
from armid.problem.replay import Replay
from armid.problem.space import Space
from armid.record.record import NOISE_FREE

# What is assumed for a record without noise, as a share of its rms speed.
ASSUMED = 1e-3


def levels_of(replays: Sequence[Replay], space: Space, x: Array, noise: float | None = None) -> tuple[Level, ...]:
    """Return the level of each record at a candidate: its noise, or its residual where that is far above the noise.

    Without noise there is nothing to weigh a change against: then white noise of 0.1 % of the record's rms speed is
    assumed, and the level says so. noise: rms [unit of the record] to assume for every record in place of all that.
    x: free parameters, SI, shape (n_free,).
    """
    if noise is not None:
        return tuple(Level(noise, 1.0, assumed=True) for _ in replays)
    return tuple(shown_level(r, level_of(r, space, x)) for r in replays)


def shown_level(replay: Replay, level: Level) -> Level:
    """Return the level, an assumed one where there is neither noise nor residual to speak of."""
    least = NOISE_FREE * float(np.max(np.abs(replay.measured)))
    if not replay.record.is_noise_free or level.rms > least:
        return level
    return Level(ASSUMED * float(np.sqrt(np.mean(replay.measured**2))), 1.0, assumed=True)


def level_weights(levels: Sequence[Level]) -> tuple[float, ...]:
    """Return sqrt(effective fraction)/rms of each level, so that weighted squares sum to chi2 of effective samples."""
    return tuple(float(np.sqrt(level.effective_fraction)) / level.rms for level in levels)
