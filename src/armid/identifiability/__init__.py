"""How well records pin down parameters."""

from armid.identifiability.information import MISFIT, Information, Level, collinear, information_at, sensitivities

__all__ = ["MISFIT", "Information", "Level", "collinear", "information_at", "sensitivities"]
