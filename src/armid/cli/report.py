"""`armid report`: one page, tables and figures from stored results."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from armid.cli.options import examples
from armid.cli.results import IDENTIFIABILITY, IDENTIFICATION, LOOP, Kind, NewFiles, write_page
from armid.errors import ArmidError

if TYPE_CHECKING:
    from armid.study.report import Report
    from armid.study.results import StudyResults


STUDY, PAGE = "study.sqlite", "report.html"


@click.command("report", short_help="Write the page of stored results.", epilog=examples(
    "armid report results/table1_short", "armid report results/four_strokes",
))  # fmt: skip
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--key",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Truth of blind campaigns. [default: the file that the study names]",
)
def report_command(folder: Path, key: Path | None) -> None:
    """Write report.html, one self-contained page, beside stored results.

    DIR is a folder that `armid study`, `armid close-loop`, `armid identify` or `armid identifiability` (whose page is
    identifiability.html) has written. The same results give the same bytes, and nothing is simulated. For a study,
    report.md, every table as CSV and LaTeX and every figure as PNG and SVG are written too, and the main table is
    printed; one that is not complete is reported as far as it is, and the report says so.
    """
    kind = kind_in(folder)
    if kind is None:
        report_study(folder, key)
        return
    if key is not None:
        raise ArmidError(f"{folder} holds no study, and a key is the truth of a study's campaigns: none is expected")
    with NewFiles(folder) as files:
        size = write_page(files, kind, folder, folder)
    print(f"wrote {kind.page} ({size / 1e6:.1f} MB) to {folder}")


def report_study(folder: Path, key: Path | None) -> None:
    """Write the page, tables and figures of a study, and print its main table."""
    from armid.report.html import html
    from armid.study.document import (
        report_of,
        study_page,
    )
    from armid.study.markdown import write_report
    from armid.study.results import load_study

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
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    from armid.study.analyses.table import shown_rows

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


def kind_in(folder: Path) -> Kind | None:
    """Return the kind of result that a folder holds, None for a study, whose store may be named itself.

    Raises ArmidError for a folder without any, and for one with the results of two commands.
    """
    if folder.name == STUDY or (folder / STUDY).is_file():
        return None
    there = [kind for kind in (LOOP, IDENTIFICATION) if (folder / kind.file).is_file()]
    if len(there) > 1:
        names = " and ".join(kind.file for kind in there)
        raise ArmidError(f"{folder} holds {names}, which two commands wrote: one of them is expected")
    if not there and (folder / IDENTIFIABILITY.file).is_file():
        return IDENTIFIABILITY
    if there:
        return there[0]
    names = f"{STUDY} of `armid study`, {LOOP.file} of `{LOOP.command}` or {IDENTIFICATION.file}"
    raise ArmidError(f"{folder} holds no result: {names} of `{IDENTIFICATION.command}` is expected")
