"""Stored results in the formats of others."""

from armid.study.export.ioh import export_ioh
from armid.study.export.reports import export_reports

__all__ = ["export_ioh", "export_reports"]
