"""The style of every figure, and how figures are written."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextvars import ContextVar, copy_context
from io import StringIO
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
# Okabe-Ito: colour-blind readers can distinguish them.
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
# Of a title.
LETTERS_PER_INCH = 9.0
MOST_VECTOR_POINTS = 1_000
# Largest ratio of the ends of a logarithmic axis with plain numbers.
MOST_PLAIN = 300.0
# Where labels stand outside of a frame [inch]: behind tick labels of six letters.
BELOW_INCH, LEFT_INCH = 0.34, 0.6
# Ids of an SVG come out of a hash; letters are drawn, so that no font is needed to read the file.
SETTINGS: Any = {"svg.hashsalt": "armid", "svg.fonttype": "path"}
# On a page letters stay text: smaller, and found by the search of a browser.
PAGE_SETTINGS: Any = SETTINGS | {"svg.fonttype": "none", "font.family": "sans-serif"}


# Seaborn's theme "ticks", context "notebook": importing it for these numbers takes as long as drawing a figure. A title
# whose height is given is not moved around ticks, which would measure all of them once more.
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


# Figures of a paper: widths of one and of both columns [inch], and the size of all their letters [pt].
WIDTHS = {"single": 3.5, "double": 7.2}
LETTERS = 8.0
# Columns of a paper that a figure is being drawn for, "" for a page. In a single one all panels stand in a column,
# in a double one in two: more would leave no room between their names.
PRINTED_WIDTH: ContextVar[str] = ContextVar("PRINTED", default="")
COLUMNS_OF_WIDTH = {"single": 1, "double": 2}
# Least share of its height that a figure keeps when it becomes narrower.
LEAST_HEIGHT_SHARE = 0.62
# A figure of at most this height keeps it: axis labels and a legend take most of it [inch].
LEAST_PRINT_INCH = 2.6
# Room for a line of a legend before a figure becomes narrower [inch].
LEGEND_INCH = 0.3
PRINT_SETTINGS: Any = SETTINGS | {"pdf.fonttype": 42}


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
    columns = max(1, min(columns, n, COLUMNS_OF_WIDTH.get(PRINTED_WIDTH.get(), columns)))
    rows = -(-n // columns)
    size = (width * columns, height * rows)
    figure, axes = plt.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained")
    flat = list(axes.ravel())
    for unused in flat[n:]:
        unused.remove()
    return figure, flat[:n]


def log_axis(axis: Any) -> None:
    """Make the x axis of what is drawn logarithmic, with plain numbers where it spans few powers of ten."""
    from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, StrMethodFormatter

    axis.set_xscale("log")
    low, high = axis.get_xlim()
    if high < MOST_PLAIN * low:
        axis.xaxis.set_major_locator(MaxNLocator(5) if high < 10.0 * low else LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.xaxis.set_minor_formatter(NullFormatter())


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


def save_for_print(draw: Callable[[], Any], path: Path, width: str) -> None:
    """Draw a figure and write it as PDF for a paper; the same figure gives the same bytes.

    width: "single" or "double", of the columns of a page. All letters have one size. The title goes, as the caption
    says it; those of several panels stay.
    """
    import matplotlib as mpl
    from matplotlib.text import Text

    printing = copy_context()
    printing.run(PRINTED_WIDTH.set, width)
    figure = printing.run(draw)
    figure.suptitle("")
    panels_there = [axis for axis in figure.axes if axis.get_subplotspec() is not None and axis.get_title()]
    if len(panels_there) == 1:
        panels_there[0].set_title("")
    write_names_as_they_are(figure)
    before, height = figure.get_size_inches()
    smaller = height * max(WIDTHS[width] / before, LEAST_HEIGHT_SHARE)
    figure.set_size_inches(WIDTHS[width], max(smaller, min(height, LEAST_PRINT_INCH)))
    for text in figure.findobj(Text):
        text.set_fontsize(LETTERS)
    for axis in figure.axes:
        axis.tick_params(which="both", labelsize=LETTERS)
        flatten_marks(axis)
    if not figure.get_constrained_layout():
        figure.tight_layout()
    with mpl.rc_context(PRINT_SETTINGS):
        figure.savefig(path, dpi=2 * DPI, metadata=dict.fromkeys(("CreationDate", "Creator", "Producer")))
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


def thinned(values: Array, most: int = MOST_VECTOR_POINTS) -> NDArray[np.intp]:
    """Return which samples of a curve are to be drawn, rising: all, or the least and the largest of each interval.

    So no peak is lost; both ends are kept. most: points, at least 4.
    """
    n = len(values)
    if n <= most:
        return np.arange(n)
    chosen = {0, n - 1}
    for interval in np.array_split(np.arange(n), most // 2 - 1):
        chosen |= {int(interval[0] + extreme(values[interval])) for extreme in (np.argmin, np.argmax)}
    return np.array(sorted(chosen), dtype=np.intp)


# Height of an upright panel with a name for each line at its side [inch].
LEAST_HEIGHT = 4.6
# Identifiers that have a colour of their own in a report.
MOST_COLOURED = 6


def row_names(axis: Any, i: int, names: Sequence[str]) -> None:
    names_here = i % 2 == 0 or PRINTED_WIDTH.get() == "single"
    axis.set_yticks(range(len(names)), names if names_here else [""] * len(names))


def entitle(figure: Any, text: str, size: str = "medium") -> None:
    """Write the title of a figure, over as many lines as its width asks for; size: of the letters."""
    figure.suptitle(fill(text, int(LETTERS_PER_INCH * figure.get_figwidth())), fontsize=size)


def legend_below(figure: Any, ncols: int, handles: Sequence[Any] | None = None) -> None:
    """Write one legend below all panels. handles: None takes those of the first panel."""
    if handles is None:
        handles = figure.axes[0].get_legend_handles_labels()[0]
    labels = [handle.get_label() for handle in handles]
    if PRINTED_WIDTH.get() == "single":
        ncols = 1
        figure.set_figheight(figure.get_figheight() + LEGEND_INCH * len(labels))
    figure.legend(handles, labels, loc="outside lower center", ncols=ncols, frameon=False)


def named_lines(axis: Any, x: ArrayLike, lines: Mapping[str, ArrayLike], colours: Mapping[str, int]) -> None:
    """Draw lines over a common x and list their names right of the axes; colours: name -> number of its colour.

    The first have a colour each, all others are grey and share a name.
    """
    from matplotlib.lines import Line2D

    # the axes keep the upright range that they have
    axis.set_ylim(*axis.get_ylim())
    for name in sorted(lines, key=lambda name: colours[name], reverse=True):
        axis.plot(x, lines[name], **line_look(colours[name]))
    axis.margins(x=0.0)
    rows = legend_rows({name: colours[name] for name in lines})
    axis.legend(handles=[Line2D([], [], label=name, **line_look(number)) for name, number in rows], frameon=False,
                loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=10)  # fmt: skip


def legend_rows(colours: Mapping[str, int]) -> list[tuple[str, int]]:
    """Return name and number of each row of a legend in the order of the colours; all that are grey share a row."""
    rows = sorted(((name, i) for name, i in colours.items() if i < MOST_COLOURED), key=lambda row: row[1])
    n_others = len(colours) - len(rows)
    return [*rows, (f"others ({n_others})", MOST_COLOURED)] if n_others else rows


def line_look(i: int) -> dict[str, Any]:
    """Return the look of the line of an identifier; the first have a colour each."""
    return (
        {"color": COLOURS[i], "lw": 1.7, "zorder": 3} if i < MOST_COLOURED else {"color": PALE, "lw": 1.0, "zorder": 1}
    )


def variant_handles(colours: Mapping[str, int]) -> list[Any]:
    """Return what a legend shows of marks in the colours of identifiers, in their order."""
    return [mark_handle(name, "o", line_look(i)["color"]) for name, i in legend_rows(colours)]


def mark_handles(labels: Iterable[str]) -> list[Any]:
    """Return what a legend shows of marks of different shapes, whose colour says something else."""
    return [mark_handle(label, marker_of(k), INK) for k, label in enumerate(labels)]


def mark_handle(label: str, marker: str, colour: str) -> Any:
    from matplotlib.lines import Line2D

    return Line2D([], [], ls="", marker=marker, mfc="none", mec=colour, label=label)


def marker_of(k: int) -> str:
    return MARKERS[k % len(MARKERS)]
