"""Success rates with their intervals."""

from typing import Any

import numpy as np
from pandas import DataFrame

from armid.study.figures.style import COLOURS, MARKERS, panels

APART = 0.24


def success_figure(rates: DataFrame) -> Any:
    """Draw one panel a setting, one line a variant, one colour a tolerance, with Wilson intervals.

    rates: setting, variant, tolerance, rate, low, high.
    """
    settings = list(dict.fromkeys(rates["setting"]))
    variants = sorted_variants(rates)
    figure, axes = panels(len(settings), 2, 6.8, 1.6 + 0.36 * len(variants))
    for i, (axis, setting) in enumerate(zip(axes, settings, strict=True)):
        own = rates[rates["setting"] == setting]
        for j, (tolerance, group) in enumerate(own.groupby("tolerance", sort=False)):
            draw(axis, group, variants, j, f"within {100 * float(str(tolerance)):g} %")
        axis.set_yticks(range(len(variants)), variants if i % 2 == 0 else [""] * len(variants))
        axis.set_ylim(len(variants) - 0.5, -0.5)
        axis.set_xlim(-2, 102)
        axis.set_xlabel("runs that succeed [%]")
        axis.set_title(setting)
        axis.grid(axis="x", alpha=0.4)
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=3, frameon=False)
    return figure


def sorted_variants(rates: DataFrame) -> list[str]:
    """Return the variants, the most successful first."""
    sums = rates.groupby("variant", sort=False)["rate"].mean()
    return [str(v) for v in sums.sort_values(ascending=False, kind="stable").index]


def draw(axis: Any, group: DataFrame, variants: list[str], j: int, label: str) -> None:
    """Draw the rates of one tolerance."""
    heights = group["variant"].map({v: i for i, v in enumerate(variants)}).to_numpy(float) + APART * (j - 1)
    rate, low, high = (100.0 * group[key].to_numpy() for key in ("rate", "low", "high"))
    errors = np.array([rate - low, high - rate]).clip(min=0.0)
    axis.errorbar(rate, heights, xerr=errors, fmt=MARKERS[j], ms=5, lw=1.4, color=COLOURS[j], label=label)
