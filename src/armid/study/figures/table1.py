"""Our errors on Table I beside the paper's."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.study.figures.style import COLOURS, panels

FLOOR = 1e-9


def table1_figure(estimates: DataFrame, published: DataFrame, variants: Sequence[str]) -> Any:
    """Draw one panel a parameter: our relative errors [%] of all rows and seeds as boxes, the paper's as diamonds.

    estimates: one row a run and parameter; published: the paper's values with their errors; variants: top to bottom.
    The box spans the quartiles, the whiskers the 5th to the 95th percentile, dots are the runs beyond.
    """
    names = [n for n in dict.fromkeys(published["parameter"]) if n in set(estimates["parameter"])]
    settings = list(dict.fromkeys(estimates["setting"]))
    figure, axes = panels(len(names), 2, 6.8, 1.5 + (0.16 + 0.19 * len(settings)) * len(variants))
    for i, (axis, name) in enumerate(zip(axes, names, strict=True)):
        own = estimates[estimates["parameter"] == name]
        for j, setting in enumerate(settings):
            draw_boxes(axis, own[own["setting"] == setting], variants, j, len(settings))
        draw_paper(axis, 100.0 * published.loc[published["parameter"] == name, "relative_error"].to_numpy())
        axis.set_yticks(range(len(variants)), variants if i % 2 == 0 else [""] * len(variants))
        axis.set(xscale="log", ylim=(len(variants) - 0.4, -0.6), title=name, xlabel="relative error [%]")
        axis.grid(axis="x", alpha=0.3)
    name_colours(figure, settings)
    return figure


def draw_boxes(axis: Any, own: DataFrame, variants: Sequence[str], j: int, n: int) -> None:
    """Draw the boxes of one setting, a little apart from those of the others."""
    samples = [100.0 * own.loc[own["variant"] == v, "relative_error"].to_numpy() for v in variants]
    shown = [(i, np.maximum(s, FLOOR)) for i, s in enumerate(samples) if s.size]
    width = 0.7 / n
    places = [i + width * (j - (n - 1) / 2.0) for i, _ in shown]
    colour = COLOURS[j % len(COLOURS)]
    line = {"color": colour, "lw": 1.2}
    axis.boxplot(
        [s for _, s in shown], positions=places, orientation="horizontal", whis=(5, 95), widths=0.8 * width,
        manage_ticks=False, medianprops={"color": colour, "lw": 2.4}, boxprops=line, whiskerprops=line, capprops=line,
        flierprops={"marker": ".", "ms": 2.5, "mfc": colour, "mec": "none", "alpha": 0.6},
    )  # fmt: skip


def draw_paper(axis: Any, errors: np.ndarray) -> None:
    """Draw the paper's errors as diamonds on top, and their mean as a line through all."""
    axis.axvline(errors.mean(), color="black", lw=1.2, ls="--", zorder=0)
    axis.plot(np.maximum(errors, FLOOR), np.full(errors.size, -0.5), "D", color="black", ms=5, clip_on=False, zorder=5)


def name_colours(figure: Any, settings: Sequence[str]) -> None:
    """Write one legend below all panels."""
    from matplotlib.lines import Line2D  # noqa: PLC0415 - takes time to import

    handles = [Line2D([], [], color=COLOURS[j % 7], lw=3, label=f"ours, {s}") for j, s in enumerate(settings)]
    paper = "the paper: its rows, and their mean"
    handles.append(Line2D([], [], color="black", marker="D", ls="--", lw=1.2, label=paper))
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
