"""Interim names, until study/blind has moved."""

from dataclasses import dataclass

from pandas import DataFrame

from armid.report import document
from armid.report.document import Column


@dataclass(frozen=True, eq=False)
class Table(document.Table):
    """Hold a table whose numbers are a frame."""

    frame: DataFrame


__all__ = ["Column", "Table"]
