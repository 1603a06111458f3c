"""`armid report`: one page, tables and figures from stored results; and how a command shows its own result."""

import json
import shlex
from pathlib import Path
from typing import Any

import click

from armid.cli.options import command, examples, give, plugin_option, present, say
from armid.errors import ArmidError
from armid.registry import load_registry, place_in_plugin
from armid.report.result import (
    IDENTIFIABILITY,
    IDENTIFICATION,
    LOOP,
    UNSHOWABLE,
    Kind,
    NewFiles,
    Result,
    document_of,
    refuse_damaged,
    refuse_unwritable,
    write_pages,
)


def show_and_save(result: Result, out: Path | None) -> None:
    """Print the answer and the main tables of a result, then with a folder write its files, all or none."""
    document = result.document()
    present(document)
    files = [] if out is None else result.save(out, made_by())
    if files:
        say(f"wrote {', '.join(files)} to {out}")
    give(**result.to_dict(), answer=document.said, files=files)


def made_by() -> dict[str, Any]:
    """Return the command that is running, as a shell takes it, and the value of each of its options, for JSON."""
    context = click.get_current_context()
    words = [str(word) for word in context.find_root().obj or ()]
    settings = {name: json.loads(json.dumps(value, default=str)) for name, value in context.params.items()}
    return {"command": shlex.join(["armid", *words]), "settings": settings}


STUDY, PAGE = "study.sqlite", "report.html"


@command("report", short_help="Write the page of stored results.", epilog=examples(
    "armid report out/table1_short", "armid report out/four_strokes",
))  # fmt: skip
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--key", type=click.Path(path_type=Path), metavar="FILE",
              help="Truth of blind campaigns, which studies/blind/score.py scores.")  # fmt: skip
@click.option("--format", "form", type=click.Choice(["page", "pdf"]), default="page", show_default=True,
              help="page with its files, or only the figures of a study as PDF for a paper.")  # fmt: skip
@click.option("--width", type=click.Choice(["single", "double"]), show_default="double",
              help="Columns of the paper that a PDF figure spans.")  # fmt: skip
@plugin_option
def report_command(folder: Path, key: Path | None, form: str, width: str | None, plugins: tuple[str, ...]) -> None:
    """Write report.html, one self-contained page, into the folder of stored results.

    DIR is a folder that `armid study`, `armid close-loop`, `armid identify` or `armid identifiability` (whose page is
    identifiability.html) has written. The same results give the same bytes, and nothing is simulated. The answer stands
    at the head of the page; the command that made the results has printed it. For a study, report.md, every table as
    CSV and LaTeX and every figure as PNG and SVG are written too. A study that is not complete is reported as far as it
    is, and says so. An analysis of your own, --plugin FILE.py:name, becomes a section; plug-ins of another kind may be
    named as for the study, and change nothing.
    """
    if width is not None and form != "pdf":
        raise ArmidError(f"--width {width} is given without --format pdf: a width of PDF figures alone is expected")
    kind = kind_in(folder)
    if kind is None:
        report_study(folder, key, width or "double" if form == "pdf" else "", plugins)
        return
    if form == "pdf":
        raise ArmidError(f"{folder} holds no study: --format pdf draws the figures of a study, leave it out here")
    refuse_unwritable(folder, kind.page)
    if key is not None:
        raise ArmidError(f"{folder} holds no study, and a key is the truth of a study's campaigns: none is expected")
    document = document_of(folder, kind, str(folder))
    with NewFiles(folder) as files, refuse_damaged(folder, kind):
        write_pages(document, kind, files)
    say(f"wrote {kind.page} ({(folder / kind.page).stat().st_size / 1e6:.1f} MB) and {kind.markdown} to {folder}")
    give(answer=document.said, folder=folder, files=files.names)


def report_study(folder: Path, key: Path | None, width: str, plugins: tuple[str, ...]) -> None:
    """Write page and files of a study, or with the width of a column its figures for a paper."""
    from armid.report.files import write_prints
    from armid.study.document import report_of, write_report
    from armid.study.results import load_study

    results = load_study(folder)
    analyses, place = load_registry(plugins).analyses, results.path.parent
    refuse_unwritable(place, PAGE)
    try:
        document = report_of(results, key, analyses, made_by()["command"])
        if document.warning:
            say(document.warning)
        with NewFiles(place) as files:
            if width:
                write_prints(document, width, files.path)
            else:
                write_report(document, files)
    except UNSHOWABLE as error:
        # what a plug-in does wrong stays its own
        if isinstance(error, ArmidError) or place_in_plugin(error) is not None:
            raise
        expected = "its runs cannot be shown, what armid wrote is expected"
        raise ArmidError(f"{results.path} is damaged: {expected}") from error
    if width:
        say(f"wrote {len(files.names)} figures as PDF to {place}")
    else:
        say(f"wrote report.md and {len(files.names) - 2} tables and figures to {place}, all on one page in {PAGE}")
    give(answer=document.said, folder=place, files=files.names)


def kind_in(folder: Path) -> Kind | None:
    """Return the kind of result that a folder holds, None for a study, whose store may be named itself."""
    if folder.name == STUDY or (folder / STUDY).is_file():
        return None
    kinds = [kind for kind in (LOOP, IDENTIFICATION) if (folder / kind.file).is_file()]
    if len(kinds) > 1:
        names = " and ".join(kind.file for kind in kinds)
        raise ArmidError(f"{folder} holds {names}, which two commands wrote: one of them is expected")
    if not kinds and (folder / IDENTIFIABILITY.file).is_file():
        return IDENTIFIABILITY
    if kinds:
        return kinds[0]
    names = f"{STUDY} of `armid study`, {LOOP.file} of `{LOOP.command}` or {IDENTIFICATION.file}"
    raise ArmidError(f"{folder} holds no result: {names} of `{IDENTIFICATION.command}` is expected")
