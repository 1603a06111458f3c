"""Bootstrap interval of a median."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
RESAMPLES = 2000
# Numbers that a batch of resamples may hold at once.
BATCH_NUMBERS = 4_000_000


def median_interval(values: ArrayLike, confidence: float = 0.95, seed: int = 0) -> tuple[float, float]:
    """Return the percentile bootstrap interval of the median of a sample, 2000 resamples.

    values: (n,), infinite ones allowed; seed: of the resampling, so that the same sample gives the same interval.
    A sample of fewer than two gives NaN. Source: Efron and Tibshirani, An Introduction to the Bootstrap (1993), ch. 13.
    """
    sample = np.sort(np.asarray(values, np.float64))
    if sample.size < 2:
        return np.nan, np.nan
    if np.isfinite(sample).all():
        return interval(sample, confidence, seed)
    # Ranks instead of values: the bootstrap subtracts, and infinity minus infinity is no number.
    low, high = interval(np.arange(sample.size, dtype=np.float64), confidence, seed)
    return at_rank(sample, low), at_rank(sample, high)


def interval(sample: Array, confidence: float, seed: int) -> tuple[float, float]:
    """Return the interval of a finite sample."""
    from scipy.stats import bootstrap  # noqa: PLC0415 - takes time to import

    found = bootstrap(
        (sample,), np.median, n_resamples=RESAMPLES, batch=max(1, BATCH_NUMBERS // sample.size),
        confidence_level=confidence, method="percentile", rng=np.random.default_rng(seed),
    ).confidence_interval  # fmt: skip
    return float(found.low), float(found.high)


def at_rank(ordered: Array, rank: float) -> float:
    """Return the value at a rank of an ordered sample, between two values their mean."""
    return float((ordered[int(np.floor(rank))] + ordered[int(np.ceil(rank))]) / 2.0)
