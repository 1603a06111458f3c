"""Which fitness gives right parameters, and whether a high similarity says so."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame

from armid.study.analyses.drawing import COLOURS, MARKERS, panels
from armid.study.analyses.table import Column, Table


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
    from scipy.stats import spearmanr

    both = np.isfinite(first) & np.isfinite(second)
    x, y = first[both], second[both]
    if x.size < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return np.nan
    return float(spearmanr(x, y).statistic)


COLUMNS = (
    Column("setting", "noise"), Column("fitness", "fitness"), Column("identifier", "identifier"),
    Column("n", "runs", ".0f"), Column("median_error", "largest error, median [%]", ".3g", 100.0),
    Column("worst_error", "worst [%]", ".3g", 100.0), Column("median_misfit", "1 - S reached, median", ".3g"),
    Column("correlation", "rank correlation", ".2f"),
)  # fmt: skip
WORDS = (
    "Which fitness gives right parameters: the largest relative error of a run, median and worst over cases and seeds "
    "(a failed run counts as infinite), beside 1 - S, the similarity degree that the result reached on the train "
    "records whatever was minimised (median). rank correlation: Spearman's, over the runs of the line, between 1 - S "
    "and the largest error; near 1 a higher similarity means better parameters, near 0 it says nothing about them."
)


def fitness_quality_table(found: DataFrame) -> Table:
    """Return one line a setting, fitness and identifier. found: outcomes of runs."""
    return Table("fitness", "Fitness against error", WORDS, fitness_quality(found), COLUMNS)


FLOOR = 1e-16
MOST_POINTS = 800


def fitness_quality_figure(found: DataFrame) -> Any:
    """Draw one panel a setting: largest error of each run [%] against 1 - S, a colour a fitness.

    found: outcomes of runs. Failed runs are left out.
    """
    settings = list(dict.fromkeys(found["setting"]))
    names = list(dict.fromkeys(found["fitness"]))
    figure, axes = panels(len(settings), 2, 6.8, 5.2)
    for axis, setting in zip(axes, settings, strict=True):
        own = found[(found["setting"] == setting) & (found["status"] == "done")]
        for k, name in enumerate(names):
            group = own[own["fitness"] == name]
            group = group.iloc[:: max(1, -(-len(group) // MOST_POINTS))]
            misfit = np.maximum(1.0 - group["train_s"].to_numpy(float), FLOOR)
            error = np.maximum(100.0 * group["largest_error"].to_numpy(float), 100.0 * FLOOR)
            axis.plot(misfit, error, MARKERS[k % 7], ms=4.5, mfc="none", mew=0.9, color=COLOURS[k % 7], label=name)
        axis.set(xscale="log", yscale="log", title=setting)
        axis.set_xlabel("1 - S reached (similarity degree on the train records)")
        axis.set_ylabel("largest relative error [%]")
        axis.grid(alpha=0.3)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure
