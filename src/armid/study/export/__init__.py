"""Stored results in the formats of others."""

from armid.study.export.ioh import export_ioh

__all__ = ["export_ioh"]
