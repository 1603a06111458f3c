"""Table II of the paper beside ours: mean and spread of repeated identifications."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pandas import DataFrame

from armid.report.document import Column, Figure, Part, Table
from armid.report.style import legend_below, line_look, mark_handles, marker_of, panels, row_names
from armid.study.analyses.analysis import N_RUNS, PAPER, PARAMETER, VARIANT, Analysis, Evidence
from armid.study.analyses.table1 import paper_layout
from armid.units import labelled, shown

COLUMNS = (
    Column("setting", "noise, window"), VARIANT, PARAMETER,
    Column("unit", "unit"), Column("truth", "truth", ".4f"), N_RUNS, Column("mean", "mean", ".4f"),
    Column("deviation", "standard deviation", ".2g"), Column("between", "between records", ".2g"),
    Column("within", "within a record", ".2g"), Column("bound", "Cramer-Rao", ".2g"), Column("low", "low", ".4g"),
    Column("high", "high", ".4g"), Column("n_at_bound", "at a bound", ".0f"),
)  # fmt: skip
IN_UNIT = ("truth", "mean", "deviation", "between", "within", "bound", "low", "high")
TABLE_CAPTION = (
    "mean and standard deviation (of the population, the paper's mean square error): over all runs. between records: "
    "of the means of the records, which their noise makes; within a record: among repeats on it, which the search "
    "makes. Cramer-Rao: median of the bound for one record. at a bound: runs that ended on the box, which then "
    "decides the value. The paper's lines are its five identifications of a real arm, ours are synthetic: the two "
    "need not agree."
)
FIGURE_CAPTION = (
    "Result of each run, one mark a record; the paper's identifications above as diamonds. The line is the truth of "
    "the synthetic records, the band one Cramer-Rao deviation around it; dotted lines are bounds of the box."
)


def parts(evidence: Evidence) -> Sequence[Part]:
    estimates, published = evidence.estimates, evidence.published
    if evidence.study.get("report") != "table2" or estimates.empty:
        return ()
    figure = Figure("table2", "Repeated identifications beside the paper's", FIGURE_CAPTION,
                    lambda: table2_figure(estimates, published, evidence.colours))  # fmt: skip
    layout = paper_layout(evidence, "Table II", with_truth=False)
    return layout, table2(estimates, published), figure


TABLE2 = Analysis("table2", "Table II of the paper beside ours", parts, "mean and spread, where the study asks for it")


def table2(estimates: DataFrame, published: DataFrame) -> Table:
    """Return one row per setting, variant and parameter, the paper's first."""
    units = dict(zip(estimates["parameter"], estimates["unit"], strict=True))
    box = estimates.drop_duplicates("parameter").set_index("parameter")[["low", "high"]]
    paper = published[published["parameter"].isin(units)].groupby("parameter", sort=False)["published"]
    rows = [paper_row(str(name), values.to_numpy(), box) for name, values in paper]
    keys = ["setting", "variant", "parameter"]
    rows += [dict(zip(keys, k, strict=True)) | one_row(g) for k, g in estimates.groupby(keys, sort=False)]
    frame = DataFrame(rows)
    factors, names = zip(*(shown(1.0, units[p]) for p in frame["parameter"]), strict=True)
    frame = frame.assign(**{key: frame[key] * list(factors) for key in IN_UNIT}, unit=names)
    return Table("table2", "Table II beside ours", TABLE_CAPTION, frame[[c.key for c in COLUMNS]], COLUMNS)


def paper_row(name: str, values: np.ndarray, box: DataFrame) -> dict[str, object]:
    """Return the paper's line of one parameter; a value on the bound of our box, which is the paper's, is counted."""
    low, high = box.loc[name, ["low", "high"]].to_numpy(float)
    at_bound = int(np.count_nonzero(np.isclose(values, low) | np.isclose(values, high)))
    return {
        "setting": "measured arm", "variant": PAPER, "parameter": name, **spread(values), "low": low, "high": high,
        "n_at_bound": at_bound,
    }  # fmt: skip


def one_row(group: DataFrame) -> dict[str, object]:
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
