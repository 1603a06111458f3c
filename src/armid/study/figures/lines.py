"""Many lines in one pair of axes, each named beside them."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armid.study.figures.style import INK, look

# Where names stand beside the axes, as shares of their width; the distance between two [inch], and what an upright
# panel needs beside its axes [inch].
BESIDE, SAMPLE, GAP = 1.045, 0.055, 0.012
APART_INCH, FRAME_INCH = 0.235, 1.0
LEAST_HEIGHT = 4.6


def panel_height(n_lines: int) -> float:
    """Return how high a panel has to be for the names of its lines [inch]."""
    return max(LEAST_HEIGHT, FRAME_INCH + APART_INCH * n_lines)


def named_lines(axis: Any, x: ArrayLike, lines: Mapping[str, ArrayLike], order: Mapping[str, int]) -> None:
    """Draw lines over a common x and name each beside its end, in the order of the ends.

    order: name -> number of its colour and dashes, so that a name looks alike in all figures.
    """
    draw(axis, x, lines, order)
    ends = {name: last_finite(y) for name, y in lines.items()}
    # Lines that end alike are told apart by what they did before.
    before = {name: float(np.nansum(np.asarray(y, float))) for name, y in lines.items()}
    names = sorted((n for n in lines if np.isfinite(ends[n])), key=lambda n: (ends[n], before[n]))
    heights = [share(axis, ends[name]) for name in names]
    for name, height, place in zip(names, heights, spread(heights, apart_in(axis)), strict=True):
        colour = look(order[name])["color"]
        axis.plot([1.0, BESIDE], [height, place], transform=axis.transAxes, color=colour, lw=0.7, clip_on=False)
        write_name(axis, name, place, order)


def listed_lines(axis: Any, x: ArrayLike, lines: Mapping[str, ArrayLike], order: Mapping[str, int],
                 names: Sequence[str]) -> None:  # fmt: skip
    """Draw lines over a common x and list their names beside the axes from the top, in the order given."""
    draw(axis, x, lines, order)
    for i, name in enumerate(names):
        write_name(axis, name, 1.0 - apart_in(axis) * (i + 0.5), order)


def draw(axis: Any, x: ArrayLike, lines: Mapping[str, ArrayLike], order: Mapping[str, int]) -> None:
    """Draw the lines; the axes keep the upright range that they have."""
    axis.set_ylim(*axis.get_ylim())
    for name, y in lines.items():
        axis.plot(x, y, lw=1.7, **look(order[name]))
    axis.margins(x=0.0)


def write_name(axis: Any, name: str, place: float, order: Mapping[str, int]) -> None:
    """Write a name beside the axes with a sample of its line."""
    there = {"transform": axis.transAxes, "clip_on": False}
    axis.plot([BESIDE, BESIDE + SAMPLE], [place, place], lw=1.9, **there, **look(order[name]))
    axis.text(BESIDE + SAMPLE + GAP, place, name, transform=axis.transAxes, color=INK, va="center", fontsize=10)


def last_finite(y: ArrayLike) -> float:
    """Return the last finite number, NaN without any."""
    values = np.asarray(y, float)
    finite = values[np.isfinite(values)]
    return float(finite[-1]) if finite.size else np.nan


def share(axis: Any, y: float) -> float:
    """Return how far up the axes a value stands, 0 to 1."""
    low, high = axis.get_ylim()
    return float(np.clip((y - low) / (high - low), 0.0, 1.0))


def apart_in(axis: Any) -> float:
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
