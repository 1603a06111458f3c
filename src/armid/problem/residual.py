"""The weighted residual vector of candidates: what least squares works on."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armid.problem.replay import Replay
from armid.problem.space import Space

Array = NDArray[np.float64]


def residuals(replays: Sequence[Replay], space: Space, X: ArrayLike, weights: ArrayLike) -> Array:
    """Return w_i (x' - x) over all samples of all records, (n_candidates, n_total); NaN in a row that diverged.

    replays: n_records of them; X: free parameters, SI, (n_candidates, n_free) or (n_free,).
    weights: of the records, (n_records,), such as 1/noise [1/signal's unit].
    """
    candidates = space.complete(np.atleast_2d(np.asarray(X, dtype=np.float64)))
    signals = [replay.signal(candidates) for replay in replays]
    return weighted(signals, [replay.measured for replay in replays], weights)


def weighted(signals: Sequence[Array], measured: Sequence[Array], weights: ArrayLike) -> Array:
    """Return w_i (x' - x), end to end: signals (n_candidates, n_samples) and measured (n_samples,) of each record."""
    pairs = zip(signals, measured, np.asarray(weights, dtype=np.float64), strict=True)
    return np.concatenate([weight * (signal - x) for signal, x, weight in pairs], axis=1)
