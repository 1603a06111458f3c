"""How well records pin down parameters."""

from armid.identifiability.information import Information, Level, collinear, information_at, sensitivities

__all__ = ["Information", "Level", "collinear", "information_at", "sensitivities"]
