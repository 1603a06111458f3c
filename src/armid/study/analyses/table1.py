"""Where a published error falls among ours."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pandas import DataFrame

from armid.study.analyses.drawing import COLOURS, panels
from armid.study.analyses.histories import median_interval
from armid.study.analyses.table import Column, Table
from armid.units import SHOWN


def percentile_among(errors: ArrayLike, published: float) -> float:
    """Return the percentage of errors below a published one, equal ones by half; NaN for an empty sample.

    10 says that one in ten of our runs was better than the published result. errors: (n,), infinite ones allowed.
    """
    from scipy.stats import percentileofscore

    sample = np.asarray(errors, np.float64)
    return float(percentileofscore(sample, published, kind="mean")) if sample.size else np.nan


MEAN_ROW = "mean of the rows"
COLUMNS = (
    Column("case", "row"), Column("parameter", "parameter"), Column("unit", "unit"), Column("truth", "truth", ".4f"),
    Column("published", "paper", ".4f"), Column("median", "ours (median)", ".4f"),
    Column("published_error", "paper's error [%]", ".3f", 100.0),
    Column("error_of_median", "error of our median [%]", ".3g", 100.0),
    Column("median_error", "our median error [%]", ".3g", 100.0), Column("low", "95 % from [%]", ".3g", 100.0),
    Column("high", "to [%]", ".3g", 100.0), Column("mean_error", "our mean error [%]", ".3g", 100.0),
    Column("percentile", "paper's error lies at [percentile of ours]", ".0f"), Column("n", "runs", ".0f"),
)  # fmt: skip
WORDS = (
    "truth and paper: Table I as printed. ours: median over the seeds. Errors are abs(value - truth)/truth: of our "
    "median, and the median and mean over the seeds with a 95 % percentile bootstrap interval of the median (2000 "
    "resamples). The percentile says which share of our runs has a smaller error than the paper's value on that row "
    f"(equal ones by half): 90 means that nine in ten of our runs were better. The rows '{MEAN_ROW}' average over the "
    "rows: the paper's errors, the errors of our medians, our median errors, and our mean errors (which is the mean "
    "over rows and seeds). Ours is synthetic: simulated from the truth with the constants of an estimated arm, since "
    "the paper prints none."
)


def table1_rows(estimates: DataFrame, published: DataFrame) -> DataFrame:
    """Return one row per setting, variant, case and parameter, SI, and the mean over the cases.

    estimates: one row a run and parameter; published: the paper's values.
    """
    beside = published[["case", "parameter", "published", "relative_error"]]
    both = estimates.merge(beside.rename(columns={"relative_error": "published_error"}), on=["case", "parameter"])
    keys = ["setting", "variant", "case", "parameter"]
    frame = DataFrame([dict(zip(keys, k, strict=True)) | one_row(g) for k, g in both.groupby(keys, sort=False)])
    return frame if frame.empty else with_means(frame)


def one_row(group: DataFrame) -> dict[str, object]:
    """Return the numbers of one case and parameter."""
    errors = group["relative_error"].to_numpy(float)
    truth, published, published_error = group[["truth", "published", "published_error"]].to_numpy(float)[0]
    middle = float(group["value"].median())
    low, high = median_interval(errors)
    return {
        "unit": group["unit"].iloc[0], "n": len(group), "truth": truth, "published": published, "median": middle,
        "published_error": published_error, "error_of_median": abs(middle - truth) / abs(truth),
        "median_error": float(np.median(errors)), "low": low, "high": high, "mean_error": float(np.mean(errors)),
        "percentile": percentile_among(errors, published_error),
    }  # fmt: skip


def with_means(rows: DataFrame) -> DataFrame:
    """Return the rows with the mean over the cases after each variant's."""
    averaged = ["published_error", "error_of_median", "median_error", "mean_error"]
    keys = ["setting", "variant", "parameter"]
    means = rows.groupby(keys, sort=False)[averaged].mean().reset_index().assign(case=MEAN_ROW, unit="")
    means["n"] = rows.groupby(keys, sort=False)["n"].sum().to_numpy()
    both = [rows, means.reindex(columns=rows.columns).astype({"truth": float})]
    order = {key: i for i, key in enumerate(dict.fromkeys(zip(rows["setting"], rows["variant"], strict=True)))}
    frame = DataFrame([r for part in both for r in part.to_dict("records")], columns=rows.columns)
    place = [order[s, v] for s, v in zip(frame["setting"], frame["variant"], strict=True)]
    return frame.assign(_place=place).sort_values("_place", kind="stable", ignore_index=True).drop(columns="_place")


def table1(rows: DataFrame, setting: str, variant: str, name: str) -> Table:
    """Return the table of one variant under one setting, in the units that people read."""
    chosen = rows[(rows["setting"] == setting) & (rows["variant"] == variant)]
    return Table(name, f"Table I beside ours: {variant}, {setting}", WORDS, in_shown_units(chosen), COLUMNS)


def in_shown_units(rows: DataFrame) -> DataFrame:
    """Return the rows with pressures in MPa, as the paper prints them."""
    factor = rows["unit"].map(lambda u: SHOWN.get(u, (u, 1.0))[1])
    shown = {key: rows[key] * factor for key in ("truth", "published", "median")}
    return rows.assign(**shown, unit=rows["unit"].map(lambda u: SHOWN.get(u, (u, 1.0))[0]))


def table1_all(rows: DataFrame) -> Table:
    """Return every variant and setting in one table, for the CSV file."""
    both = (Column("setting", "noise"), Column("variant", "identifier"))
    title = "Table I beside ours: all identifiers"
    return Table("table1", title, WORDS, in_shown_units(rows), (*both, *COLUMNS), most=0)


FLOOR = 1e-9


def table1_figure(estimates: DataFrame, published: DataFrame, variants: Sequence[str]) -> Any:
    """Draw one panel a parameter: our relative errors [%] of all rows and seeds as boxes, the paper's as diamonds.

    estimates: one row a run and parameter; published: the paper's values with their errors; variants: top to bottom.
    The box spans the quartiles, the whiskers the 5th to the 95th percentile, dots are the runs beyond.
    """
    names = [n for n in dict.fromkeys(published["parameter"]) if n in set(estimates["parameter"])]
    settings = list(dict.fromkeys(estimates["setting"]))
    figure, axes = panels(len(names), 2, 6.8, 1.5 + (0.16 + 0.19 * len(settings)) * len(variants))
    for i, (axis, name) in enumerate(zip(axes, names, strict=True)):
        own = estimates[estimates["parameter"] == name]
        for j, setting in enumerate(settings):
            draw_boxes(axis, own[own["setting"] == setting], variants, j, len(settings))
        draw_paper(axis, 100.0 * published.loc[published["parameter"] == name, "relative_error"].to_numpy())
        axis.set_yticks(range(len(variants)), variants if i % 2 == 0 else [""] * len(variants))
        axis.set(xscale="log", ylim=(len(variants) - 0.4, -0.6), title=name, xlabel="relative error [%]")
        axis.grid(axis="x", alpha=0.3)
    name_colours(figure, settings)
    return figure


def draw_boxes(axis: Any, own: DataFrame, variants: Sequence[str], j: int, n: int) -> None:
    """Draw the boxes of one setting, a little apart from those of the others."""
    samples = [100.0 * own.loc[own["variant"] == v, "relative_error"].to_numpy() for v in variants]
    shown = [(i, np.maximum(s, FLOOR)) for i, s in enumerate(samples) if s.size]
    width = 0.7 / n
    places = [i + width * (j - (n - 1) / 2.0) for i, _ in shown]
    colour = COLOURS[j % len(COLOURS)]
    line = {"color": colour, "lw": 1.2}
    axis.boxplot(
        [s for _, s in shown], positions=places, orientation="horizontal", whis=(5, 95), widths=0.8 * width,
        manage_ticks=False, medianprops={"color": colour, "lw": 2.4}, boxprops=line, whiskerprops=line, capprops=line,
        flierprops={"marker": ".", "ms": 2.5, "mfc": colour, "mec": "none", "alpha": 0.6},
    )  # fmt: skip


def draw_paper(axis: Any, errors: np.ndarray) -> None:
    """Draw the paper's errors as diamonds on top, and their mean as a line through all."""
    axis.axvline(errors.mean(), color="black", lw=1.2, ls="--", zorder=0)
    axis.plot(np.maximum(errors, FLOOR), np.full(errors.size, -0.5), "D", color="black", ms=5, clip_on=False, zorder=5)


def name_colours(figure: Any, settings: Sequence[str]) -> None:
    """Write one legend below all panels."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=COLOURS[j % 7], lw=3, label=f"ours, {s}") for j, s in enumerate(settings)]
    paper = "the paper: its rows, and their mean"
    handles.append(Line2D([], [], color="black", marker="D", ls="--", lw=1.2, label=paper))
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
