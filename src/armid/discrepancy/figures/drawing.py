"""What the figures of the closed loop share."""

from pathlib import Path
from typing import Any

from armid.display import OKABE_ITO
from armid.display import save as save_figure

BEFORE, AFTER = OKABE_ITO["vermilion"], OKABE_ITO["blue"]


def tidy(axis: Any) -> None:
    """Leave only the axes that are read."""
    axis.spines[["top", "right"]].set_visible(False)


def save(plt: Any, figure: Any, path: Path) -> None:
    """Write a figure and forget it."""
    save_figure(figure, path)
