"""`armid report`: one page, tables and figures from stored results."""

import shlex
from pathlib import Path

import click

from armid.cli.options import examples, plugin_option
from armid.cli.results import IDENTIFIABILITY, IDENTIFICATION, LOOP, Kind, NewFiles, write_page
from armid.errors import ArmidError
from armid.registry import load_registry

STUDY, PAGE = "study.sqlite", "report.html"
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

    DIR is a folder that `armid study`, `armid close-loop`, `armid identify` or `armid identifiability` (whose page is
    identifiability.html) has written. The same results give the same bytes, and nothing is simulated. For a study,
    report.md, every table as CSV and LaTeX and every figure as PNG and SVG are written too, and the main table is
    printed; one that is not complete is reported as far as it is, and the report says so. An analysis of your own,
    --plugin FILE.py:name, becomes a section of it.
    """
    kind = kind_in(folder)
    if kind is None:
        report_study(folder, key, plugins)
        return
    if key is not None:
        raise ArmidError(f"{folder} holds no study, and a key is the truth of a study's campaigns: none is expected")
    with NewFiles(folder) as files:
        size = write_page(files, kind, folder, folder)
    print(f"wrote {kind.page} ({size / 1e6:.1f} MB) to {folder}")


def report_study(folder: Path, key: Path | None, plugins: tuple[str, ...]) -> None:
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
