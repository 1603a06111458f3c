"""Rank tests as tables: mean ranks, and the pairs."""

from pandas import DataFrame

from armid.study.metrics import RankTests, size_in_words
from armid.study.tables.table import Column, Table

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
