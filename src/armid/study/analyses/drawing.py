"""A figure of a report: what it is called, what it shows, and how it is drawn."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armid.report.style import OKABE_ITO, style


@dataclass(frozen=True, eq=False)
class Figure:
    """Hold one figure.

    name: of its files; title; words: what it shows and how each mark was computed; draw: returns it as matplotlib's.
    """

    name: str
    title: str
    words: str
    draw: Callable[[], Any]


COLOURS = tuple(OKABE_ITO[c] for c in ("blue", "vermilion", "green", "purple", "orange", "sky", "black"))
DASHES: tuple[Any, ...] = ("-", (0, (4, 1.5)), (0, (1.2, 1.2)))
MARKERS = "osD^vPX"
INK, PALE = "#222222", "0.75"
DPI = 130
MANY_MARKS = 1_000
# Ids of an SVG come out of a hash; letters are drawn, so that no font is needed to read it.
SETTINGS: Any = {"svg.hashsalt": "armid", "svg.fonttype": "path"}


def pyplot() -> Any:
    """Return pyplot in the house style, without the upper and right frame."""
    plt = style()
    plt.rcParams.update({"axes.spines.top": False, "axes.spines.right": False} | SETTINGS)
    return plt


def look(i: int) -> dict[str, Any]:
    """Return colour and dashes of the i-th of up to 21 lines."""
    return {"color": COLOURS[i % len(COLOURS)], "ls": DASHES[i // len(COLOURS) % len(DASHES)]}


def panels(n: int, columns: int, width: float, height: float) -> tuple[Any, list[Any]]:
    """Return a figure and n axes in rows of so many columns, each of this size [inch]."""
    plt = pyplot()
    columns = max(1, min(columns, n))
    rows = -(-n // columns)
    size = (width * columns, height * rows)
    figure, axes = plt.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained")
    flat = list(axes.ravel())
    for unused in flat[n:]:
        unused.remove()
    return figure, flat[:n]


def save(figure: Any, png: Path, svg: Path) -> None:
    """Write a figure as PNG and SVG without dates, and close it."""
    import matplotlib as mpl

    # The layout takes longer than the drawing, and need not be found twice for each file.
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axis in figure.axes:
        flatten_marks(axis)
    with mpl.rc_context(SETTINGS):
        figure.savefig(png, dpi=DPI, metadata={"Software": None})
        figure.savefig(svg, dpi=DPI, metadata={"Date": None, "Creator": None})
    pyplot().close(figure)


def flatten_marks(axis: Any) -> None:
    """Turn the marks of an axis into one picture inside the SVG where there are many: each would be an element."""
    marks = [line for line in axis.lines if line.get_linestyle() == "None"]
    if sum(len(line.get_xdata()) for line in marks) > MANY_MARKS:
        for line in marks:
            line.set_rasterized(True)


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
