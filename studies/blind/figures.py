"""Figures of a blind suite: errors on records held out, advice."""

import math
from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from pandas import DataFrame

# Of Okabe and Ito's palette, told apart by colour-blind eyes.
BLUE, ORANGE = "#0072B2", "#E69F00"
SETTINGS = {"axes.spines.top": False, "axes.spines.right": False, "font.size": 11}
BEFORE, AFTER = "0.55", BLUE


def new(width: float, height: float, rows: int = 1, columns: int = 1) -> tuple[Figure, list[Any]]:
    """Return a figure [inch] and its axes."""
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(width, height), layout="constrained")
        return figure, list(figure.subplots(rows, columns, squeeze=False).ravel())


def legend_below(figure: Figure, axis: Any, columns: int = 3) -> None:
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=columns, frameon=False)


def held_out_figure(parts: Mapping[str, DataFrame], limit: float) -> Figure:
    """Draw the error held out over its noise before and after, a panel a class, campaigns by what was left before."""
    columns = min(3, len(parts))
    n_rows = math.ceil(len(parts) / columns)
    figure, axes = new(4.6 * columns, 3.2 * n_rows + 0.4, n_rows, columns)
    highest = max(float(part[["before_over_floor", "after_over_floor"]].max().max()) for part in parts.values())
    for axis, (label, known) in zip(axes, parts.items(), strict=False):
        part, place = known.sort_values("before_over_floor"), np.arange(1, len(known) + 1)
        before, after = part["before_over_floor"].to_numpy(float), part["after_over_floor"].to_numpy(float)
        axis.vlines(place, after, before, color="0.85", lw=0.8, zorder=1)
        axis.plot(place, before, "o", ms=3.5, color=BEFORE, label="before", zorder=2)
        axis.plot(place, after, "o", ms=3.5, color=AFTER, label="after", zorder=3)
        axis.axhline(limit, color=ORANGE, ls="--", lw=1.2, label=f"target {limit:g}")
        axis.set(yscale="log", ylim=(0.9, max(3.0, 1.2 * highest)), ylabel="held-out error / noise")
        axis.set(xlim=(0.0, len(part) + 1.0), xticks=[], xlabel=f"{len(part)} campaigns, by their error before")
        axis.set_title(label, fontsize="small")
        axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.yaxis.set_minor_formatter(NullFormatter())
    for axis in axes[len(parts) :]:
        axis.set_axis_off()
    legend_below(figure, axes[0])
    return figure


def advice_figure(found: DataFrame, limit: float) -> Figure:
    """Draw one row a pair: share told apart by the advised and by the random record, with Wilson intervals.

    found: pair, n, and advised, random with _low and _high. limit: what is aimed at.
    """
    figure, (axis,) = new(8.6, 1.8 + 0.5 * len(found))
    axis.axvline(100.0 * limit, color="0.4", ls="--", lw=1.2, label=f"target {100 * limit:g} %")
    for i, (choice, colour) in enumerate((("advised", BLUE), ("random", ORANGE))):
        rate, low, high = (100.0 * found[f"{choice}{end}"].to_numpy(float) for end in ("", "_low", "_high"))
        errors = np.array([rate - low, high - rate]).clip(min=0.0)
        place = np.arange(len(found)) + 0.14 * (2 * i - 1)
        axis.errorbar(rate, place, xerr=errors, fmt="os"[i], ms=6, lw=1.6, color=colour, label=f"{choice} record")
    axis.set_yticks(range(len(found)), [f"{p} ({n})" for p, n in zip(found["pair"], found["n"], strict=True)])
    axis.set(ylim=(len(found) - 0.5, -0.5), xlim=(-2, 102), xlabel="told apart [%], with 95 % interval")
    legend_below(figure, axis)
    return figure
