"""Figures of the closed loop, one file each."""

from armid.discrepancy.figures.catalogue import FIGURES

__all__ = ["FIGURES"]
