"""Where a published error falls among ours."""

import numpy as np
from numpy.typing import ArrayLike


def percentile_among(errors: ArrayLike, published: float) -> float:
    """Return the percentage of errors below a published one, equal ones by half; NaN for an empty sample.

    10 says that one in ten of our runs was better than the published result. errors: (n,), infinite ones allowed.
    """
    from scipy.stats import percentileofscore  # noqa: PLC0415 - takes time to import

    sample = np.asarray(errors, np.float64)
    return float(percentileofscore(sample, published, kind="mean")) if sample.size else np.nan
