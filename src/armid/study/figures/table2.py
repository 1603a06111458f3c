"""Repeated identifications beside the paper's five."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.display import SHOWN
from armid.study.figures.style import COLOURS, MARKERS, panels


def table2_figure(estimates: DataFrame, published: DataFrame) -> Any:
    """Draw one panel a parameter: the result of each run, a mark and colour a record, lines by identifier and setting.

    estimates: one row a run and parameter; published: the paper's identifications, one row a record and parameter, SI.
    The grey band is the truth +- the Cramer-Rao bound of one record, dashed lines are the bounds of the box.
    """
    names = list(dict.fromkeys(estimates["parameter"]))
    groups = list(dict.fromkeys(zip(estimates["variant"], estimates["setting"], strict=True)))
    labels = [f"{v}\n{s}" for v, s in groups]
    figure, axes = panels(len(names), 2, 6.8, 1.6 + 0.5 * (len(groups) + 1))
    for i, (axis, name) in enumerate(zip(axes, names, strict=True)):
        own = estimates[estimates["parameter"] == name]
        unit, factor = SHOWN.get(own["unit"].iloc[0], (own["unit"].iloc[0], 1.0))
        draw_paper(axis, factor * published.loc[published["parameter"] == name, "published"].to_numpy(float))
        for j, (variant, setting) in enumerate(groups):
            draw_group(axis, own[(own["variant"] == variant) & (own["setting"] == setting)], j + 1, factor)
        draw_box(axis, own, factor)
        axis.set_yticks(range(len(groups) + 1), ["the paper", *labels] if i % 2 == 0 else [""] * (len(groups) + 1))
        axis.set(ylim=(len(groups) + 0.6, -0.6), xlabel=f"{name} [{unit}]")
        axis.tick_params(axis="y", labelsize=9)
    name_records(figure, list(dict.fromkeys(estimates["case"])))
    return figure


def draw_paper(axis: Any, values: np.ndarray) -> None:
    """Draw the paper's identifications as diamonds."""
    axis.plot(values, np.zeros(values.size), "D", color="black", ms=5)


def draw_group(axis: Any, group: DataFrame, height: int, factor: float) -> None:
    """Draw the runs of one identifier and setting, the records above each other, truth and bound behind."""
    records = list(dict.fromkeys(group["case"]))
    for k, record in enumerate(records):
        own = group[group["case"] == record]
        y = height + 0.5 * ((k + 0.5) / len(records) - 0.5)
        axis.plot(factor * own["value"], np.full(len(own), y), MARKERS[k % 7], ms=4, mfc="none",
                  color=COLOURS[k % 7])  # fmt: skip
    truth, bound = group["truth"].median() * factor, group["deviation"].median() * factor
    if np.isfinite(truth) and np.isfinite(bound):
        axis.fill_betweenx([height - 0.4, height + 0.4], truth - bound, truth + bound, color="0.86", lw=0, zorder=0)
        axis.plot([truth, truth], [height - 0.4, height + 0.4], color="0.35", lw=1.0, zorder=1)


def draw_box(axis: Any, own: DataFrame, factor: float) -> None:
    """Draw the bounds of the search where they are near."""
    low, high = axis.get_xlim()
    for bound in (factor * own["low"].min(), factor * own["high"].max()):
        if low - 0.2 * (high - low) <= bound <= high + 0.2 * (high - low):
            axis.axvline(bound, color="black", ls=":", lw=1.0)


def name_records(figure: Any, records: Sequence[str]) -> None:
    """Write one legend below all panels."""
    from matplotlib.lines import Line2D  # noqa: PLC0415 - takes time to import

    handles = [
        Line2D([], [], color=COLOURS[k % 7], marker=MARKERS[k % 7], mfc="none", ls="", label=record)
        for k, record in enumerate(records)
    ]
    handles += [
        Line2D([], [], color="0.35", lw=1.0, label="truth"), Line2D([], [], color="0.86", lw=6, label="Cramer-Rao"),
        Line2D([], [], color="black", ls=":", lw=1.0, label="bound of the box"),
    ]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
