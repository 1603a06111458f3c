"""The look of the report's figures, and how they are written the same way each time."""

from pathlib import Path
from typing import Any

from armid.display import OKABE_ITO, style

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
    import matplotlib as mpl  # noqa: PLC0415

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
