"""Table I of the paper beside ours: where a published error falls among the errors of our runs."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pandas import DataFrame, concat

from armid.report.document import Column, Figure, Part, Table, Text, slug, unlike
from armid.report.style import DASHES, INK, legend_below, line_look, panels, row_names
from armid.study.analyses.analysis import N_RUNS, PARAMETER, SETTING, VARIANT, Analysis, Evidence, is_swarm
from armid.units import labelled, shown

MEAN_ROW = "mean of the rows"
AVERAGED = ["published_error", "error_of_median", "median_error", "mean_error"]
COLUMNS = (
    Column("case", "row"), PARAMETER, Column("unit", "unit"), Column("truth", "truth", ".4f"),
    Column("published", "paper", ".4f"), Column("median", "ours (median)", ".4f"),
    Column("published_error", "paper's error [%]", ".3f", 100.0),
    Column("error_of_median", "error of our median [%]", ".3g", 100.0),
    Column("median_error", "our median error [%]", ".3g", 100.0), Column("low", "95 % from [%]", ".3g", 100.0),
    Column("high", "to [%]", ".3g", 100.0), Column("mean_error", "our mean error [%]", ".3g", 100.0),
    Column("percentile", "paper's error lies at [percentile of ours]", ".0f"), N_RUNS,
)  # fmt: skip
TABLE_CAPTION = (
    "truth and paper: Table I as printed. ours: medians over the seeds, of records simulated from the truth with "
    "estimated constants of the arm. 95 %: percentile bootstrap of the median. Percentile: share of our runs that "
    f"beat the paper on that row (ties count half). The rows '{MEAN_ROW}' average over the rows."
)
FIGURE_CAPTION = (
    "Relative error [%], all rows and seeds together: quartiles, median, and whiskers from the 5th to the 95th "
    "percentile; the dashes say the noise. Diamonds are the paper's errors on its rows, the vertical line is their "
    "mean."
)
LAYOUT_CAPTION = (
    "True value, identified value and relative error of each parameter. The values of the paper belong to its own arm, "
    "ours to a simulated one: medians over the seeds. 0.000 is an error below 0.0005 %."
)
DEVIATION_CAPTION = " deviation: standard deviation of the population."
PRINTED_PARTS = {"truth": "true", "value": "found", "relative_error": "error"}
# Smaller errors are drawn there [%].
DRAWN_FROM = 1e-9
RESAMPLES = 2000
# Numbers that a batch of resamples may hold at once.
BATCH_NUMBERS = 4_000_000


def parts(evidence: Evidence) -> Sequence[Part]:
    if evidence.study.get("report") != "table1" or evidence.published.empty:
        return ()
    rows = table1_rows(evidence.estimates, evidence.published)
    if rows.empty:
        return ()
    wanted = [(s, v) for v in evidence.interesting for s in evidence.settings if v in evidence.groups[s]]
    names = unlike([slug("table1", v, s) for s, v in wanted])
    return (
        paper_layout(evidence, "Table I", with_truth=True),
        Text(f"Shown for {', '.join(evidence.interesting)}: the swarm in every form that was run, then the best of the "
             "others by the rank of their median largest error. All identifiers are in table1.csv."),
        *(Table(name, f"Table I beside ours: {v}, {s}", TABLE_CAPTION,
                rows[(rows["setting"] == s) & (rows["variant"] == v)], COLUMNS)
          for (s, v), name in zip(wanted, names, strict=True)),
        Table("table1", "Table I beside ours: all identifiers", TABLE_CAPTION, rows, (SETTING, VARIANT, *COLUMNS),
              most=0),
        Figure("table1", "Errors on Table I beside the paper's", FIGURE_CAPTION,
               lambda: table1_figure(evidence.estimates, evidence.published, evidence.colours)),
    )  # fmt: skip


TABLE1 = Analysis("table1", "Table I of the paper beside ours", parts, "row by row, where the study asks for it")


def paper_layout(evidence: Evidence, title: str, with_truth: bool) -> Table:
    """Return the paper's table as it is printed, true, identified and error of each parameter, and ours in its form.

    with_truth: whether the truth of the cases is that of the paper's values, too.
    """
    published = evidence.published.rename(columns={"published": "value"})
    blocks = [("the paper", published if with_truth else published.assign(truth=np.nan, relative_error=np.nan))]
    own = [v for v in evidence.interesting if is_swarm(v)][:1]
    own += [v for v in evidence.best_first if v not in own][:1]
    for variant, setting in product(own, evidence.settings):
        runs = evidence.estimates[(evidence.estimates["variant"] == variant)
                                  & (evidence.estimates["setting"] == setting)]  # fmt: skip
        medians = runs.groupby(["case", "parameter"], sort=False)[["truth", "value"]].median().reset_index()
        error = (medians["value"] - medians["truth"]).abs() / medians["truth"].abs()
        if len(medians):
            blocks.append((f"{variant}, {setting}", medians.assign(relative_error=error)))
    units = dict(zip(evidence.estimates["parameter"], evidence.estimates["unit"], strict=True))
    names = [n for n in dict.fromkeys(published["parameter"]) if n in units]
    tables, columns = [], [Column("source", "source"), Column("case", "row")]
    for name in names:
        factor, unit = shown(1.0, units[name])
        group = labelled(name, unit)
        columns += [Column(f"{name}_true", f"{group} true", ".2f" if with_truth else ".4f", factor, group),
                    Column(f"{name}_found", f"{group} found", ".4f", factor, group),
                    Column(f"{name}_error", f"{group} error %", ".3f", 100.0, group)]  # fmt: skip
    keys = [c.key for c in columns[2:]]
    for source, block in blocks:
        wide = block.pivot(index="case", columns="parameter", values=[*PRINTED_PARTS])
        wide = wide.set_axis(wide.columns.map(lambda at: f"{at[1]}_{PRINTED_PARTS[at[0]]}"), axis=1)
        wide = wide.reindex(index=list(dict.fromkeys(block["case"])), columns=keys)
        mean, scatter = wide.mean(), wide.std(ddof=0)
        wide.loc["mean"] = mean[mean.index.str.endswith("_error" if with_truth else ("_found", "_error"))]
        if not with_truth:
            wide.loc["deviation"] = scatter[scatter.index.str.endswith("_found")]
        tables.append(wide.rename_axis("case").reset_index().assign(source=source))
    frame = concat(tables)[["source", "case", *keys]]
    name = slug(title, "as printed")
    caption = LAYOUT_CAPTION + ("" if with_truth else DEVIATION_CAPTION)
    return Table(name, f"{title} as the paper prints it, and ours", caption, frame, tuple(columns), grouped=True)


def table1_rows(estimates: DataFrame, published: DataFrame) -> DataFrame:
    """Return one row per setting, variant, case and parameter, and after each variant's the means over the cases.

    Values are in the units that the paper prints, pressures in MPa. estimates: one row a run and parameter; published:
    the paper's values, SI.
    """
    beside = published[["case", "parameter", "published", "relative_error"]]
    both = estimates.merge(beside.rename(columns={"relative_error": "published_error"}), on=["case", "parameter"])
    rows: list[dict[Any, Any]] = []
    for (setting, variant), own in both.groupby(["setting", "variant"], sort=False):
        names = {"setting": setting, "variant": variant}
        entries = [names | {"case": case, "parameter": parameter} | one_row(group)
                   for (case, parameter), group in own.groupby(["case", "parameter"], sort=False)]  # fmt: skip
        rows += entries
        groups = DataFrame(entries).groupby("parameter", sort=False)
        means = groups[AVERAGED].mean().assign(n=groups["n"].sum(), case=MEAN_ROW, unit="").reset_index()
        rows += [names | mean for mean in means.to_dict("records")]
    return DataFrame(rows)


def one_row(group: DataFrame) -> dict[str, object]:
    from scipy.stats import percentileofscore

    errors = group["relative_error"].to_numpy(float)
    truth, published, published_error = group[["truth", "published", "published_error"]].to_numpy(float)[0]
    middle = float(group["value"].median())
    low, high = median_interval(errors)
    factor, unit = shown(1.0, group["unit"].iloc[0])
    return {
        "unit": unit, "n": len(group), "truth": factor * truth, "published": factor * published,
        "median": factor * middle, "published_error": published_error,
        "error_of_median": abs(middle - truth) / abs(truth), "median_error": float(np.median(errors)), "low": low,
        "high": high, "mean_error": float(np.mean(errors)),
        "percentile": percentileofscore(errors, published_error, kind="mean"),
    }  # fmt: skip


def median_interval(values: ArrayLike) -> tuple[float, float]:
    """Return the 95 % percentile bootstrap interval of the median; fewer than two values give NaN.

    Source: Efron and Tibshirani, An Introduction to the Bootstrap (1993), ch. 13.
    """
    from scipy.stats import bootstrap

    sample = np.sort(np.asarray(values, np.float64))
    if sample.size < 2:
        return np.nan, np.nan
    interval = bootstrap(
        (sample,), np.median, n_resamples=RESAMPLES, batch=max(1, BATCH_NUMBERS // sample.size),
        method="percentile", rng=np.random.default_rng(0),
    ).confidence_interval  # fmt: skip
    return float(interval.low), float(interval.high)


def table1_figure(estimates: DataFrame, published: DataFrame, colours: Mapping[str, int]) -> Any:
    from matplotlib.lines import Line2D

    variants = [v for v in colours if v in set(estimates["variant"])]
    names = [n for n in dict.fromkeys(published["parameter"]) if n in set(estimates["parameter"])]
    settings = list(dict.fromkeys(estimates["setting"]))
    figure, axes = panels(len(names), 2, 6.8, 1.5 + (0.16 + 0.19 * len(settings)) * len(variants))
    for i, (axis, name) in enumerate(zip(axes, names, strict=True)):
        own = estimates[estimates["parameter"] == name]
        for j, setting in enumerate(settings):
            draw_boxes(axis, own[own["setting"] == setting], variants, colours, j, len(settings))
        errors = 100.0 * published.loc[published["parameter"] == name, "relative_error"].to_numpy()
        axis.axvline(errors.mean(), color="black", lw=1.2, ls="--", zorder=0)
        axis.plot(np.maximum(errors, DRAWN_FROM), np.full(errors.size, -0.5), "D", color="black", ms=5, clip_on=False,
                  zorder=5)  # fmt: skip
        row_names(axis, i, variants)
        axis.set(xscale="log", ylim=(len(variants) - 0.4, -0.6), title=name, xlabel="relative error [%]")
        axis.grid(axis="x", alpha=0.3)
    handles = [Line2D([], [], color=INK, ls=dash_of(j), label=f"ours, {s}") for j, s in enumerate(settings)]
    paper = "the paper: its rows, and their mean"
    legend_below(figure, 3, [*handles, Line2D([], [], color="black", marker="D", ls="--", lw=1.2, label=paper)])
    return figure


def draw_boxes(axis: Any, own: DataFrame, variants: Sequence[str], colours: Mapping[str, int], j: int, n: int) -> None:
    width = 0.7 / n
    for i, variant in enumerate(variants):
        errors = 100.0 * own.loc[own["variant"] == variant, "relative_error"].to_numpy()
        colour = line_look(colours[variant])["color"]
        line = {"color": colour, "lw": 1.2, "ls": dash_of(j)}
        axis.boxplot(
            [np.maximum(errors, DRAWN_FROM)], positions=[i + width * (j - (n - 1) / 2.0)], orientation="horizontal",
            whis=(5, 95), widths=0.8 * width, manage_ticks=False, medianprops={"color": colour, "lw": 2.4},
            boxprops=line, whiskerprops=line, capprops=line | {"ls": "-"},
            flierprops={"marker": ".", "ms": 2.5, "mfc": colour, "mec": "none", "alpha": 0.6},
        )  # fmt: skip


def dash_of(j: int) -> Any:
    return DASHES[j % len(DASHES)]
