"""How often all parameters end within a tolerance of the truth."""

from collections.abc import Sequence

import numpy as np
from pandas import DataFrame

TOLERANCES = (1e-2, 1e-3, 1e-4)


def success_rates(found: DataFrame, tolerances: Sequence[float] = TOLERANCES) -> DataFrame:
    """Return, per setting, variant and tolerance: runs, successes, rate and its 95 % Wilson interval.

    A run succeeds when the largest relative error of its result is at the tolerance or below; a failed run does not.
    found: outcomes of runs; tolerances: relative errors, 1. Source: Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """
    known = found.dropna(subset=["largest_error"])
    rows = []
    for (setting, variant), group in known.groupby(["setting", "variant"], sort=False):
        errors = group["largest_error"].to_numpy()
        for tolerance in tolerances:
            successes = int(np.count_nonzero(errors <= tolerance))
            low, high = wilson(successes, errors.size)
            rows.append((setting, variant, tolerance, errors.size, successes, successes / errors.size, low, high))
    return DataFrame(rows, columns=["setting", "variant", "tolerance", "n", "successes", "rate", "low", "high"])


def wilson(successes: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the Wilson interval of a proportion."""
    from statsmodels.stats.proportion import proportion_confint  # noqa: PLC0415 - takes time to import

    low, high = proportion_confint(successes, n, alpha=1.0 - confidence, method="wilson")
    return float(low), float(high)
