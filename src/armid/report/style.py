"""The style of every figure, and how figures are written."""

from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
# Ids of an SVG come out of a hash; letters are drawn, so that no font is needed to read the file.
SETTINGS: Any = {"svg.hashsalt": "armid", "svg.fonttype": "path"}
# On a page letters stay text: smaller, and found by the search of a browser.
PAGE_SETTINGS: Any = SETTINGS | {"svg.fonttype": "none", "font.family": "sans-serif"}


def pyplot() -> Any:
    """Return pyplot on a backend without a screen, in the house style, without the upper and right frame."""
    import matplotlib as mpl
    import seaborn as sns

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    sns.set_theme(context="notebook", style="ticks", font_scale=1.0)
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


def save(figure: Any, *paths: Path) -> None:
    """Write a figure as PNG or SVG, as each name says, and close it; the same figure gives the same bytes."""
    import matplotlib as mpl

    # The layout takes longer than the drawing, and need not be found twice for each file.
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axis in figure.axes:
        flatten_marks(axis)
    with mpl.rc_context(SETTINGS):
        for path in paths:
            without = ("Date", "Creator") if path.suffix == ".svg" else ("Software",)
            figure.savefig(path, dpi=DPI, metadata=dict.fromkeys(without))
    pyplot().close(figure)


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

    text = StringIO()
    with mpl.rc_context(PAGE_SETTINGS):
        figure.savefig(text, format="svg", metadata={"Date": None})
    plt.close(figure)
    return text.getvalue()


def thinned(values: Array, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Return which samples of a curve are to be drawn, rising: all, or the least and the largest of each interval.

    The samples are cut into most/2 - 1 intervals of equal number, so that no peak is lost; both ends are kept.
    values: (n_samples,). most: points, at least 4.
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
