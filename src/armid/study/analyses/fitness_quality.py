"""Which fitness gives right parameters, and whether a high similarity says so."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame

from armid.report.document import Column, Figure, Part, Table
from armid.report.style import COLOURS, MARKERS, legend_below, panels
from armid.study.analyses.analysis import N_RUNS, SETTING, Analysis, Evidence, every_nth

# Smaller values of 1 - S and of relative errors are drawn there.
FLOOR = 1e-16
MOST_POINTS = 800
COLUMNS = (
    SETTING, Column("fitness", "fitness"), Column("identifier", "identifier"), N_RUNS,
    Column("median_error", "largest error, median [%]", ".3g", 100.0),
    Column("worst_error", "worst [%]", ".3g", 100.0), Column("median_misfit", "1 - S reached, median", ".3g"),
    Column("correlation", "rank correlation", ".2f"),
)  # fmt: skip
TABLE_CAPTION = (
    "Which fitness gives right parameters: the largest relative error of a run, median and worst over cases and seeds "
    "(a failed run counts as infinite), beside 1 - S, the similarity degree that the result reached on the train "
    "records whatever was minimised (median). rank correlation: Spearman's, over the runs of the line, between 1 - S "
    "and the largest error; near 1 a higher similarity means better parameters, near 0 it says nothing about them."
)
FIGURE_CAPTION = (
    "Each mark is a run: the largest relative error of its result against 1 - S, the similarity degree that it "
    "reached on the train records, whatever was minimised. A fitness that gives right parameters is low; one that "
    "only gives a high similarity is left but not low. Failed runs are left out; values below 1e-16 are drawn there."
)


def parts(evidence: Evidence) -> Sequence[Part]:
    if evidence.runs["fitness"].nunique() < 2 or not evidence.knows_truth:
        return ()
    figure = Figure("fitness", "Error against the similarity reached", FIGURE_CAPTION,
                    lambda: fitness_quality_figure(evidence.runs))  # fmt: skip
    return fitness_quality(evidence.runs), figure


FITNESS_QUALITY = Analysis(
    "fitness_quality", "Which fitness gives right parameters", parts, "error against similarity, for each fitness"
)


def fitness_quality(runs: DataFrame) -> Table:
    """Return, per setting, fitness and identifier: errors, the similarity reached, and how the two go together."""
    rows = []
    for key, group in runs.groupby(["setting", "fitness", "identifier"], sort=False):
        misfit = 1.0 - group["train_s"].to_numpy(float)
        errors = group["largest_error"].to_numpy(float)
        known = misfit[~np.isnan(misfit)]
        middle = np.median(errors), np.max(errors), np.median(known) if known.size else np.nan
        rows.append((*key, len(group), *middle, rank_correlation(misfit, errors)))
    return Table("fitness", "Fitness against error", TABLE_CAPTION, DataFrame(rows, columns=[c.key for c in COLUMNS]),
                 COLUMNS)  # fmt: skip


def rank_correlation(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    from scipy.stats import spearmanr

    both = np.isfinite(first) & np.isfinite(second)
    x, y = first[both], second[both]
    if x.size < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return np.nan
    return float(spearmanr(x, y).statistic)


def fitness_quality_figure(runs: DataFrame) -> Any:
    settings = list(dict.fromkeys(runs["setting"]))
    names = list(dict.fromkeys(runs["fitness"]))
    figure, axes = panels(len(settings), 2, 6.8, 5.2)
    for axis, setting in zip(axes, settings, strict=True):
        own = runs[(runs["setting"] == setting) & (runs["status"] == "done")]
        for k, name in enumerate(names):
            group = every_nth(own[own["fitness"] == name], MOST_POINTS)
            misfit = np.maximum(1.0 - group["train_s"].to_numpy(float), FLOOR)
            error = np.maximum(100.0 * group["largest_error"].to_numpy(float), 100.0 * FLOOR)
            axis.plot(misfit, error, MARKERS[k % 7], ms=4.5, mfc="none", mew=0.9, color=COLOURS[k % 7], label=name)
        axis.set(xscale="log", yscale="log", title=setting, ylabel="largest relative error [%]",
                 xlabel="1 - S reached (similarity degree on the train records)")  # fmt: skip
        axis.grid(alpha=0.3)
    legend_below(figure, 4)
    return figure
