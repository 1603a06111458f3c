"""Errors by identifier and case."""

from collections.abc import Sequence

from pandas import DataFrame


def error_map(found: DataFrame, variants: Sequence[str], cases: Sequence[str]) -> DataFrame:
    """Return the median over the seeds of the largest relative error, variants by cases in the orders given.

    found: outcomes of runs of one setting; infinite where at least half of the runs failed, NaN where none was made.
    """
    medians = found.groupby(["variant", "case"], sort=False)["largest_error"].median().unstack("case")
    there = [v for v in variants if v in medians.index]
    return medians.reindex(index=there, columns=[c for c in cases if c in medians.columns])
