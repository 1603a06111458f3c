"""Errors held out and parameters, before and after the loop."""

from typing import Any

import numpy as np
from pandas import DataFrame

from armid.study.figures.style import COLOURS, panels
from armid.study.loops.targets import PARAMETERS, matching_rows

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
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter  # noqa: PLC0415 - takes time to import

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
    from matplotlib.ticker import StrMethodFormatter  # noqa: PLC0415 - takes time to import

    axis.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
