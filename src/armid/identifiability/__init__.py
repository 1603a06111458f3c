"""How well records pin down parameters."""

from armid.identifiability.information import Information, collinear, information_at, sensitivities

__all__ = ["Information", "collinear", "information_at", "sensitivities"]
