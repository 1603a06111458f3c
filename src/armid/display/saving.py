"""Write a figure the same way each time."""

from pathlib import Path
from typing import Any

DPI = 130
# Ids of an SVG come out of a hash; without dates the same figure gives the same bytes.
SETTINGS: Any = {"svg.hashsalt": "armid"}


def save(figure: Any, path: Path) -> None:
    """Write a figure as PNG or SVG, as the name says, and close it."""
    import matplotlib as mpl  # noqa: PLC0415 - takes time to import
    import matplotlib.pyplot as plt  # noqa: PLC0415

    with mpl.rc_context(SETTINGS):
        figure.savefig(path, dpi=DPI, metadata={"Date": None} if path.suffix == ".svg" else {})
    plt.close(figure)
