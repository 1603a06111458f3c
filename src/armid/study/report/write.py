"""Write a report: page, tables, figures."""

from collections.abc import Callable
from pathlib import Path

from armid.study.figures import save
from armid.study.report.page import page
from armid.study.report.report import Report
from armid.study.tables import csv, latex

PAGE = "report.md"


def write_report(report: Report, command: str, path_of: Callable[[str], Path]) -> None:
    """Write the page, each table as CSV and LaTeX and each figure as PNG and SVG.

    command: what makes it again, named on the page. path_of: file name -> where to write it. The bytes depend on the
    stored results and the versions of the packages only: no date, no place.
    """
    for table in report.tables:
        path_of(f"{table.name}.csv").write_text(csv(table), encoding="utf-8")
        if table.most:
            path_of(f"{table.name}.tex").write_text(latex(table), encoding="utf-8")
    for figure in report.figures:
        save(figure.draw(), path_of(f"{figure.name}.png"), path_of(f"{figure.name}.svg"))
    path_of(PAGE).write_text(page(report, command), encoding="utf-8")
