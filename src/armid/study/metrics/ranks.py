"""Rank tests over cases: Friedman, and Wilcoxon signed-rank for each pair with Holm's correction."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame, Series

from armid.study.metrics.effect_size import a12

Array = NDArray[np.float64]
# Errors of 1e-6 % and below are all as good as exact: what is left is rounding.
FLOOR = 1e-8


@dataclass(frozen=True, eq=False)
class RankTests:
    """Hold the comparison of all variants on the same cases.

    blocks: median over the seeds, one row a case and one column a variant; ranks: mean rank of each variant, 1 is best;
    friedman, p: statistic and probability that all variants are equal (NaN for fewer than 3 variants);
    pairs: first, second, n, p, p_holm, a12, one row a pair.
    """

    blocks: DataFrame
    ranks: Series
    friedman: float
    p: float
    pairs: DataFrame

    @property
    def n_cases(self) -> int:
        """How many cases enter."""
        return len(self.blocks)


def rank_tests(found: DataFrame, measure: str = "largest_error", floor: float = FLOOR) -> RankTests:
    """Compare the variants of one setting on the cases that all of them ran.

    A case is one block: its value is the median over the seeds, since seeds of one case are repeats and no independent
    evidence about other cases. found: outcomes of runs of one setting; measure: the column to compare, smaller is
    better; floor: values below it count as equal to it. Source: Demsar, J. Mach. Learn. Res. 7 (2006) 1.
    """
    raised = found.assign(**{measure: found[measure].clip(lower=floor)})
    blocks = case_medians(raised, measure)
    statistic, p = friedman(blocks.to_numpy())
    ranks = blocks.rank(axis=1).mean(axis=0)
    return RankTests(blocks, ranks.sort_values(kind="stable"), statistic, p, pair_tests(blocks, raised, measure))


def case_medians(found: DataFrame, measure: str) -> DataFrame:
    """Return the median over the seeds, case by variant, of the cases that every variant ran."""
    order = list(dict.fromkeys(found["variant"]))
    medians = found.groupby(["case", "variant"], sort=False)[measure].median().unstack("variant")
    return medians.reindex(columns=order).dropna(axis=0)


def friedman(blocks: Array) -> tuple[float, float]:
    """Return Friedman's statistic and its probability; NaN for under 3 variants or 2 cases, or if all are equal."""
    from scipy.stats import friedmanchisquare  # noqa: PLC0415 - takes time to import

    n_cases, n_variants = blocks.shape
    if n_variants < 3 or n_cases < 2 or (blocks == blocks[:, :1]).all():
        return np.nan, np.nan
    found = friedmanchisquare(*blocks.T)
    return float(found.statistic), float(found.pvalue)


def pair_tests(blocks: DataFrame, found: DataFrame, measure: str) -> DataFrame:
    """Return the tests of all pairs, Holm's correction over all of them."""
    from statsmodels.stats.multitest import multipletests  # noqa: PLC0415 - takes time to import

    samples = {v: g[measure].to_numpy() for v, g in found.groupby("variant", sort=False)}
    rows = [
        (a, b, len(blocks), signed_rank(blocks[a].to_numpy(), blocks[b].to_numpy()), a12(samples[a], samples[b]))
        for a, b in combinations(blocks.columns, 2)
    ]
    pairs = DataFrame(rows, columns=["first", "second", "n", "p", "a12"])
    corrected = multipletests(pairs["p"], method="holm")[1] if len(pairs) and len(blocks) else np.nan
    return pairs.assign(p_holm=corrected)


def signed_rank(first: Array, second: Array) -> float:
    """Return the two-sided probability of Wilcoxon's signed-rank test; 1 when no pair differs.

    Differences are taken between the logarithms, since errors span many powers of ten; Pratt's rule for ties.
    """
    from scipy.stats import wilcoxon  # noqa: PLC0415 - takes time to import

    differences = log_difference(first, second)
    if not differences.any():
        return 1.0
    return float(wilcoxon(differences, zero_method="pratt").pvalue)


def log_difference(first: Array, second: Array) -> Array:
    """Return log(first/second), 0 for equal ones; zero and infinity count as the ends of all floats."""
    ends = np.finfo(np.float64)
    x, y = (np.log(np.clip(v, ends.tiny, ends.max)) for v in (first, second))
    return np.where(first == second, 0.0, x - y)


def p_matrix(tests: RankTests) -> DataFrame:
    """Return Holm's probabilities as a symmetric table, 1 on the diagonal."""
    names = list(tests.blocks.columns)
    place = {name: i for i, name in enumerate(names)}
    matrix = np.ones((len(names), len(names)))
    first, second = (tests.pairs[key].map(place).to_numpy(int) for key in ("first", "second"))
    matrix[first, second] = matrix[second, first] = tests.pairs["p_holm"].to_numpy(float)
    return DataFrame(matrix, index=names, columns=names)
