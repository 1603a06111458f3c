"""What closed loops answered, true effect by true effect."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.study.figures.style import pyplot

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
    import seaborn as sns  # noqa: PLC0415 - takes time to import, and only figures need it

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
