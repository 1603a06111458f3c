"""Errors by identifier and case."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.study.analyses.drawing import pyplot
from armid.study.analyses.table import Column, Table


def error_map(found: DataFrame, variants: Sequence[str], cases: Sequence[str]) -> DataFrame:
    """Return the median over the seeds of the largest relative error, variants by cases in the orders given.

    found: outcomes of runs of one setting; infinite where at least half of the runs failed, NaN where none was made.
    """
    medians = found.groupby(["variant", "case"], sort=False)["largest_error"].median().unstack("case")
    there = [v for v in variants if v in medians.index]
    return medians.reindex(index=there, columns=[c for c in cases if c in medians.columns])


WORDS = (
    "No truth is known. Median and population standard deviation of each parameter over all finished runs [SI], "
    "Cramer-Rao standard deviation at the solution (median), the errors of the result on the train and the holdout "
    "records (medians, in the unit of the signal), and runs of which the parameter ended on its bound."
)


def values(found: DataFrame, estimates: DataFrame) -> Table:
    """Return one line a setting, variant and parameter. found: outcomes; estimates: a row a run and parameter."""
    by = ["setting", "variant", "parameter", "unit"]
    joined = estimates.merge(found[["run", "train_rmse", "holdout_rmse"]], on="run")
    frame = joined.groupby(by, sort=False).agg(
        n=("run", "size"), median=("value", "median"), deviation=("value", lambda v: v.std(ddof=0)),
        bound=("deviation", "median"), train=("train_rmse", "median"), holdout=("holdout_rmse", "median"),
        n_at_bound=("at_bound", "sum"),
    ).reset_index()  # fmt: skip
    columns = (
        Column("setting", "noise"), Column("variant", "identifier"), Column("parameter", "parameter"),
        Column("unit", "unit"), Column("n", "runs", ".0f"), Column("median", "median", ".6g"),
        Column("deviation", "standard deviation", ".2g"), Column("bound", "Cramer-Rao", ".2g"),
        Column("train", "RMSE train", ".4g"), Column("holdout", "RMSE holdout", ".4g"),
        Column("n_at_bound", "at a bound", ".0f"),
    )  # fmt: skip
    return Table("values", "Parameters found", WORDS, frame, columns)


# Shown in %: better than the lower end is all the same colour.
LOWEST, HIGHEST = 1e-6, 1e2
MOST_NUMBERS = 12


def error_map_figure(maps: Mapping[str, DataFrame]) -> Any:
    """Draw one panel a setting: median over the seeds of the largest relative error [%], variants by cases.

    maps: setting -> errors [1], one row a variant and one column a case, infinite where the median run failed.
    """
    import seaborn as sns
    from matplotlib.colors import LogNorm

    plt = pyplot()
    n_rows = sum(len(m) for m in maps.values())
    n_columns = max(m.shape[1] for m in maps.values())
    numbers = n_columns <= MOST_NUMBERS
    size = (3.4 + (0.95 if numbers else 0.36) * n_columns, 1.3 * len(maps) + 0.36 * n_rows + 0.4)
    figure, axes = plt.subplots(len(maps), 1, figsize=size, squeeze=False, layout="constrained")
    norm = LogNorm(LOWEST, HIGHEST)
    for axis, (setting, errors) in zip(axes.ravel(), maps.items(), strict=True):
        percent = 100.0 * errors
        colours = percent.clip(LOWEST, HIGHEST)
        text = percent.map(brief) if numbers else False
        sns.heatmap(colours, ax=axis, norm=norm, cmap="cividis_r", annot=text, fmt="", cbar=False, linewidths=0.4,
                    annot_kws={"fontsize": 8.5}, xticklabels=True, yticklabels=True)  # fmt: skip
        axis.set(title=setting, xlabel="", ylabel="")
        axis.tick_params(length=0)
    beside = {"ax": list(axes.ravel()), "pad": 0.02, "fraction": 0.05, "shrink": 1.0 / len(maps), "aspect": 25}
    bar = figure.colorbar(axes[0, 0].collections[0], extend="both", **beside)
    bar.set_label("largest relative error [%]")
    return figure


def brief(percent: float) -> str:
    """Return a number that fits into a cell."""
    if not np.isfinite(percent):
        return "failed"
    return f"{percent:.2g}" if percent >= 1e-3 or percent == 0.0 else f"{percent:.0e}"
