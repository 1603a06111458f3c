"""Public measured sets as campaigns."""

from armid.record.importers.dfki import import_dfki
from armid.record.importers.emps import import_emps

__all__ = ["import_dfki", "import_emps"]
