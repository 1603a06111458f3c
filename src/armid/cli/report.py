"""`armid report`: tables and figures of a study from its stored results."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from armid.cli.new_files import NewFiles

if TYPE_CHECKING:
    from armid.study.report import Report


@click.command("report")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def report_command(folder: Path) -> None:
    """Write the report of a study beside its stored results.

    DIR holds study.sqlite, which `armid study` wrote. Into it go report.md, every table as CSV and LaTeX, every figure
    as PNG and SVG; the same results give the same bytes. A study that is not complete is reported as far as it is, and
    the report says so. Prints the main table.
    """
    from armid.study.report import report_of, write_report  # noqa: PLC0415 - pandas takes time to import
    from armid.study.results import load_study  # noqa: PLC0415

    results = load_study(folder)
    report = report_of(results)
    place = results.path.parent
    with NewFiles(place) as files:
        write_report(report, f"armid report results/{report.name}", files.path)
    show(report)
    print(f"wrote report.md and {len(files.names) - 1} tables and figures to {place}")


def show(report: "Report") -> None:
    """Print state and main table; what its first column repeats becomes a line of its own."""
    from rich.box import SIMPLE_HEAD  # noqa: PLC0415 - takes time to import
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    from armid.study.tables import shown_rows  # noqa: PLC0415

    console = Console(width=None if sys.stdout.isatty() else 150)
    table = Table(title=report.main.title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    first, *others = report.main.columns
    for column in others:
        table.add_column(column.header.replace(" ", "\n", 1), justify="right" if column.digits else "left")
    before = ""
    for group, *row in shown_rows(report.main):
        if group != before:
            table.add_section()
            table.add_row(f"{first.header}: {group}", style="bold")
        before = group
        table.add_row(*row)
    console.print(table)
    for text in (report.main.words, report.state):
        console.print(text, highlight=False, markup=False)
