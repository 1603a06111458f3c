"""How the scatter of an estimate compares with the Cramer-Rao bound."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pandas import DataFrame

Array = NDArray[np.float64]
# A standard deviation within these is what an efficient estimate has.
EFFICIENT = (0.9, 1.1)
# Fewer noise realisations say too little about a standard deviation: its interval is +-30 % wide.
LEAST_REALISATIONS = 20
# Half the distance between the quartiles of a normal distribution, in standard deviations.
QUARTILE = 0.674489750196


class Efficiency(NamedTuple):
    """Scatter and bias over the bound.

    n: noise realisations; bound: Cramer-Rao standard deviation, SI; ratio: sample standard deviation over bound, with
    the 95 % interval low to high; robust: from the quartiles; bias: (mean - truth) over bound, with the half width of
    its 95 % interval.
    """

    n: int
    bound: float
    ratio: float
    low: float
    high: float
    robust: float
    bias: float
    bias_half_width: float


def efficiency(values: ArrayLike, truth: float, bound: float) -> Efficiency:
    """Compare estimates under as many noise realisations with the truth and the Cramer-Rao bound.

    ratio = s/sigma with s^2 = sum (x - mean)^2/(n - 1); its interval from the chi-square distribution of
    (n - 1) s^2/sigma^2, exact for normal estimates. values: SI, (n,), n of at least 2; bound: SI.
    Source: Kay, Fundamentals of Statistical Signal Processing I (1993), ch. 3.
    """
    from scipy.stats import chi2, t  # noqa: PLC0415 - takes time to import

    x = np.asarray(values, np.float64)
    free = x.size - 1
    s = x.std(ddof=1)
    low, high = np.sqrt(free / chi2.ppf([0.975, 0.025], free))
    quartiles = np.quantile(x, [0.25, 0.75])
    half_width = t.ppf(0.975, free) * s / np.sqrt(x.size)
    return Efficiency(
        x.size, bound, s / bound, s / bound * low, s / bound * high,
        (quartiles[1] - quartiles[0]) / (2.0 * QUARTILE) / bound,
        (x.mean() - truth) / bound, half_width / bound,
    )  # fmt: skip


def efficiencies(estimates: DataFrame) -> DataFrame:
    """Return the efficiency per setting, variant, case and parameter, of those with enough noise realisations.

    The bound is the median over the runs of the bound at the solution. estimates: one row a run and parameter with a
    known truth and a finite bound.
    """
    usable = estimates[np.isfinite(estimates["deviation"]) & (estimates["deviation"] > 0) & estimates["truth"].notna()]
    keys = ["setting", "variant", "case", "parameter"]
    rows = []
    for key, group in usable.groupby(keys, sort=False):
        if len(group) >= LEAST_REALISATIONS:
            bound, truth = float(group["deviation"].median()), float(group["truth"].iloc[0])
            rows.append((*key, *efficiency(group["value"], truth, bound), int(group["at_bound"].sum())))
    return DataFrame(rows, columns=[*keys, *Efficiency._fields, "n_at_bound"])
