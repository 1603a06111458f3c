"""Figures of the closed loop, one file each."""

from armid.discrepancy.figures.catalogue import FIGURES, figures_of

__all__ = ["FIGURES", "figures_of"]
