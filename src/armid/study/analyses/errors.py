"""Where the errors are: by identifier and case, and along the valley in which parameters compensate each other.

Also which fitness gives right parameters, and whether a high similarity says so.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from pandas import DataFrame, concat

from armid.report.document import Column, Figure, Part, Table, slug
from armid.report.style import (
    COLOURS,
    INK,
    MARKERS,
    MOST_COLOURED,
    PALE,
    PRINTED_WIDTH,
    legend_below,
    line_look,
    log_axis,
    no_formulas,
    panels,
    pyplot,
    row_names,
    variant_handles,
)
from armid.study.analyses.analysis import N_RUNS, SETTING, Analysis, Evidence, every_nth

# Range of the colours of the map [%]; cells carry numbers up to so many cases.
LOWEST, HIGHEST = 1e-6, 1e2
MOST_NUMBERS = 12
# The parameters that compensate each other on the arm; others where a study has others.
VALLEY = ("p0", "eta3", "n", "k")
MOST_PARAMETERS, MOST_ERRORS_DRAWN = 4, 600
OTHERS = "all others"
MAP_CAPTION = (
    "Largest relative error of a run [%], median over the seeds; the identifier that is best over all maps on top. "
    "The colours are logarithmic, from 1e-6 % to 100 % at most."
)
VALLEY_CAPTION = (
    "Deviation (value - truth)/truth [%] of the results in each pair of parameters, one mark a run; counts on the "
    "diagonal. Where marks lie along a line, parameters compensate each other. The axes are linear from -{linear:g} to "
    "{linear:g} %, and logarithmic beyond."
)


def error_parts(evidence: Evidence) -> Sequence[Part]:
    maps = {s: error_map(evidence.of(s), evidence.best_first, evidence.cases) for s in evidence.settings}
    figures = [Figure("error_map", "Errors by identifier and case", MAP_CAPTION, lambda: error_map_figure(maps))]
    ends = end_points(evidence.estimates)
    if ends.shape[1] > 3 and len(ends) > 1:
        for s in (s for s in evidence.settings if (ends["setting"] == s).any()):
            own = ends[ends["setting"] == s]
            linear = linear_range(own.drop(columns=["variant", "setting"]).to_numpy(float))
            name, caption = (
                slug("valley", s if len(evidence.settings) > 1 else ""),
                VALLEY_CAPTION.format(linear=linear),
            )
            draw = partial(valley_figure, own, evidence.colours, linear)
            figures.append(Figure(name, f"Where runs end, {s}", caption, draw))
    return figures


ERRORS = Analysis("errors", "Where the errors are", error_parts,
                  "largest error by identifier and case; where runs end", lambda e: e.knows_truth)  # fmt: skip


def error_map(runs: DataFrame, variants: Sequence[str], cases: Sequence[str]) -> DataFrame:
    medians = runs.groupby(["variant", "case"], sort=False)["largest_error"].median().unstack("case")
    shown = [v for v in variants if v in medians.index]
    return medians.reindex(index=shown, columns=[c for c in cases if c in medians.columns])


def error_map_figure(maps: Mapping[str, DataFrame]) -> Any:
    import seaborn as sns
    from matplotlib.colors import LogNorm

    plt = pyplot()
    n_rows = sum(len(m) for m in maps.values())
    n_columns = max(m.shape[1] for m in maps.values())
    numbers = n_columns <= (MOST_NUMBERS if PRINTED_WIDTH.get() != "single" else 0)
    low, high = colour_range(np.concatenate([100.0 * m.to_numpy(float).ravel() for m in maps.values()]))
    size = (3.4 + (0.95 if numbers else 0.36) * n_columns, 1.3 * len(maps) + 0.36 * n_rows + 0.4)
    with no_formulas():
        figure, axes = plt.subplots(len(maps), 1, figsize=size, squeeze=False, layout="constrained")
        for axis, (setting, errors) in zip(axes.ravel(), maps.items(), strict=True):
            percent = 100.0 * errors
            text = percent.map(brief) if numbers else False
            sns.heatmap(percent.clip(low, high), ax=axis, norm=LogNorm(low, high), cmap="cividis_r",
                        annot=text, fmt="", cbar=False, linewidths=0.4, annot_kws={"fontsize": 8.5}, xticklabels=True,
                        yticklabels=True)  # fmt: skip
            axis.set(title=setting, xlabel="", ylabel="")
            axis.tick_params(length=0)
            if PRINTED_WIDTH.get() == "single":
                axis.tick_params(axis="x", labelrotation=90)
    beside = {"ax": list(axes.ravel()), "pad": 0.02, "fraction": 0.05, "shrink": 1.0 / len(maps), "aspect": 25}
    bar = figure.colorbar(axes[0, 0].collections[0], extend="both", **beside)
    bar.set_label("largest relative error [%]")
    return figure


def colour_range(percent: np.ndarray) -> tuple[float, float]:
    """Return the powers of ten around the errors that the map shows, no further than from 1e-6 to 100 %."""
    seen = percent[np.isfinite(percent)].clip(LOWEST, HIGHEST)
    if not seen.size:
        return LOWEST, HIGHEST
    low, high = 10.0 ** np.floor(np.log10(seen.min())), 10.0 ** np.ceil(np.log10(seen.max()))
    return float(low), float(max(high, 10.0 * low))


def brief(percent: float) -> str:
    if not np.isfinite(percent):
        return "failed"
    return f"{percent:.2g}" if percent >= 1e-3 or percent == 0.0 else f"{percent:.0e}"


def end_points(estimates: DataFrame) -> DataFrame:
    """Return variant, setting and the deviation (value - truth)/abs(truth) [%] of each parameter, one row a run."""
    known = estimates[estimates["truth"].notna()]
    deviation = 100.0 * (known["value"] - known["truth"]) / known["truth"].abs()
    wide = known.assign(deviation=deviation).pivot(index="run", columns="parameter", values="deviation")
    names = list(dict.fromkeys(known["parameter"]))
    chosen = [n for n in VALLEY if n in names] if set(VALLEY[:3]) <= set(names) else names[:MOST_PARAMETERS]
    groups = known.drop_duplicates("run").set_index("run")[["variant", "setting"]]
    return groups.join(wide[chosen].dropna(), how="inner")


def valley_figure(ends: DataFrame, colours: Mapping[str, int], linear: float) -> Any:
    """Draw the deviations of each pair of parameters, one mark a run; those without a colour of their own are pale."""
    import seaborn as sns

    pyplot()
    names = [c for c in ends.columns if c not in ("variant", "setting")]
    chosen = [v for v in sorted(colours, key=lambda v: colours[v]) if colours[v] < MOST_COLOURED]
    marked = ends.assign(shown=ends["variant"].where(ends["variant"].isin(chosen), OTHERS))
    shown = concat([every_nth(own, MOST_ERRORS_DRAWN) for _, own in marked.groupby("variant", sort=False)])
    hues = [v for v in (OTHERS, *chosen) if v in set(shown["shown"])]
    palette = {v: PALE if v == OTHERS else COLOURS[colours[v]] for v in hues}
    marks = ["." if v == OTHERS else MARKERS[colours[v]] for v in hues]
    with no_formulas():
        grid = sns.PairGrid(shown, vars=names, hue="shown", hue_order=hues, palette=palette, corner=True, height=2.9,
                            hue_kws={"marker": marks})  # fmt: skip
        grid.map_lower(pyplot().plot, ls="", ms=5, mfc="none", mew=0.9, clip_on=False)
        grid.map_diag(histogram)
        ticks = signed_powers(linear, float(np.abs(shown[names].to_numpy(float)).max()))
        for i, name in enumerate(names):
            for j, axis in enumerate(grid.axes[i, : i + 1]):
                # a histogram counts upwards
                for side in "xy"[: 1 + (j < i)]:
                    getattr(axis, f"set_{side}scale")("symlog", linthresh=linear)
                    getattr(axis, f"set_{side}ticks")(ticks, [f"{tick:g}" for tick in ticks])
                axis.minorticks_off()
                axis.grid(alpha=0.3)
                axis.tick_params(labelsize=8)
            grid.axes[i, 0].set_ylabel(f"{name} [%]" if i else "runs")
            grid.axes[-1, i].set_xlabel(f"{name} [%]")
        grid.add_legend(title="", loc="upper right", bbox_to_anchor=(0.99, 0.98), fontsize=10, markerscale=1.2)
    return grid.figure


def linear_range(deviations: np.ndarray) -> float:
    """Return the power of ten up to which the axes are linear: about what a tenth of the runs are within [%]."""
    sizes = np.abs(deviations[deviations != 0.0])
    return float(10.0 ** np.clip(np.floor(np.log10(np.quantile(sizes, 0.1))), -6.0, 1.0)) if sizes.size else 1.0


def signed_powers(linear: float, largest: float) -> list[float]:
    """Return 0, the largest power of ten on the axis and one half-way down to its linear range, with both signs."""
    top, bottom = np.floor(np.log10(max(largest, linear))), np.log10(linear)
    powers = sorted({float(f"1e{int(p)}") for p in (np.floor(0.5 * (top + bottom)), top) if p >= bottom})
    powers = powers[-1:] if PRINTED_WIDTH.get() == "single" else powers
    return [*(-p for p in reversed(powers)), 0.0, *powers]


def histogram(x: np.ndarray, **look: Any) -> None:
    """Draw how many runs deviate by as much, in bins that are as wide as the axis shows them."""
    ends = np.geomspace(1e-7, 1e3, 41)
    pyplot().gca().hist(x, np.concatenate([-ends[::-1], ends]), histtype="step", color=look["color"])


# Smaller relative errors are drawn there.
LEAST_DRAWN = 1e-16
MOST_RESULTS_DRAWN = 800
FITNESS_COLUMNS = (
    SETTING, Column("fitness", "fitness"), Column("identifier", "identifier"), N_RUNS,
    Column("median_error", "largest error, median [%]", ".3g", 100.0),
    Column("worst_error", "worst [%]", ".3g", 100.0), Column("median_misfit", "1 - S reached, median", ".3g"),
    Column("correlation", "rank correlation", ".2f"),
)  # fmt: skip
FITNESS_TABLE_CAPTION = (
    "Largest relative error of a run over cases and seeds (a failed run counts as infinite), and 1 - S, where S is "
    "the similarity degree of the result on the train records. rank correlation: Spearman's, between 1 - S and that "
    "error; near 1 a higher similarity means better parameters, near 0 it says nothing about them."
)
FITNESS_FIGURE_CAPTION = (
    "Largest relative error of each run, one strip a fitness with its median as a line. A fitness that gives right "
    "parameters is left; failed runs are left out."
)


FITNESS_QUALITY = Analysis("fitness_quality", "Which fitness gives right parameters", lambda evidence: (
    fitness_quality(evidence.runs),
    Figure("fitness", "Errors by fitness", FITNESS_FIGURE_CAPTION,
           lambda: fitness_quality_figure(evidence.runs, evidence.colours)),
), "error against similarity, for each fitness",
    lambda evidence: evidence.knows_truth and evidence.runs["fitness"].nunique() > 1)  # fmt: skip


def fitness_quality(runs: DataFrame) -> Table:
    """Return, per setting, fitness and identifier: errors, the similarity reached, and how the two go together."""
    rows = []
    for key, group in runs.groupby(["setting", "fitness", "identifier"], sort=False):
        misfit, errors = 1.0 - group["train_s"], group["largest_error"]
        both = DataFrame({"misfit": misfit, "error": errors.replace(np.inf, np.nan)})
        correlation = both.corr("spearman", min_periods=3).loc["misfit", "error"]
        rows.append((*key, len(group), errors.median(), errors.max(), misfit.median(), correlation))
    frame = DataFrame(rows, columns=[c.key for c in FITNESS_COLUMNS])
    return Table("fitness", "Fitness against error", FITNESS_TABLE_CAPTION, frame, FITNESS_COLUMNS)


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
