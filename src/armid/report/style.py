"""The style of every figure, and how figures are written."""

import os
from collections.abc import Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
# Okabe-Ito: told apart by colour-blind readers.
OKABE_ITO = {
    "black": "#000000", "orange": "#E69F00", "sky": "#56B4E9", "green": "#009E73", "yellow": "#F0E442",
    "blue": "#0072B2", "vermilion": "#D55E00", "purple": "#CC79A7",
}  # fmt: skip
COLOURS = tuple(OKABE_ITO[c] for c in ("blue", "vermilion", "green", "purple", "orange", "sky", "black"))
DASHES: tuple[Any, ...] = ("-", (0, (4, 1.5)), (0, (1.2, 1.2)))
MARKERS = "osD^vPX"
INK, PALE, GREY = "#222222", "0.75", "0.6"
DPI = 130
MANY_MARKS = 1_000
MOST_POINTS = 1_000
# Where labels stand outside of a frame [inch]: behind tick labels of six letters.
BELOW_INCH, LEFT_INCH = 0.34, 0.6
# Ids of an SVG come out of a hash; letters are drawn, so that no font is needed to read the file.
SETTINGS: Any = {"svg.hashsalt": "armid", "svg.fonttype": "path"}
# On a page letters stay text: smaller, and found by the search of a browser.
PAGE_SETTINGS: Any = SETTINGS | {"svg.fonttype": "none", "font.family": "sans-serif"}


# Seaborn's theme "ticks", context "notebook": importing it for these numbers takes as long as drawing a figure. A title
# whose height is told is not moved around ticks, which would measure all of them once more.
SIDES = ("x", "y")
THEME: Any = {
    "axes.axisbelow": True, "axes.edgecolor": ".15", "axes.labelcolor": ".15", "axes.labelsize": 12.0,
    "axes.linewidth": 1.25, "axes.titlesize": 12.0, "axes.titley": 1.0,
    "axes.spines.top": False, "axes.spines.right": False,
    "font.size": 12.0, "grid.color": ".8", "grid.linewidth": 1.0, "legend.fontsize": 11.0,
    "legend.title_fontsize": 12.0, "lines.solid_capstyle": "round", "patch.edgecolor": "w",
    "patch.force_edgecolor": True, "text.color": ".15",
    **{f"{side}tick.color": ".15" for side in SIDES}, **{f"{side}tick.labelsize": 11.0 for side in SIDES},
    **{f"{side}tick.major.size": 6.0 for side in SIDES}, **{f"{side}tick.major.width": 1.25 for side in SIDES},
    **{f"{side}tick.minor.size": 4.0 for side in SIDES}, **{f"{side}tick.minor.width": 1.0 for side in SIDES},
}  # fmt: skip


def pyplot() -> Any:
    """Return pyplot on a backend without a screen (but a notebook's own), in the house style."""
    import matplotlib as mpl

    if "inline" not in os.environ.get("MPLBACKEND", ""):
        mpl.use("Agg")
    import matplotlib.pyplot as plt

    plt.rcParams.update(THEME | SETTINGS)
    return plt


def detached(figure: Any) -> Any:
    """Return a figure that pyplot has forgotten: a notebook shows what a cell returns, and not once more."""
    pyplot().close(figure)
    return figure


def look(i: int) -> dict[str, Any]:
    return {"color": COLOURS[i % len(COLOURS)], "ls": DASHES[i // len(COLOURS) % len(DASHES)]}


def panels(n: int, columns: int, width: float, height: float) -> tuple[Any, list[Any]]:
    plt = pyplot()
    columns = max(1, min(columns, n))
    rows = -(-n // columns)
    size = (width * columns, height * rows)
    figure, axes = plt.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained")
    flat = list(axes.ravel())
    for unused in flat[n:]:
        unused.remove()
    return figure, flat[:n]


def place_labels(axis: Any) -> None:
    """Put the labels of an axis so many inches from its frame: by itself each draw would measure all ticks for that."""
    from matplotlib.transforms import ScaledTranslation

    shifts = [ScaledTranslation(x, y, axis.figure.dpi_scale_trans) for x, y in ((0.0, -BELOW_INCH), (-LEFT_INCH, 0.0))]
    axis.xaxis.set_label_coords(0.5, 0.0, axis.transAxes + shifts[0])
    axis.yaxis.set_label_coords(0.0, 0.5, axis.transAxes + shifts[1])


def save(figure: Any, *paths: Path) -> None:
    """Write a figure as PNG or SVG, as each name says, and close it; the same figure gives the same bytes."""
    import matplotlib as mpl

    write_names_as_they_are(figure)
    # The layout takes longer than the drawing, and need not be found once more for each file.
    if (engine := figure.get_layout_engine()) is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")
    for axis in figure.axes:
        flatten_marks(axis)
    with mpl.rc_context(SETTINGS):
        for path in paths:
            without = ("Date", "Creator") if path.suffix == ".svg" else ("Software",)
            figure.savefig(path, dpi=DPI, metadata=dict.fromkeys(without))
    pyplot().close(figure)


def no_formulas() -> Any:
    """Return a context for drawing without logarithmic axes by what lays out names before `save` sees them."""
    import matplotlib as mpl

    return mpl.rc_context({"text.parse_math": False})


def write_names_as_they_are(artist: Any) -> None:
    """Take the `$` of a name in a figure for no formula: only numbers along a logarithmic axis are formulas."""
    from matplotlib.axis import Axis
    from matplotlib.text import Text
    from matplotlib.ticker import LogFormatter

    for child in artist.get_children():
        if isinstance(child, Axis):
            # its children would make further ticks, before its limits are known
            named = [] if isinstance(child.get_major_formatter(), LogFormatter) else child.majorTicks
            for text in (child.label, *(tick.label1 for tick in named)):
                text.set_parse_math(False)
        elif isinstance(child, Text):
            child.set_parse_math(False)
        else:
            write_names_as_they_are(child)


def flatten_marks(axis: Any) -> None:
    """Turn the marks of an axis into one picture inside the SVG where there are many: each would be an element."""
    marks = [line for line in axis.lines if line.get_linestyle() == "None"]
    if sum(len(line.get_xdata()) for line in marks) > MANY_MARKS:
        for line in marks:
            line.set_rasterized(True)


def svg_text(figure: Any) -> str:
    """Return a figure as SVG for a page and close it; the same figure gives the same text."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    write_names_as_they_are(figure)
    text = StringIO()
    with mpl.rc_context(PAGE_SETTINGS):
        figure.savefig(text, format="svg", metadata={"Date": None})
    plt.close(figure)
    return text.getvalue()


def thinned(values: Array, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Return which samples of a curve are to be drawn, rising: all, or the least and the largest of each interval.

    So no peak is lost; both ends are kept. most: points, at least 4.
    """
    n = len(values)
    if n <= most:
        return np.arange(n)
    edges = np.linspace(0, n, most // 2).astype(np.intp)
    lows = np.minimum.reduceat(values, edges[:-1])
    highs = np.maximum.reduceat(values, edges[:-1])
    sizes = np.diff(edges)
    chosen = [0, n - 1]
    for extreme in (lows, highs):
        equal = np.flatnonzero(values == np.repeat(extreme, sizes))
        # the first sample of each interval that is its extreme
        chosen += list(equal[np.unique(np.searchsorted(edges, equal, side="right"), return_index=True)[1]])
    return np.unique(np.array(chosen, dtype=np.intp))


# Where names stand beside the axes, as shares of their width; the distance between two [inch], and what an upright
# panel needs beside its axes [inch].
BESIDE, SAMPLE, GAP = 1.045, 0.055, 0.012
APART_INCH, FRAME_INCH, LEAST_HEIGHT = 0.235, 1.0, 4.6


def panel_height(n_lines: int) -> float:
    return max(LEAST_HEIGHT, FRAME_INCH + APART_INCH * n_lines)


def row_names(axis: Any, i: int, names: Sequence[str]) -> None:
    axis.set_yticks(range(len(names)), names if i % 2 == 0 else [""] * len(names))


def legend_below(figure: Any, ncols: int, handles: Sequence[Any] | None = None) -> None:
    """Write one legend below all panels. handles: None takes those of the first panel."""
    if handles is None:
        handles = figure.axes[0].get_legend_handles_labels()[0]
    labels = [handle.get_label() for handle in handles]
    figure.legend(handles, labels, loc="outside lower center", ncols=ncols, frameon=False)


def named_lines(axis: Any, x: ArrayLike, lines: Mapping[str, ArrayLike], colours: Mapping[str, int]) -> None:
    """Draw lines over a common x and name each beside its end; colours: name -> number of its colour and dashes."""
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
    there = {"transform": axis.transAxes, "clip_on": False}
    axis.plot([BESIDE, BESIDE + SAMPLE], [place, place], lw=1.9, **there, **look(colours[name]))
    axis.text(BESIDE + SAMPLE + GAP, place, name, transform=axis.transAxes, color=INK, va="center", fontsize=10)


def name_distance(axis: Any) -> float:
    grid = axis.get_subplotspec().get_gridspec()
    return float(APART_INCH / (axis.figure.get_size_inches()[1] / grid.nrows - FRAME_INCH))


def spread(heights: Sequence[float], apart: float) -> Array:
    """Return rising heights moved at least so far apart, as little as it takes in the sense of least squares.

    What has to be moved moves as a group that stays around its mean; groups are kept within 0 and 1 if they fit.
    """
    from scipy.optimize import isotonic_regression

    steps = apart * np.arange(len(heights))
    room = max(1.0 - apart * (len(heights) - 1), 0.0)
    return np.clip(isotonic_regression(heights - steps).x, 0.0, room) + steps
