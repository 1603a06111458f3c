"""`armid report`: one page, tables and figures from stored results."""

import json
import shlex
from pathlib import Path
from typing import Any

import click

from armid.cli.options import NewFiles, examples, plugin_option
from armid.errors import ArmidError
from armid.estimation.identify_document import FIGURES as IDENTIFY_FIGURES
from armid.estimation.identify_document import identify_page
from armid.loop.document import FIGURES as LOOP_FIGURES
from armid.loop.document import loop_page
from armid.registry import load_registry
from armid.report.document import Page

BESIDE = "each table is there as CSV and LaTeX too, each figure as SVG."


@click.command("report", short_help="Write the page of stored results.", epilog=examples(
    "armid report results/table1_short", "armid report results/four_strokes",
))  # fmt: skip
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--key",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Truth of blind campaigns, which studies/blind/score.py scores.",
)
@plugin_option
def report_command(folder: Path, key: Path | None, plugins: tuple[str, ...]) -> None:
    """Write report.html, one self-contained page, beside stored results.

    DIR is a folder that `armid study`, `armid close-loop` or `armid identify` has written. The same results give the
    same bytes, and nothing is simulated. For a study, report.md, every table as CSV and LaTeX and every figure as PNG
    and SVG are written too, and the main table is printed; one that is not complete is reported as far as it is, and
    the report says so. An analysis of your own, --plugin FILE.py:name, becomes a section of it.
    """
    pass

    result = result_in(folder)
    if result == STUDY:
        report_study(folder, key, plugins)
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


def report_study(folder: Path, key: Path | None, plugins: tuple[str, ...]) -> None:
    """Write the page, tables and figures of a study, and print its main table."""
    from armid.report.files import write_files
    from armid.report.html import html
    from armid.report.markdown import markdown
    from armid.report.terminal import show
    from armid.study.document import report_of
    from armid.study.results import load_study

    results = load_study(folder)
    named = [word for plugin in plugins for word in ("--plugin", plugin)]
    again = shlex.join(["armid", "report", f"results/{results.study['name']}", *named])
    document = report_of(results, key, load_registry(plugins).analyses, again)
    place = results.path.parent
    with NewFiles(place) as files:
        write_files(document, files.path)
        files.path("report.md").write_text(
            markdown(document, f"Made from the stored results by `{again}`; {BESIDE}"), encoding="utf-8"
        )
        svgs = {f.name: (files.place / f"{f.name}.svg").read_text(encoding="utf-8") for f in document.figures}
        files.path(PAGE).write_text(html(document, svgs), encoding="utf-8")
    show(document)
    print(f"wrote report.md and {len(files.names) - 2} tables and figures to {place}, all on one page in {PAGE}")


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
