"""Scatter over the Cramer-Rao bound."""

from typing import Any

import numpy as np
from pandas import DataFrame

from armid.study.figures.style import COLOURS, MARKERS, panels
from armid.study.metrics import EFFICIENT

# Ratios above it ask for a logarithmic axis.
LARGEST_LINEAR = 4.0


def cramer_rao_figure(found: DataFrame) -> Any:
    """Draw one panel a parameter: standard deviation over bound with its 95 % interval, a colour a case.

    found: setting, variant, case, parameter, ratio, low, high. The band is 0.9 to 1.1.
    """
    names = list(dict.fromkeys(found["parameter"]))
    groups = list(dict.fromkeys(zip(found["variant"], found["setting"], strict=True)))
    cases = list(dict.fromkeys(found["case"]))
    figure, axes = panels(len(names), 2, 6.8, 1.6 + 0.5 * len(groups))
    for i, (axis, name) in enumerate(zip(axes, names, strict=True)):
        axis.axvspan(*EFFICIENT, color="0.88", lw=0, zorder=0)
        axis.axvline(1.0, color="0.4", lw=1.0, zorder=1)
        for k, case in enumerate(cases):
            draw_case(axis, found[(found["parameter"] == name) & (found["case"] == case)], groups, k, len(cases))
        labels = [f"{v}\n{s}" for v, s in groups]
        axis.set_yticks(range(len(groups)), labels if i % 2 == 0 else [""] * len(groups))
        axis.set(ylim=(len(groups) - 0.5, -0.5), xlabel=f"{name}: standard deviation / bound")
        if found["high"].max() > LARGEST_LINEAR:
            log_with_plain_ticks(axis)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(8, len(cases)), frameon=False)
    return figure


def draw_case(axis: Any, own: DataFrame, groups: list[tuple[str, str]], k: int, n: int) -> None:
    """Draw the ratios of one case, a little apart from those of the others."""
    place = {group: i for i, group in enumerate(groups)}
    y = [place[v, s] + 0.7 * ((k + 0.5) / n - 0.5) for v, s in zip(own["variant"], own["setting"], strict=True)]
    ratio, low, high = (own[key].to_numpy() for key in ("ratio", "low", "high"))
    errors = np.array([ratio - low, high - ratio])
    axis.errorbar(ratio, y, xerr=errors, fmt=MARKERS[k % 7], ms=4.5, lw=1.3, color=COLOURS[k % 7],
                  label=str(own["case"].iloc[0]) if len(own) else None)  # fmt: skip


def log_with_plain_ticks(axis: Any) -> None:
    """Make the axis logarithmic and write ratios as plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter  # noqa: PLC0415 - takes time to import

    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.xaxis.set_minor_formatter(NullFormatter())
