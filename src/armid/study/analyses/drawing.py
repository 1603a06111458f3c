"""What figures of a study share beyond the house style: names beside lines, names of rows, one legend."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armid.report.style import INK, look

# Where names stand beside the axes, as shares of their width; the distance between two [inch], and what an upright
# panel needs beside its axes [inch].
BESIDE, SAMPLE, GAP = 1.045, 0.055, 0.012
APART_INCH, FRAME_INCH, LEAST_HEIGHT = 0.235, 1.0, 4.6


def panel_height(n_lines: int) -> float:
    return max(LEAST_HEIGHT, FRAME_INCH + APART_INCH * n_lines)


def row_names(axis: Any, i: int, names: Sequence[str]) -> None:
    """Name the rows of the i-th panel, two panels side by side: the left one carries the names."""
    axis.set_yticks(range(len(names)), names if i % 2 == 0 else [""] * len(names))


def legend_below(figure: Any, ncols: int, handles: Sequence[Any] | None = None) -> None:
    """Write one legend below all panels. handles: None takes those of the first panel."""
    if handles is None:
        handles = figure.axes[0].get_legend_handles_labels()[0]
    labels = [handle.get_label() for handle in handles]
    figure.legend(handles, labels, loc="outside lower center", ncols=ncols, frameon=False)


def named_lines(axis: Any, x: ArrayLike, lines: Mapping[str, ArrayLike], colours: Mapping[str, int]) -> None:
    """Draw lines over a common x and name each beside its end, in the order of the ends.

    colours: name -> number of its colour and dashes, so that a name looks alike in all figures.
    """
    draw_lines(axis, x, lines, colours)
    values = {name: np.asarray(y, float) for name, y in lines.items()}
    finite = {name: y[np.isfinite(y)] for name, y in values.items()}
    # lines that end alike are ordered by what they did before
    names = sorted((n for n in lines if finite[n].size), key=lambda n: (finite[n][-1], finite[n].sum()))
    low, high = axis.get_ylim()
    heights = [float(np.clip((finite[n][-1] - low) / (high - low), 0.0, 1.0)) for n in names]
    for name, height, place in zip(names, heights, spread(heights, name_distance(axis)), strict=True):
        colour = look(colours[name])["color"]
        axis.plot([1.0, BESIDE], [height, place], transform=axis.transAxes, color=colour, lw=0.7, clip_on=False)
        write_name(axis, name, place, colours)


def listed_lines(axis: Any, x: ArrayLike, lines: Mapping[str, ArrayLike], colours: Mapping[str, int],
                 names: Sequence[str]) -> None:  # fmt: skip
    """Draw lines over a common x and list their names beside the axes from the top, in the order given."""
    draw_lines(axis, x, lines, colours)
    for i, name in enumerate(names):
        write_name(axis, name, 1.0 - name_distance(axis) * (i + 0.5), colours)


def draw_lines(axis: Any, x: ArrayLike, lines: Mapping[str, ArrayLike], colours: Mapping[str, int]) -> None:
    # the axes keep the upright range that they have
    axis.set_ylim(*axis.get_ylim())
    for name, y in lines.items():
        axis.plot(x, y, lw=1.7, **look(colours[name]))
    axis.margins(x=0.0)


def write_name(axis: Any, name: str, place: float, colours: Mapping[str, int]) -> None:
    """Write a name beside the axes with a sample of its line."""
    there = {"transform": axis.transAxes, "clip_on": False}
    axis.plot([BESIDE, BESIDE + SAMPLE], [place, place], lw=1.9, **there, **look(colours[name]))
    axis.text(BESIDE + SAMPLE + GAP, place, name, transform=axis.transAxes, color=INK, va="center", fontsize=10)


def name_distance(axis: Any) -> float:
    """Return the distance of two names as a share of the height of the axes."""
    grid = axis.get_subplotspec().get_gridspec()
    return float(APART_INCH / (axis.figure.get_size_inches()[1] / grid.nrows - FRAME_INCH))


def spread(heights: Iterable[float], apart: float) -> list[float]:
    """Return rising heights moved at least so far apart, as little as it takes in the sense of least squares.

    What has to be moved moves as a group that stays around its mean; groups are kept within 0 and 1 if they fit.
    """
    groups: list[list[float]] = []
    for i, height in enumerate(heights):
        groups.append([height - apart * i])
        while len(groups) > 1 and np.mean(groups[-2]) > np.mean(groups[-1]):
            groups[-2:] = [groups[-2] + groups[-1]]
    levels = [float(np.mean(group)) for group in groups for _ in group]
    room = 1.0 - apart * (len(levels) - 1)
    return [min(max(level, 0.0), max(room, 0.0)) + apart * i for i, level in enumerate(levels)]
