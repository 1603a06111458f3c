"""How often closed loops are right, silent or wrong, class by class; false alarms; sizes of groups."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.report.style import OKABE_ITO
from armid.study.analyses.drawing import COLOURS, panels, pyplot
from armid.study.blind.scores import PARAMETERS, matching_rows

BEFORE, AFTER = "0.55", COLOURS[0]
# Errors below this [%] are drawn here.
SMALLEST = 1e-3
# The axis of ratios reaches at least from here to there.
RATIOS = (0.9, 3.0)


def held_out_figure(parts: dict[str, DataFrame], limit: float) -> Any:
    """Draw the error held out over its noise before and after, one panel a class, campaigns in order of what was left.

    parts: class -> campaigns with before_over_floor and after_over_floor.
    """
    known = {label: part.dropna(subset=["after_over_floor"]) for label, part in parts.items()}
    known = {label: part.sort_values("before_over_floor") for label, part in known.items() if len(part)}
    if not known:
        return None
    figure, axes = panels(len(known), 3, 4.6, 3.2)
    highest = max(float(part[["before_over_floor", "after_over_floor"]].max().max()) for part in known.values())
    for axis, (label, part) in zip(axes, known.items(), strict=True):
        place = np.arange(1, len(part) + 1)
        before, after = part["before_over_floor"].to_numpy(float), part["after_over_floor"].to_numpy(float)
        axis.vlines(place, after, before, color="0.85", lw=0.8, zorder=1)
        axis.plot(place, before, "o", ms=3.5, color=BEFORE, label="before", zorder=2)
        axis.plot(place, after, "o", ms=3.5, color=AFTER, label="after", zorder=3)
        axis.axhline(limit, color=COLOURS[1], ls="--", lw=1.2, label=f"target {limit:g}")
        axis.set(yscale="log", ylim=(RATIOS[0], max(RATIOS[1], 1.2 * highest)), ylabel="held-out error / noise")
        axis.set(xlim=(0.0, len(part) + 1.0), xticks=[], xlabel=f"{len(part)} campaigns, by their error before")
        axis.set_title(label, fontsize="small")
        plain_ticks(axis.yaxis)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def plain_ticks(axis: Any) -> None:
    """Write the numbers of a logarithmic axis as plain ones."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def bias_figure(rows: DataFrame, limit: float) -> Any:
    """Draw the size of the relative errors of each parameter before and after [%], a panel for each kind of form."""
    forms = {t: matching_rows(rows, m) for t, m in (("matching form", True), ("other form", False))}
    forms = {t: part for t, part in forms.items() if len(part)}
    if not forms:
        return None
    figure, axes = panels(len(forms), 2, 6.0, 4.2)
    for axis in axes[1:]:
        axis.sharey(axes[0])
    for axis, (title, part) in zip(axes, forms.items(), strict=True):
        for i, (when, colour) in enumerate((("before", BEFORE), ("after", AFTER))):
            values = [np.maximum(100.0 * part[f"bias_{when}_{p}"].astype(float).abs(), SMALLEST) for p in PARAMETERS]
            draw_boxes(axis, values, np.arange(len(PARAMETERS)) + 0.36 * (i - 0.5), colour)
            axis.plot([], [], "s", ms=8, color=colour, label=when)
        axis.axhline(100.0 * limit, color=COLOURS[1], ls="--", lw=1.2, label=f"target {100 * limit:g} %")
        axis.set_xticks(range(len(PARAMETERS)), PARAMETERS)
        axis.set(yscale="log", ylabel="relative error [%]", title=f"{title} ({len(part)} campaigns)")
        plain_decades(axis)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def draw_boxes(axis: Any, values: list[Any], places: Any, colour: str) -> None:
    """Draw boxes over the quartiles, whiskers from the 5th to the 95th percentile, and what lies beyond as dots."""
    axis.boxplot(
        values, positions=places, widths=0.3, whis=(5, 95), patch_artist=True, manage_ticks=False,
        boxprops={"facecolor": colour, "alpha": 0.55, "lw": 1.0}, medianprops={"color": "black", "lw": 1.8},
        flierprops={"marker": ".", "ms": 4, "markerfacecolor": colour, "markeredgecolor": "none"},
    )  # fmt: skip


def plain_decades(axis: Any) -> None:
    """Write decades of percent as plain numbers."""
    from matplotlib.ticker import StrMethodFormatter

    axis.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


# Judgements that readers may lump together, from good to bad.
LUMPS: dict[str, tuple[tuple[str, ...], str]] = {
    "right": (("right",), OKABE_ITO["green"]),
    "in a group": (("group",), OKABE_ITO["sky"]),
    "right and one more": (("right_with_extra",), OKABE_ITO["blue"]),
    "one of two": (("half", "half_with_extra"), OKABE_ITO["purple"]),
    "unnamed term": (("empirical",), OKABE_ITO["yellow"]),
    "part by a name": (("partial",), OKABE_ITO["orange"]),
    "nothing, or cannot tell": (("none", "cannot_tell"), "0.75"),
    "wrong or false": (("wrong", "claimed", "false_alarm"), OKABE_ITO["vermilion"]),
    "no report": (("missing",), "0.3"),
}


def rates_figure(answers: DataFrame) -> Any:
    """Draw one bar a class, split by judgement. answers: class, n, and a column of numbers for each judgement."""
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(9.6, 1.9 + 0.46 * len(answers)), layout="constrained")
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
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    return figure


def alarms_figure(alarms: DataFrame, limit: float) -> Any:
    """Draw false alarms with their Wilson intervals. alarms: noise, n, rate, low, high; limit: what is aimed at."""
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(7.2, 1.5 + 0.42 * len(alarms)), layout="constrained")
    rate, low, high = (100.0 * alarms[key].to_numpy(float) for key in ("rate", "low", "high"))
    errors = np.array([rate - low, high - rate]).clip(min=0.0)
    axis.axvline(100.0 * limit, color=COLOURS[1], ls="--", lw=1.3, label=f"target {100 * limit:g} %")
    axis.errorbar(rate, range(len(alarms)), xerr=errors, fmt="o", ms=6, lw=1.6, color=COLOURS[0])
    axis.set_yticks(range(len(alarms)), [f"{k} noise ({n})" for k, n in zip(alarms["noise"], alarms["n"], strict=True)])
    axis.set(ylim=(len(alarms) - 0.5, -0.5), xlabel="false alarms [%], with 95 % interval")
    axis.set_xlim(left=-0.3)
    axis.legend(frameon=False, loc="upper right")
    return figure


def sizes_and_times_figure(groups: DataFrame, seconds: DataFrame) -> Any:
    """Draw the sizes of groups, and the times to close a campaign. seconds: class, seconds, cpu_seconds."""
    figure, (left, right) = panels(2, 2, 5.6, 3.6)
    width = 0.38
    place = np.arange(len(groups))
    left.bar(place - width / 2, groups["right"], width, color=OKABE_ITO["green"], label="holds the truth")
    left.bar(place + width / 2, groups["wrong"], width, color=OKABE_ITO["vermilion"], label="does not")
    left.set_xticks(place, [str(s) for s in groups["size"]])
    left.set(xlabel="effects in the group", ylabel="campaigns")
    left.legend(frameon=False)
    for i, (key, label) in enumerate((("seconds", "wall"), ("cpu_seconds", "processor"))):
        values = np.sort(seconds[key].to_numpy(float))
        shares = 100.0 * np.arange(1, values.size + 1) / max(values.size, 1)
        right.step(values, shares, where="post", color=COLOURS[i], label=label)
    right.axvline(30.0, color="0.4", ls="--", lw=1.2)
    right.set(xlabel="time to close a campaign, one thread [s]", ylabel="campaigns [%]", xscale="log", ylim=(0, 102))
    plain_ticks(right.xaxis)
    right.legend(frameon=False, loc="lower right")
    return figure


CELL, WIDE = 0.30, 0.62
# Shares of a row below this are pale enough for dark numbers.
DARK = 0.55


def answers_figure(counts: Mapping[str, DataFrame]) -> Any:
    """Draw one panel a group of campaigns: true effects down, answers across, numbers of campaigns in the cells.

    counts: title -> numbers, one row a true effect and one column an answer. The colour is the share of the row.
    """
    plt = pyplot()
    rows = max(len(c) for c in counts.values())
    columns = max(c.shape[1] for c in counts.values())
    size = (2.6 + WIDE * columns * len(counts), 2.4 + CELL * rows)
    figure, axes = plt.subplots(1, len(counts), figsize=size, squeeze=False, layout="constrained")
    for axis, (title, numbers) in zip(axes.ravel(), counts.items(), strict=True):
        draw(axis, numbers, title, names=axis is axes[0, 0])
    axes[0, 0].set_ylabel("true effect")
    return figure


def names_figure(numbers: DataFrame) -> Any:
    """Draw true effects down and what was named first across, with numbers of campaigns in the cells."""
    plt = pyplot()
    size = (2.8 + 0.36 * numbers.shape[1], 2.6 + CELL * len(numbers))
    figure, axis = plt.subplots(figsize=size, layout="constrained")
    draw(axis, numbers, "")
    axis.set(xlabel="named first", ylabel="true effect")
    for i, name in enumerate(numbers.index):
        if name in numbers.columns:
            place = (list(numbers.columns).index(name), i)
            axis.add_patch(plt.Rectangle(place, 1, 1, fill=False, edgecolor="#D55E00", lw=1.4))
    return figure


def draw(axis: Any, numbers: DataFrame, title: str, names: bool = True) -> None:
    """Draw counts as a heat map whose colour is the share of the row; empty cells carry no number.

    names: whether the rows are named.
    """
    import seaborn as sns

    sums = numbers.sum(axis=1).replace(0, np.nan)
    shares = numbers.div(sums, axis=0).fillna(0.0)
    sns.heatmap(shares, ax=axis, vmin=0.0, vmax=1.0, cmap="Blues", cbar=False, linewidths=0.5, linecolor="0.9",
                xticklabels=True, yticklabels=names)  # fmt: skip
    counts, dark = numbers.to_numpy(int), shares.to_numpy(float) > DARK
    for i, j in np.argwhere(counts > 0):
        ink = "white" if dark[i, j] else "0.1"
        axis.text(j + 0.5, i + 0.5, f"{counts[i, j]}", ha="center", va="center", fontsize=10, color=ink)
    axis.set(xlabel="", ylabel="")
    axis.set_title(title, fontsize="medium")
    axis.tick_params(length=0)
    axis.set_yticklabels(axis.get_yticklabels(), rotation=0)
    axis.set_xticklabels(axis.get_xticklabels(), rotation=50, ha="right", rotation_mode="anchor")


APART = 0.14


def advice_figure(found: DataFrame, limit: float) -> Any:
    """Draw one row a pair: share told apart by the advised and by the random record, with Wilson intervals.

    found: pair, n, and advised, random with _low and _high. limit: what is aimed at.
    """
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(8.6, 1.8 + 0.5 * len(found)), layout="constrained")
    axis.axvline(100.0 * limit, color="0.4", ls="--", lw=1.2, label=f"target {100 * limit:g} %")
    for i, choice in enumerate(("advised", "random")):
        rate, low, high = (100.0 * found[f"{choice}{end}"].to_numpy(float) for end in ("", "_low", "_high"))
        place = np.arange(len(found)) + APART * (2 * i - 1)
        errors = np.array([rate - low, high - rate]).clip(min=0.0)
        axis.errorbar(rate, place, xerr=errors, fmt="os"[i], ms=6, lw=1.6, color=COLOURS[i], label=f"{choice} record")
    axis.set_yticks(range(len(found)), [f"{p} ({n})" for p, n in zip(found["pair"], found["n"], strict=True)])
    axis.set(ylim=(len(found) - 0.5, -0.5), xlim=(-2, 102), xlabel="told apart [%], with 95 % interval")
    figure.get_layout_engine().set(w_pad=0.12)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure
