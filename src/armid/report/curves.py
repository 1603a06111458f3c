"""Draw stored curves as small figures whose layers a page can fade."""

from collections.abc import Mapping, Sequence
from io import StringIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.report.style import GREY, OKABE_ITO, style

Array = NDArray[np.float64]
# Curve -> the numbers x and y of a stored curve, null where there is none.
Curves = Mapping[str, Mapping[str, Sequence[float | None]]]
SIZE, PAIR_SIZE, WIDE_SIZE = (6.0, 2.5), (6.0, 4.0), (9.0, 2.5)
# Letters stay text: smaller, and found by the search of a browser.
SETTINGS: Any = {"svg.hashsalt": "armid", "svg.fonttype": "none", "font.family": "sans-serif"}


def residual_drawing(curves: Curves, noise: float | None, unit: str, factor: float) -> str:
    """Return a residual before and after as SVG, as layers "before" and "after" on a band of 2 sigma of noise."""
    figure, (axis,) = panels(SIZE, (1,))
    if noise is not None:
        axis.axhspan(-2.0 * noise * factor, 2.0 * noise * factor, color=GREY, alpha=0.35, lw=0)
    for name, colour in (("before", OKABE_ITO["vermilion"]), ("after", OKABE_ITO["blue"])):
        x, y = points(curves[name])
        axis.plot(x, factor * y, color=colour, lw=0.9, gid=name)
    axis.set_ylabel(f"residual [{unit}]")
    axis.set_xlabel("time [s]")
    return svg(figure)


def fit_drawing(curves: Curves, unit: str, factor: float) -> str:
    """Return measured and simulated signal as SVG, the residual below."""
    figure, (upper, lower) = panels(PAIR_SIZE, (3, 1.4))
    looks = {"measured": {"color": OKABE_ITO["black"], "lw": 1.5},
             "simulated": {"color": OKABE_ITO["vermilion"], "lw": 1.3, "ls": "--"}}  # fmt: skip
    for name, look in looks.items():
        x, y = points(curves[name])
        upper.plot(x, factor * y, label=name, **look)
    x, y = points(curves["residual"])
    lower.axhline(0.0, color=GREY, lw=0.8)
    lower.plot(x, factor * y, color=OKABE_ITO["blue"], lw=0.8)
    upper.legend(frameon=False, fontsize="small")
    upper.tick_params(labelbottom=False)
    upper.set_ylabel(f"speed [{unit}]")
    lower.set_ylabel(f"residual\n[{unit}]")
    lower.set_xlabel("time [s]")
    return svg(figure)


def candidate_drawing(residual: Mapping[str, Any], predicted: Mapping[str, Any], edges: Sequence[int]) -> str:
    """Return the projected residual and the part of it that a candidate predicts as SVG, records end to end."""
    figure, (axis,) = panels(WIDE_SIZE, (1,))
    for curve, colour, width, name in ((residual, "0.72", 0.7, "residual"),
                                       (predicted, OKABE_ITO["blue"], 1.3, "predicted")):  # fmt: skip
        x, y = points(curve)
        axis.plot(x, y, color=colour, lw=width, label=name)
    for edge in edges[1:-1]:
        axis.axvline(edge, color="0.4", lw=0.8, ls=":")
    axis.set_xlabel("sample, train records end to end")
    axis.set_ylabel("whitened residual\n[sigma]")
    axis.legend(frameon=False, fontsize="small", loc="upper right", ncols=2)
    return svg(figure)


def panels(size: tuple[float, float], heights: tuple[float, ...]) -> tuple[Any, list[Any]]:
    """Return a figure with axes above each other."""
    plt = style()
    width, height = size
    # margins in inches: they cost a tenth of the time that a layout engine takes, and there are many figures
    place = {"left": 1.1 / width, "right": 1.0 - 0.1 / width, "bottom": 0.6 / height, "top": 1.0 - 0.1 / height}
    figure, axes = plt.subplots(len(heights), 1, figsize=size, height_ratios=heights, squeeze=False, sharex=True,
                                gridspec_kw=place | {"hspace": 0.12})  # fmt: skip
    for axis in axes.flat:
        axis.margins(x=0.01)
        axis.spines[["top", "right"]].set_visible(False)
    return figure, list(axes.flat)


def points(curve: Mapping[str, Any]) -> tuple[Array, Array]:
    """Return the numbers of a stored curve, NaN where there is none."""
    return np.array(curve["x"], dtype=float), np.array(curve["y"], dtype=float)


def svg(figure: Any) -> str:
    """Return a figure as SVG and close it; the same figure gives the same text."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    text = StringIO()
    with mpl.rc_context(SETTINGS):
        figure.savefig(text, format="svg", metadata={"Date": None})
    plt.close(figure)
    return text.getvalue()
