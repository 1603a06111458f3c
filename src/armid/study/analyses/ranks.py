"""Rank tests over cases: Friedman, and Wilcoxon signed-rank for each pair with Holm's correction."""

import warnings
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pandas import DataFrame, Series

from armid.study.analyses.drawing import INK, look, pyplot
from armid.study.analyses.table import Column, Table


def a12(first: ArrayLike, second: ArrayLike) -> float:
    """Return the probability that a number of the first sample is smaller than one of the second, ties by half.

    A12 = (#{(x, y) : x < y} + #{x = y}/2) / (n m): 0.5 is no difference, 1 means that the first is always smaller,
    which for errors is better. first: (n,); second: (m,); infinite ones allowed. NaN for an empty sample.
    Source: Vargha and Delaney, J. Educ. Behav. Stat. 25 (2000) 101.
    """
    x, y = np.asarray(first, np.float64), np.sort(np.asarray(second, np.float64))
    if not x.size or not y.size:
        return np.nan
    above = y.size - np.searchsorted(y, x, side="right")
    not_below = y.size - np.searchsorted(y, x, side="left")
    return float((above + not_below).sum() / (2.0 * x.size * y.size))


def size_in_words(value: float) -> str:
    """Return how large the effect is: negligible, small, medium, large (Vargha and Delaney's 0.56, 0.64, 0.71)."""
    distance = abs(value - 0.5)
    for limit, word in ((0.06, "negligible"), (0.14, "small"), (0.21, "medium")):
        if distance < limit:
            return word
    return "large"


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
    from scipy.stats import friedmanchisquare

    n_cases, n_variants = blocks.shape
    if n_variants < 3 or n_cases < 2 or (blocks == blocks[:, :1]).all():
        return np.nan, np.nan
    found = friedmanchisquare(*blocks.T)
    return float(found.statistic), float(found.pvalue)


def pair_tests(blocks: DataFrame, found: DataFrame, measure: str) -> DataFrame:
    """Return the tests of all pairs, Holm's correction over all of them."""
    from statsmodels.stats.multitest import multipletests

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
    from scipy.stats import wilcoxon

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


WORDS = (
    "Largest relative error of a run, median over the seeds: one number a case and identifier, so that a case is one "
    "block and seeds are no false witnesses. Errors of 1e-6 % and below count as equal. Rank 1 is the best of a case; "
    "the table shows the mean over the cases."
)
PAIR_WORDS = (
    "Wilcoxon's signed-rank test of the logarithms of the same block values (two-sided, Pratt's rule for ties), "
    "corrected after Holm over all {n} pairs of this setting. A12 is the probability that a run of the first has a "
    "smaller error than a run of the second, over all runs, ties by half (Vargha and Delaney). With {n_cases} cases "
    "the smallest p that the test can give before correction is {least:.2g}."
)


def mean_ranks(tests: RankTests, setting: str, name: str) -> Table:
    """Return the mean rank and the median of the block values of each variant."""
    frame = DataFrame({
        "variant": tests.ranks.index, "rank": tests.ranks.to_numpy(),
        "median": tests.blocks[tests.ranks.index].median().to_numpy(),
    })  # fmt: skip
    columns = (
        Column("variant", "identifier"), Column("rank", "mean rank", ".2f"),
        Column("median", "median of the cases [%]", ".3g", 100.0),
    )  # fmt: skip
    return Table(name, f"Mean ranks over {tests.n_cases} cases, {setting}", f"{WORDS} {friedman_words(tests)}", frame,
                 columns)  # fmt: skip


def friedman_words(tests: RankTests) -> str:
    """Return what Friedman's test says."""
    if tests.p != tests.p:
        return "Friedman's test needs at least three identifiers that differ and two cases."
    verdict = "differ" if tests.p < 0.05 else "cannot be told apart"
    degrees = len(tests.ranks) - 1
    return f"Friedman: chi2({degrees}) = {tests.friedman:.3g}, p = {tests.p:.2g}: the identifiers {verdict} at 5 %."


def pairs(tests: RankTests, setting: str, name: str) -> Table:
    """Return the tests of all pairs, those with the best-ranked identifier first."""
    best = tests.ranks.index[0]
    frame = tests.pairs.assign(size=tests.pairs["a12"].map(size_in_words))
    with_best = (frame["first"] == best) | (frame["second"] == best)
    frame = frame.assign(_first=~with_best).sort_values(["_first", "p_holm"], kind="stable").drop(columns="_first")
    words = PAIR_WORDS.format(n=len(frame), n_cases=tests.n_cases, least=2.0 ** (1 - tests.n_cases))
    columns = (
        Column("first", "first"), Column("second", "second"), Column("n", "cases", ".0f"), Column("p", "p", ".2g"),
        Column("p_holm", "p, Holm", ".2g"), Column("a12", "A12", ".2f"), Column("size", "difference"),
    )  # fmt: skip
    return Table(name, f"Pairs, {setting}", words, frame, columns, most=max(20, len(tests.ranks) - 1))


LEAST_CASES = 20


def critical_difference_figure(tests: RankTests, setting: str) -> Any:
    """Draw the mean ranks on a line; a bar joins identifiers whose pairs are not significant at 5 %.

    The pairs are those of Wilcoxon with Holm. Source: Demsar, J. Mach. Learn. Res. 7 (2006) 1.
    """
    import scikit_posthocs as sp

    plt = pyplot()
    n = len(tests.ranks)
    figure, axis = plt.subplots(figsize=(10.5, 1.6 + 0.26 * n), layout="constrained")
    colours = {name: look(i)["color"] for i, name in enumerate(tests.blocks.columns)}
    with warnings.catch_warnings():
        # pandas warns scikit-posthocs of what it does inside
        warnings.simplefilter("ignore", FutureWarning)
        sp.critical_difference_diagram(
            tests.ranks, p_matrix(tests), ax=axis, color_palette=colours, label_fmt_left="{label} ({rank:.2f})",
            label_fmt_right="({rank:.2f}) {label}", label_props={"fontsize": 10}, crossbar_props={"color": INK},
        )  # fmt: skip
    axis.set_title(f"mean rank over {tests.n_cases} cases, {setting}: 1 is best", fontsize="medium")
    return figure
