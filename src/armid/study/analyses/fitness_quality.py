"""Which fitness gives right parameters, and whether a high similarity says so."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.report.document import Column, Figure, Part, Table
from armid.report.style import INK, legend_below, line_look, log_axis, panels, row_names, variant_handles
from armid.study.analyses.analysis import N_RUNS, SETTING, Analysis, Evidence, every_nth

# Smaller relative errors are drawn there.
LEAST_DRAWN = 1e-16
MOST_RESULTS_DRAWN = 800
COLUMNS = (
    SETTING, Column("fitness", "fitness"), Column("identifier", "identifier"), N_RUNS,
    Column("median_error", "largest error, median [%]", ".3g", 100.0),
    Column("worst_error", "worst [%]", ".3g", 100.0), Column("median_misfit", "1 - S reached, median", ".3g"),
    Column("correlation", "rank correlation", ".2f"),
)  # fmt: skip
TABLE_CAPTION = (
    "Largest relative error of a run over cases and seeds (a failed run counts as infinite), and 1 - S, where S is "
    "the similarity degree of the result on the train records. rank correlation: Spearman's, between 1 - S and that "
    "error; near 1 a higher similarity means better parameters, near 0 it says nothing about them."
)
FIGURE_CAPTION = (
    "Largest relative error of each run, one strip a fitness with its median as a line. A fitness that gives right "
    "parameters is left; failed runs are left out."
)


def parts(evidence: Evidence) -> Sequence[Part]:
    if evidence.runs["fitness"].nunique() < 2 or not evidence.knows_truth:
        return ()
    figure = Figure("fitness", "Errors by fitness", FIGURE_CAPTION,
                    lambda: fitness_quality_figure(evidence.runs, evidence.colours))  # fmt: skip
    return fitness_quality(evidence.runs), figure


FITNESS_QUALITY = Analysis(
    "fitness_quality", "Which fitness gives right parameters", parts, "error against similarity, for each fitness"
)


def fitness_quality(runs: DataFrame) -> Table:
    """Return, per setting, fitness and identifier: errors, the similarity reached, and how the two go together."""
    rows = []
    for key, group in runs.groupby(["setting", "fitness", "identifier"], sort=False):
        misfit, errors = 1.0 - group["train_s"], group["largest_error"]
        both = DataFrame({"misfit": misfit, "error": errors.replace(np.inf, np.nan)})
        correlation = both.corr("spearman", min_periods=3).loc["misfit", "error"]
        rows.append((*key, len(group), errors.median(), errors.max(), misfit.median(), correlation))
    return Table("fitness", "Fitness against error", TABLE_CAPTION, DataFrame(rows, columns=[c.key for c in COLUMNS]),
                 COLUMNS)  # fmt: skip


def fitness_quality_figure(runs: DataFrame, colours: Mapping[str, int]) -> Any:
    """Draw the error of each run in a strip of its fitness, one panel a setting and one colour an identifier."""
    settings = list(dict.fromkeys(runs["setting"]))
    names = list(dict.fromkeys(runs["fitness"]))
    figure, axes = panels(len(settings), 2, 6.8, 1.8 + 0.55 * len(names))
    random = np.random.default_rng(1)
    for i, (axis, setting) in enumerate(zip(axes, settings, strict=True)):
        own = runs[(runs["setting"] == setting) & (runs["status"] == "done")]
        for k, name in enumerate(names):
            for _, group in own[own["fitness"] == name].groupby("variant", sort=False):
                shown = every_nth(group, MOST_RESULTS_DRAWN)
                error = np.maximum(100.0 * shown["largest_error"].to_numpy(float), 100.0 * LEAST_DRAWN)
                look = line_look(colours[str(shown["variant"].iloc[0])])
                axis.plot(error, k + random.uniform(-0.32, 0.32, error.size), "o", ms=3.0, mfc="none", mew=0.8,
                          mec=look["color"], zorder=look["zorder"])  # fmt: skip
            middle = 100.0 * own.loc[own["fitness"] == name, "largest_error"].median()
            if np.isfinite(middle):
                axis.plot([max(middle, 100.0 * LEAST_DRAWN)] * 2, [k - 0.42, k + 0.42], color=INK, lw=2.0, zorder=5)
        row_names(axis, i, names)
        log_axis(axis)
        axis.set(title=setting, xlabel="largest relative error [%]", ylim=(len(names) - 0.5, -0.5))
        axis.grid(axis="x", alpha=0.3)
    legend_below(figure, 3, variant_handles(colours))
    return figure
