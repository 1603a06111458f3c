"""The report of a study: what it says, and its files."""

from armid.study.report.build import report_of, summary_of
from armid.study.report.report import Report, Section
from armid.study.report.write import write_report

__all__ = ["Report", "Section", "report_of", "summary_of", "write_report"]
