"""Which fitness gives right parameters, and whether a high similarity says so."""

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame


def fitness_quality(found: DataFrame) -> DataFrame:
    """Return, per setting, fitness and identifier: runs, errors, the similarity reached, and how the two go together.

    median_error, worst_error: of the largest relative error of a run; median_misfit: median of 1 - S on the train
    records; correlation: Spearman's rank correlation over the runs between 1 - S and the largest error, 1 when a
    higher similarity always means better parameters (NaN for fewer than 3 runs or a constant).
    """
    rows = []
    for key, group in found.groupby(["setting", "fitness", "identifier"], sort=False):
        misfit = 1.0 - group["train_s"].to_numpy(float)
        errors = group["largest_error"].to_numpy(float)
        known = misfit[~np.isnan(misfit)]
        middle = np.median(errors), np.max(errors), np.median(known) if known.size else np.nan
        rows.append((*key, len(group), *middle, rank_correlation(misfit, errors)))
    columns = ["setting", "fitness", "identifier", "n", "median_error", "worst_error", "median_misfit", "correlation"]
    return DataFrame(rows, columns=columns)


def rank_correlation(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Return Spearman's correlation of two samples where both are finite."""
    from scipy.stats import spearmanr  # noqa: PLC0415 - takes time to import

    both = np.isfinite(first) & np.isfinite(second)
    x, y = first[both], second[both]
    if x.size < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return np.nan
    return float(spearmanr(x, y).statistic)
