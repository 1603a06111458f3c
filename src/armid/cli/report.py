"""`armid report`: one page, tables and figures from stored results."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from armid.cli.new_files import NewFiles
from armid.cli.options import examples
from armid.model import ArmidError

if TYPE_CHECKING:
    from armid.study.report import Report
    from armid.study.results import StudyResults


@click.command("report", short_help="Write the page of stored results.", epilog=examples(
    "armid report results/table1_short", "armid report results/four_strokes",
))  # fmt: skip
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--key", type=click.Path(path_type=Path), metavar="FILE",
              help="Truth of blind campaigns. [default: the file that the study names]")
def report_command(folder: Path, key: Path | None) -> None:
    """Write report.html, one self-contained page, beside stored results.

    DIR is a folder that `armid study`, `armid close-loop` or `armid identify` has written. The same results give the
    same bytes, and nothing is simulated. For a study, report.md, every table as CSV and LaTeX and every figure as PNG
    and SVG are written too, and the main table is printed; one that is not complete is reported as far as it is, and
    the report says so.
    """
    from armid.page import STUDY, result_in  # noqa: PLC0415 - jinja2 and seaborn take time to import

    result = result_in(folder)
    if result == STUDY:
        report_study(folder, key)
    elif key is not None:
        raise ArmidError(f"{folder} holds no study, and a key is the truth of a study's campaigns: none is expected")
    else:
        report_folder(folder, result)


def report_folder(folder: Path, result: str) -> None:
    """Write the page of a closed loop or an identification."""
    from armid.page import PAGE, html, page_of_folder  # noqa: PLC0415

    text = html(page_of_folder(folder, result, str(folder)))
    with NewFiles(folder) as files:
        files.path(PAGE).write_text(text, encoding="utf-8")
    print(f"wrote {PAGE} ({len(text.encode()) / 1e6:.1f} MB) to {folder}")


def report_study(folder: Path, key: Path | None) -> None:
    """Write the page, tables and figures of a study, and print its main table."""
    from armid.page import PAGE, html  # noqa: PLC0415
    from armid.page.study_page import study_page  # noqa: PLC0415
    from armid.study.report import report_of, write_report  # noqa: PLC0415 - pandas takes time to import
    from armid.study.results import load_study  # noqa: PLC0415

    results = load_study(folder)
    report = report_of(results, key)
    again = f"armid report results/{report.name}"
    place = results.path.parent
    with NewFiles(place) as files:
        write_report(report, again, files.path)
        svgs = {f.name: (files.place / f"{f.name}.svg").read_text(encoding="utf-8") for f in report.figures}
        commands = command_of(results), again
        page = study_page(report, svgs, str(results.study["text"]), models_of(results), commands)
        files.path(PAGE).write_text(html(page), encoding="utf-8")
    show(report)
    print(f"wrote report.md and {len(files.names) - 2} tables and figures to {place}, all on one page in {PAGE}")


def command_of(results: "StudyResults") -> str:
    """Return what makes the runs again, as a shell takes it."""
    plugins = [word for name in results.study.get("plugins", ()) for word in ("--plugin", str(name))]
    file = results.study.get("file", f"{results.study['name']}.toml")
    return shlex.join(["armid", "study", str(file), *plugins])


def models_of(results: "StudyResults") -> list[str]:
    """Return the equations of the models that were run, each once."""
    hashes = [h for h in dict.fromkeys(results.runs["model"]) if isinstance(h, str)]
    return list(dict.fromkeys(results.text_of(h) for h in hashes))


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
