"""Mean and spread of repeated identifications."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


class Spread(NamedTuple):
    """Number, mean and population standard deviation of a sample."""

    n: int
    mean: float
    deviation: float


def spread(values: ArrayLike) -> Spread:
    """Return n, mean and population standard deviation sqrt(mean (x - mean)^2), which is what the paper's Table II
    prints as "mean square error"; NaN for an empty sample.

    values: (n,).
    """
    sample = np.asarray(values, np.float64)
    if not sample.size:
        return Spread(0, np.nan, np.nan)
    return Spread(sample.size, float(sample.mean()), float(sample.std(ddof=0)))
