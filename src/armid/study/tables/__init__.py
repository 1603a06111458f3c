"""Tables of a study's report, one a file, and how they are written."""

from armid.study.tables.cramer_rao import cramer_rao, cramer_rao_summary
from armid.study.tables.files import csv, escaped, latex, markdown
from armid.study.tables.fitness_quality import fitness_quality
from armid.study.tables.overview import overview
from armid.study.tables.ranks import mean_ranks, pairs
from armid.study.tables.running_time import fixed_target, running_time
from armid.study.tables.runs import reasons, runs
from armid.study.tables.slug import slug, unlike
from armid.study.tables.success import success
from armid.study.tables.table import Column, Table, shown_rows
from armid.study.tables.table1 import table1, table1_all, table1_rows
from armid.study.tables.table2 import table2, table2_records
from armid.study.tables.values import values

__all__ = [
    "Column",
    "Table",
    "cramer_rao",
    "cramer_rao_summary",
    "csv",
    "escaped",
    "fitness_quality",
    "fixed_target",
    "latex",
    "markdown",
    "mean_ranks",
    "overview",
    "pairs",
    "reasons",
    "running_time",
    "runs",
    "shown_rows",
    "slug",
    "success",
    "table1",
    "table1_all",
    "table1_rows",
    "table2",
    "table2_records",
    "unlike",
    "values",
]
