"""The paper's tables beside ours.

Table I: where a published error falls among the errors of our runs. Table II: mean and spread of repeated
identifications.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pandas import DataFrame, concat

from armid.report.document import Column, Figure, Part, Table, Text, slug, unlike
from armid.report.style import DASHES, INK, legend_below, line_look, mark_handles, marker_of, panels, row_names
from armid.study.analyses.analysis import N_RUNS, PAPER, PARAMETER, SETTING, VARIANT, Analysis, Evidence, is_swarm
from armid.units import labelled, shown

MEAN_ROW = "mean of the rows"
AVERAGED = ["published_error", "error_of_median", "median_error", "mean_error"]
TABLE1_COLUMNS = (
    Column("case", "row"), PARAMETER, Column("unit", "unit"), Column("truth", "truth", ".4f"),
    Column("published", "paper", ".4f"), Column("median", "ours (median)", ".4f"),
    Column("published_error", "paper's error [%]", ".3f", 100.0),
    Column("error_of_median", "error of our median [%]", ".3g", 100.0),
    Column("median_error", "our median error [%]", ".3g", 100.0), Column("low", "95 % from [%]", ".3g", 100.0),
    Column("high", "to [%]", ".3g", 100.0), Column("mean_error", "our mean error [%]", ".3g", 100.0),
    Column("percentile", "paper's error lies at [percentile of ours]", ".0f"), N_RUNS,
)  # fmt: skip
TABLE1_CAPTION = (
    "truth and paper: Table I as printed. ours: medians over the seeds, of records simulated from the truth with "
    "estimated constants of the arm. 95 %: percentile bootstrap of the median. Percentile: share of our runs that "
    f"beat the paper on that row (ties count half). The rows '{MEAN_ROW}' average over the rows."
)
TABLE1_FIGURE_CAPTION = (
    "Relative error [%], all rows and seeds together: quartiles, median, and whiskers from the 5th to the 95th "
    "percentile; the dashes say the noise. Diamonds are the paper's errors on its rows, the vertical line is their "
    "mean."
)
LAYOUT_CAPTION = (
    "True value, identified value and relative error of each parameter. The paper's values are of its arm (Table I "
    "simulated, Table II measured), ours of our simulated arm: medians over the seeds. 0.000 is an error below "
    "0.0005 %."
)
DEVIATION_CAPTION = " deviation: standard deviation of the population."
PRINTED_PARTS = {"truth": "true", "value": "found", "relative_error": "error"}
# Smaller errors are drawn there [%].
DRAWN_FROM = 1e-9
RESAMPLES = 2000
# Numbers that a batch of resamples may hold at once.
BATCH_NUMBERS = 4_000_000


def table1_parts(evidence: Evidence) -> Sequence[Part]:
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
        *(Table(name, f"Table I beside ours: {v}, {s}", TABLE1_CAPTION,
                rows[(rows["setting"] == s) & (rows["variant"] == v)], TABLE1_COLUMNS)
          for (s, v), name in zip(wanted, names, strict=True)),
        Table("table1", "Table I beside ours: all identifiers", TABLE1_CAPTION, rows,
              (SETTING, VARIANT, *TABLE1_COLUMNS), most=0),
        Figure("table1", "Errors on Table I beside the paper's", TABLE1_FIGURE_CAPTION,
               lambda: table1_figure(evidence.estimates, evidence.published, evidence.colours)),
    )  # fmt: skip


TABLE1 = Analysis("table1", "Table I of the paper beside ours", table1_parts, "row by row, where the study asks for it")


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
        entries = [names | {"case": case, "parameter": parameter} | table1_row(group)
                   for (case, parameter), group in own.groupby(["case", "parameter"], sort=False)]  # fmt: skip
        rows += entries
        groups = DataFrame(entries).groupby("parameter", sort=False)
        means = groups[AVERAGED].mean().assign(n=groups["n"].sum(), case=MEAN_ROW, unit="").reset_index()
        rows += [names | mean for mean in means.to_dict("records")]
    return DataFrame(rows)


def table1_row(group: DataFrame) -> dict[str, object]:
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


TABLE2_COLUMNS = (
    Column("setting", "noise, window"), VARIANT, PARAMETER,
    Column("unit", "unit"), Column("truth", "truth", ".4f"), N_RUNS, Column("mean", "mean", ".4f"),
    Column("deviation", "standard deviation", ".2g"), Column("between", "between records", ".2g"),
    Column("within", "within a record", ".2g"), Column("bound", "Cramer-Rao", ".2g"), Column("low", "low", ".4g"),
    Column("high", "high", ".4g"), Column("n_at_bound", "at a bound", ".0f"),
)  # fmt: skip
IN_UNIT = ("truth", "mean", "deviation", "between", "within", "bound", "low", "high")
TABLE2_CAPTION = (
    "mean and standard deviation (of the population, the paper's mean square error): over all runs. between records: "
    "of the means of the records, which their noise makes; within a record: among repeats on it, which the search "
    "makes. Cramer-Rao: median of the bound for one record, widened where the model leaves more than noise. at a "
    "bound: runs that ended on the box, which then decides the value. The paper's lines are its five "
    "identifications of a real arm, ours are synthetic: the two need not agree."
)
TABLE2_FIGURE_CAPTION = (
    "Result of each run, one mark a record; the paper's identifications above as diamonds. The line is the truth of "
    "the synthetic records, the band one Cramer-Rao deviation around it; dotted lines are bounds of the box."
)


def table2_parts(evidence: Evidence) -> Sequence[Part]:
    estimates, published = evidence.estimates, evidence.published
    figure = Figure("table2", "Repeated identifications beside the paper's", TABLE2_FIGURE_CAPTION,
                    lambda: table2_figure(estimates, published, evidence.colours))  # fmt: skip
    layout = paper_layout(evidence, "Table II", with_truth=False)
    return layout, table2(estimates, published), figure


TABLE2 = Analysis("table2", "Table II of the paper beside ours", table2_parts,
                  "mean and spread, where the study asks for it",
                  lambda e: e.study.get("report") == "table2" and not e.estimates.empty)  # fmt: skip


def table2(estimates: DataFrame, published: DataFrame) -> Table:
    """Return one row per setting, variant and parameter, the paper's first."""
    units = dict(zip(estimates["parameter"], estimates["unit"], strict=True))
    box = estimates.drop_duplicates("parameter").set_index("parameter")[["low", "high"]]
    paper = published[published["parameter"].isin(units)].groupby("parameter", sort=False)["published"]
    rows = [paper_row(str(name), values.to_numpy(), box) for name, values in paper]
    keys = ["setting", "variant", "parameter"]
    rows += [dict(zip(keys, k, strict=True)) | table2_row(g) for k, g in estimates.groupby(keys, sort=False)]
    frame = DataFrame(rows)
    factors, names = zip(*(shown(1.0, units[p]) for p in frame["parameter"]), strict=True)
    frame = frame.assign(**{key: frame[key] * list(factors) for key in IN_UNIT}, unit=names)
    return Table(
        "table2", "Table II beside ours", TABLE2_CAPTION, frame[[c.key for c in TABLE2_COLUMNS]], TABLE2_COLUMNS
    )


def paper_row(name: str, values: np.ndarray, box: DataFrame) -> dict[str, object]:
    """Return the paper's line of one parameter; a value on the bound of our box, which is the paper's, is counted."""
    low, high = box.loc[name, ["low", "high"]].to_numpy(float)
    at_bound = int(np.count_nonzero(np.isclose(values, low) | np.isclose(values, high)))
    return {
        "setting": "measured arm", "variant": PAPER, "parameter": name, **spread(values), "low": low, "high": high,
        "n_at_bound": at_bound,
    }  # fmt: skip


def table2_row(group: DataFrame) -> dict[str, object]:
    records = [spread(v) for _, v in group.groupby("case", sort=False)["value"]]
    truths = group["truth"].dropna().unique()
    return {
        "truth": float(truths[0]) if truths.size == 1 else np.nan, **spread(group["value"]),
        "between": spread([r["mean"] for r in records])["deviation"],
        "within": float(np.sqrt(np.mean([r["deviation"] ** 2 for r in records]))), "bound": group["deviation"].median(),
        "low": group["low"].iloc[0], "high": group["high"].iloc[0], "n_at_bound": int(group["at_bound"].sum()),
    }  # fmt: skip


def spread(values: ArrayLike) -> dict[str, float]:
    """Return number, mean and deviation; the paper's Table II prints the last as "mean square error"."""
    sample = np.asarray(values, np.float64)
    return {"n": sample.size, "mean": float(sample.mean()), "deviation": float(sample.std(ddof=0))}


def table2_figure(estimates: DataFrame, published: DataFrame, colours: Mapping[str, int]) -> Any:
    from matplotlib.lines import Line2D

    names = list(dict.fromkeys(estimates["parameter"]))
    groups = list(dict.fromkeys(zip(estimates["variant"], estimates["setting"], strict=True)))
    figure, axes = panels(len(names), 2, 6.8, 1.6 + 0.5 * (len(groups) + 1))
    for i, (axis, name) in enumerate(zip(axes, names, strict=True)):
        own = estimates[estimates["parameter"] == name]
        factor, unit = shown(1.0, own["unit"].iloc[0])
        paper = factor * published.loc[published["parameter"] == name, "published"].to_numpy(float)
        axis.plot(paper, np.zeros(paper.size), "D", color="black", ms=5)
        for j, (variant, setting) in enumerate(groups):
            group = own[(own["variant"] == variant) & (own["setting"] == setting)]
            draw_group(axis, group, j + 1, factor, line_look(colours[variant])["color"])
        # the bounds of the search where they are near
        low, high = axis.get_xlim()
        for bound in (factor * own["low"].min(), factor * own["high"].max()):
            if low - 0.2 * (high - low) <= bound <= high + 0.2 * (high - low):
                axis.axvline(bound, color="black", ls=":", lw=1.0)
        row_names(axis, i, ["the paper", *(f"{v}\n{s}" for v, s in groups)])
        axis.set(ylim=(len(groups) + 0.6, -0.6), xlabel=labelled(name, unit))
        axis.tick_params(axis="y", labelsize=9)
    legend_below(figure, 4, [
        *mark_handles(dict.fromkeys(estimates["case"])),
        Line2D([], [], color="0.35", lw=1.0, label="truth"), Line2D([], [], color="0.86", lw=6, label="Cramer-Rao"),
        Line2D([], [], color="black", ls=":", lw=1.0, label="bound of the box"),
    ])  # fmt: skip
    return figure


def draw_group(axis: Any, group: DataFrame, height: int, factor: float, colour: str) -> None:
    records = list(dict.fromkeys(group["case"]))
    for k, record in enumerate(records):
        own = group[group["case"] == record]
        y = height + 0.5 * ((k + 0.5) / len(records) - 0.5)
        axis.plot(factor * own["value"], np.full(len(own), y), marker_of(k), ms=4, mfc="none", color=colour)
    truth, bound = group["truth"].median() * factor, group["deviation"].median() * factor
    if np.isfinite(truth) and np.isfinite(bound):
        axis.fill_betweenx([height - 0.4, height + 0.4], truth - bound, truth + bound, color="0.86", lw=0, zorder=0)
        axis.plot([truth, truth], [height - 0.4, height + 0.4], color="0.35", lw=1.0, zorder=1)
