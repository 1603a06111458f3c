"""The figures there are: file name -> what draws it."""

from collections.abc import Callable
from pathlib import Path

from armid.discrepancy.figures.autocorrelation import autocorrelation_figure
from armid.discrepancy.figures.diagnosis import diagnosis_figure
from armid.discrepancy.figures.missing import missing_figure
from armid.discrepancy.figures.ranking import ranking_figure
from armid.discrepancy.figures.residuals import residual_figure
from armid.discrepancy.figures.shifts import shift_figure
from armid.discrepancy.result import ClosedLoop

FIGURES: dict[str, Callable[[ClosedLoop, Path], None]] = {
    "residuals.png": residual_figure,
    "diagnosis.png": diagnosis_figure,
    "ranking.png": ranking_figure,
    "parameters.png": shift_figure,
    "autocorrelation.png": autocorrelation_figure,
}

MISSING = {"missing.png": missing_figure}


def figures_of(found: ClosedLoop) -> dict[str, Callable[[ClosedLoop, Path], None]]:
    """Return the figures that a result has: that of a missing signal only where one was sought."""
    return FIGURES | (MISSING if found.missing is not None else {})
