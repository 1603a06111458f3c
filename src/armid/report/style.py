"""The style of every figure."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Okabe-Ito: told apart by colour-blind readers.
OKABE_ITO = {
    "black": "#000000", "orange": "#E69F00", "sky": "#56B4E9", "green": "#009E73", "yellow": "#F0E442",
    "blue": "#0072B2", "vermilion": "#D55E00", "purple": "#CC79A7",
}  # fmt: skip
GREY = "0.6"


def style() -> Any:
    """Return pyplot on a backend without a screen, in the house style."""
    import matplotlib as mpl
    import seaborn as sns

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    sns.set_theme(context="notebook", style="ticks", font_scale=1.0)
    return plt


DPI = 130
# Ids of an SVG come out of a hash; without dates the same figure gives the same bytes.
SETTINGS: Any = {"svg.hashsalt": "armid"}


def save(figure: Any, path: Path) -> None:
    """Write a figure as PNG or SVG, as the name says, and close it."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    with mpl.rc_context(SETTINGS):
        figure.savefig(path, dpi=DPI, metadata={"Date": None} if path.suffix == ".svg" else {})
    plt.close(figure)


Array = NDArray[np.float64]
MOST_POINTS = 1000


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
