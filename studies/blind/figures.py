"""Figures of a blind suite: answers, false alarms, errors, bias, sizes of groups and times, advice."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from pandas import DataFrame

from blind.tables import bias, matching_rows
from stand.score.judge import PARAMETERS

# Okabe and Ito's palette, told apart by colour-blind eyes.
GREEN, SKY, BLUE, PURPLE = "#009E73", "#56B4E9", "#0072B2", "#CC79A7"
YELLOW, ORANGE, VERMILION, GREY = "#F0E442", "#E69F00", "#D55E00", "0.75"
SETTINGS = {"axes.spines.top": False, "axes.spines.right": False, "font.size": 11}
# Judgements that readers may lump together, from good to bad.
LUMPS = {
    "right": (("right",), GREEN),
    "in a group": (("group",), SKY),
    "right and one more": (("right_with_extra",), BLUE),
    "one of two": (("half", "half_with_extra"), PURPLE),
    "unnamed term": (("empirical",), YELLOW),
    "part by a name": (("partial",), ORANGE),
    "nothing, or cannot tell": (("none", "cannot_tell"), GREY),
    "wrong or false": (("wrong", "claimed", "false_alarm"), VERMILION),
    "no report": (("missing",), "0.3"),
}
BEFORE, AFTER = "0.55", BLUE
# Errors below this [%] are drawn here.
SMALLEST = 1e-3


def save(figure: Figure, path: Path) -> None:
    """Write a figure; its bytes depend on what is drawn alone."""
    figure.savefig(path, dpi=120, metadata={"Software": None})


def new(width: float, height: float, rows: int = 1, columns: int = 1) -> tuple[Figure, list[Any]]:
    """Return a figure [inch] and its axes."""
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(width, height), layout="constrained")
        return figure, list(figure.subplots(rows, columns, squeeze=False).ravel())


def legend_below(figure: Figure, axis: Any, columns: int = 3) -> None:
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=columns, frameon=False)


def plain_ticks(axis: Any) -> None:
    """Write the numbers of a logarithmic axis as plain ones."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def answers_figure(answers: DataFrame) -> Figure:
    """Draw one bar a class, split by judgement. answers: class, n, and a column of numbers for each judgement."""
    figure, (axis,) = new(9.6, 1.9 + 0.46 * len(answers))
    left = np.zeros(len(answers))
    for label, (words, colour) in LUMPS.items():
        there = [w for w in words if w in answers]
        share = 100.0 * answers[there].sum(axis=1).to_numpy(float) / answers["n"].to_numpy(float)
        if share.any():
            axis.barh(range(len(answers)), share, left=left, color=colour, label=label, edgecolor="white", lw=0.6)
            left += share
    names = [f"{c} ({n})" for c, n in zip(answers["class"], answers["n"], strict=True)]
    axis.set_yticks(range(len(answers)), names)
    axis.set(ylim=(len(answers) - 0.5, -0.5), xlim=(0, 100), xlabel="campaigns [%]")
    legend_below(figure, axis, 4)
    return figure


def counts_figure(counts: Mapping[str, DataFrame], xlabel: str = "", framed: bool = False) -> Figure:
    """Draw numbers of campaigns as heat maps side by side, true effects down; the colour is the share of the row.

    counts: title -> numbers, all with the same rows. framed: whether a cell whose column is its row's name is framed.
    """
    rows, columns = next(iter(counts.values())).shape
    figure, axes = new(2.6 + 0.5 * columns * len(counts), 2.6 + 0.30 * rows, 1, len(counts))
    for axis, (title, numbers) in zip(axes, counts.items(), strict=True):
        shares = numbers.div(numbers.sum(axis=1).replace(0, np.nan), axis=0).fillna(0.0).to_numpy(float)
        axis.pcolormesh(shares, vmin=0.0, vmax=1.0, cmap="Blues", edgecolors="0.9", linewidth=0.5)
        for i, j in np.argwhere(numbers.to_numpy(int) > 0):
            ink = "white" if shares[i, j] > 0.55 else "0.1"
            axis.text(j + 0.5, i + 0.5, f"{numbers.iat[i, j]}", ha="center", va="center", fontsize=10, color=ink)
        for i, name in enumerate(numbers.index if framed else ()):
            if name in numbers.columns:
                axis.add_patch(mpl.patches.Rectangle((list(numbers.columns).index(name), i), 1, 1, fill=False,
                                                     edgecolor=VERMILION, lw=1.4))  # fmt: skip
        axis.set_title(title, fontsize="medium")
        axis.set(xlabel=xlabel, ylim=(rows, 0))
        axis.set_yticks(np.arange(rows) + 0.5, numbers.index if axis is axes[0] else [""] * rows)
        axis.set_xticks(np.arange(columns) + 0.5, numbers.columns, rotation=50, ha="right", rotation_mode="anchor")
        axis.tick_params(length=0)
    axes[0].set_ylabel("true effect")
    return figure


def alarms_figure(alarms: DataFrame, limit: float) -> Figure:
    """Draw false alarms with their Wilson intervals. alarms: noise, n, rate, low, high; limit: what is aimed at."""
    figure, (axis,) = new(7.2, 1.5 + 0.42 * len(alarms))
    rate, low, high = (100.0 * alarms[key].to_numpy(float) for key in ("rate", "low", "high"))
    errors = np.array([rate - low, high - rate]).clip(min=0.0)
    axis.axvline(100.0 * limit, color=ORANGE, ls="--", lw=1.3, label=f"target {100 * limit:g} %")
    axis.errorbar(rate, range(len(alarms)), xerr=errors, fmt="o", ms=6, lw=1.6, color=BLUE)
    axis.set_yticks(range(len(alarms)), [f"{k} noise ({n})" for k, n in zip(alarms["noise"], alarms["n"], strict=True)])
    axis.set(ylim=(len(alarms) - 0.5, -0.5), xlabel="false alarms [%], with 95 % interval")
    axis.set_xlim(left=-0.3)
    axis.legend(frameon=False, loc="upper right")
    return figure


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
        plain_ticks(axis.yaxis)
    for axis in axes[len(parts) :]:
        axis.set_axis_off()
    legend_below(figure, axes[0])
    return figure


def bias_figure(rows: DataFrame, limit: float) -> Figure:
    """Draw the size of the relative errors of each parameter before and after [%], a panel for each kind of form."""
    forms = {t: matching_rows(rows, m) for t, m in (("matching form", True), ("other form", False))}
    forms = {t: part for t, part in forms.items() if len(part)}
    figure, axes = new(6.0 * len(forms), 4.6, 1, len(forms))
    for axis, (title, part) in zip(axes, forms.items(), strict=True):
        for i, (when, colour) in enumerate((("before", BEFORE), ("after", AFTER))):
            values = [np.maximum(100.0 * bias(part, when, (p,)), SMALLEST) for p in PARAMETERS]
            axis.boxplot(
                values, positions=np.arange(len(PARAMETERS)) + 0.36 * (i - 0.5), widths=0.3, whis=(5, 95),
                patch_artist=True, manage_ticks=False, boxprops={"facecolor": colour, "alpha": 0.55, "lw": 1.0},
                medianprops={"color": "black", "lw": 1.8},
                flierprops={"marker": ".", "ms": 4, "markerfacecolor": colour, "markeredgecolor": "none"},
            )  # fmt: skip
            axis.plot([], [], "s", ms=8, color=colour, label=when)
        axis.axhline(100.0 * limit, color=ORANGE, ls="--", lw=1.2, label=f"target {100 * limit:g} %")
        axis.set_xticks(range(len(PARAMETERS)), PARAMETERS)
        axis.set(yscale="log", ylabel="relative error [%]", title=f"{title} ({len(part)} campaigns)")
        axis.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.sharey(axes[0]) if axis is not axes[0] else None
    legend_below(figure, axes[0])
    return figure


def sizes_and_times_figure(groups: DataFrame, rows: DataFrame) -> Figure:
    """Draw the sizes of groups, and the times to close a campaign where rows hold seconds and cpu_seconds."""
    timed = "seconds" in rows
    figure, axes = new(11.2 if timed else 5.6, 3.6, 1, 1 + timed)
    place = np.arange(len(groups))
    axes[0].bar(place - 0.19, groups["right"], 0.38, color=GREEN, label="holds the truth")
    axes[0].bar(place + 0.19, groups["wrong"], 0.38, color=VERMILION, label="does not")
    axes[0].set_xticks(place, [str(s) for s in groups["size"]])
    axes[0].set(xlabel="effects in the group", ylabel="campaigns")
    axes[0].legend(frameon=False)
    for key, label, colour in (("seconds", "wall", BLUE), ("cpu_seconds", "processor", ORANGE)) if timed else ():
        values = np.sort(rows[key].dropna().to_numpy(float))
        axes[1].step(
            values, 100.0 * np.arange(1, values.size + 1) / values.size, where="post", color=colour, label=label
        )
    if timed:
        axes[1].axvline(30.0, color="0.4", ls="--", lw=1.2)
        axes[1].set(
            xlabel="time to close a campaign, one thread [s]", ylabel="campaigns [%]", xscale="log", ylim=(0, 102)
        )
        plain_ticks(axes[1].xaxis)
        axes[1].legend(frameon=False, loc="lower right")
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
