"""`armid report`: one page, tables and figures from stored results."""

import json
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from armid.cli.options import NewFiles, examples
from armid.errors import ArmidError
from armid.estimation.identify_document import FIGURES as IDENTIFY_FIGURES
from armid.estimation.identify_document import identify_page
from armid.loop.document import FIGURES as LOOP_FIGURES
from armid.loop.document import loop_page
from armid.report.document import Page

if TYPE_CHECKING:
    from armid.study.report import Report
    from armid.study.results import StudyResults


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

    DIR is a folder that `armid study`, `armid close-loop` or `armid identify` has written. The same results give the
    same bytes, and nothing is simulated. For a study, report.md, every table as CSV and LaTeX and every figure as PNG
    and SVG are written too, and the main table is printed; one that is not complete is reported as far as it is, and
    the report says so.
    """
    pass

    result = result_in(folder)
    if result == STUDY:
        report_study(folder, key)
    elif key is not None:
        raise ArmidError(f"{folder} holds no study, and a key is the truth of a study's campaigns: none is expected")
    else:
        report_folder(folder, result)


def report_folder(folder: Path, result: str) -> None:
    """Write the page of a closed loop or an identification."""
    from armid.report.html import html

    text = html(page_of_folder(folder, result, str(folder)))
    with NewFiles(folder) as files:
        files.path(PAGE).write_text(text, encoding="utf-8")
    print(f"wrote {PAGE} ({len(text.encode()) / 1e6:.1f} MB) to {folder}")


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


STUDY, LOOP, IDENTIFICATION = "study.sqlite", "report.json", "result.json"
MADE_BY = {STUDY: "armid study", LOOP: "armid close-loop", IDENTIFICATION: "armid identify"}
DETAILS = "details.json"


def result_in(folder: Path) -> str:
    """Return the file that says what a folder holds; a study's store may be named itself.

    Raises ArmidError for a folder without any, and for one with the results of two commands.
    """
    if folder.name == STUDY:
        return STUDY
    there = [name for name in MADE_BY if (folder / name).is_file()]
    if len(there) == 1 or STUDY in there:
        return there[0]
    if there:
        raise ArmidError(f"{folder} holds {' and '.join(there)}, which two commands wrote: one of them is expected")
    names = [f"{name} of `{command}`" for name, command in MADE_BY.items()]
    raise ArmidError(f"{folder} holds no result: {', '.join(names[:-1])} or {names[-1]} is expected")


def read_json(path: Path, command: str) -> dict[str, Any]:
    """Return a stored JSON table.

    Raises ArmidError for a file that is none.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ArmidError(f"{path} is no JSON ({error}): what `{command}` wrote is expected") from error
    if not isinstance(found, dict):
        raise ArmidError(f"{path} holds no table: what `{command}` wrote is expected")
    return found


def details_in(folder: Path, command: str) -> dict[str, Any]:
    """Return the details beside a result, empty where an earlier version of armid wrote none."""
    path = folder / DETAILS
    return read_json(path, command) if path.is_file() else {}


def drawings_in(folder: Path, names: tuple[str, ...]) -> dict[str, str]:
    """Return name -> text of the SVG files that are there, in order."""
    files = {name: folder / f"{name}.svg" for name in names}
    return {name: path.read_text(encoding="utf-8") for name, path in files.items() if path.is_file()}


PAGE = "report.html"
MAKERS = {LOOP: (loop_page, LOOP_FIGURES), IDENTIFICATION: (identify_page, IDENTIFY_FIGURES)}


def page_of_folder(folder: Path, result: str, name: str) -> Page:
    """Return the page of a closed loop or of an identification.

    folder: where the files are; result: which of them holds the result, see `result_in`; name: of the folder, in the
    command that makes the page again.

    Raises ArmidError for files that are not what the commands write.
    """
    make, figures = MAKERS[result]
    stored = read_json(folder / result, MADE_BY[result])
    details = details_in(folder, MADE_BY[result])
    svgs = drawings_in(folder, tuple(figures))
    try:
        return make(stored, details, svgs, f"armid report {name}")
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise ArmidError(
            f"{folder / result}, or details.json beside it, is not what `{MADE_BY[result]}` writes "
            f"({type(error).__name__}: {error}): a folder that it wrote is expected"
        ) from error


def write_page(files: NewFiles, result: str, folder: Path) -> None:
    """Write report.html from files that are about to be moved into a folder; result: the one that holds the result."""
    from armid.report.html import html

    text = html(page_of_folder(files.place, result, str(folder)))
    files.path(PAGE).write_text(text, encoding="utf-8")
