"""`armid report`: one page, tables and figures from stored results."""

import json
import os
import shlex
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from armid.cli.options import examples, plugin_option
from armid.errors import ArmidError
from armid.registry import load_registry

if TYPE_CHECKING:
    from armid.report.document import Document

DETAILS = "details.json"


@dataclass(frozen=True)
class Kind:
    """A kind of result of a command on a campaign.

    file : of the result, JSON. page, markdown : names of its page and of its Markdown, "" for none.
    module, function : of what makes its document of (result, details, SVG by name, command); imported when asked for,
    as every other command starts faster without it. The module's FIGURES names the SVG files that are on the page.
    """

    command: str
    file: str
    page: str
    module: str
    function: str
    markdown: str = ""

    @property
    def figures(self) -> tuple[str, ...]:
        return tuple(import_module(self.module).FIGURES)

    @property
    def document(self) -> "Callable[..., Document]":
        made: Callable[..., Document] = getattr(import_module(self.module), self.function)
        return made


IDENTIFICATION = Kind("armid identify", "result.json", "report.html",
                      "armid.estimation.identify_document", "identify_document")  # fmt: skip
IDENTIFIABILITY = Kind("armid identifiability", "identifiability.json", "identifiability.html",
                       "armid.estimation.identifiability_document", "identifiability_document")  # fmt: skip
LOOP = Kind("armid close-loop", "report.json", "report.html", "armid.loop.document", "loop_document", "report.md")


def show_and_write(kind: Kind, result: Mapping[str, Any], details: Mapping[str, Any], out: Path | None,
                   figures: Mapping[str, Callable[[], Any]]) -> None:  # fmt: skip
    """Print the document of a result; with a folder, write result, details, figures, page and Markdown, all or none.

    details: but for `made_by`, which is set here. figures: name -> what draws it as matplotlib's.
    """
    from armid.report.markdown import markdown
    from armid.report.style import save
    from armid.report.terminal import show

    stored = {"made_by": made_by(), **details}
    show(kind.document(result, stored, {}, ""))
    if out is None:
        return
    with NewFiles(out) as files:
        files.path(kind.file).write_text(json.dumps(result, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        for name, draw in figures.items():
            endings = ("png", "svg") if name in kind.figures else ("png",)
            save(draw(), *(files.path(f"{name}.{ending}") for ending in endings))
        if details:
            files.path(DETAILS).write_text(json.dumps(stored, allow_nan=False) + "\n", encoding="utf-8")
        if kind.markdown:
            text = markdown(document_of(files.place, kind, str(out)))
            files.path(kind.markdown).write_text(text, encoding="utf-8")
        write_page(files, kind, out)
    print(f"wrote {', '.join(files.names)} to {out}")


def write_page(files: "NewFiles", kind: Kind, folder: Path, stored: Path | None = None) -> int:
    """Write the page of a result that is in `stored` (None: among the new files); return its size in bytes."""
    from armid.report.html import html

    text = html(document_of(stored or files.place, kind, str(folder)))
    files.path(kind.page).write_text(text, encoding="utf-8")
    return len(text.encode())


def document_of(folder: Path, kind: Kind, name: str) -> "Document":
    """Return the document of what a folder holds.

    folder: where the files are. name: of the folder, in the command that makes the page again.

    Raises ArmidError for files that are not what the command writes.
    """
    result = read_json(folder / kind.file, kind.command)
    has_details = (folder / DETAILS).is_file() and kind is not IDENTIFIABILITY
    details = read_json(folder / DETAILS, kind.command) if has_details else {}
    files = {figure: folder / f"{figure}.svg" for figure in kind.figures}
    try:
        svgs = {figure: path.read_text(encoding="utf-8") for figure, path in files.items() if path.is_file()}
    except UnicodeDecodeError as error:
        raise ArmidError(f"{folder} holds a figure that is no text: the SVG of `{kind.command}` is expected") from error
    try:
        return kind.document(result, details, svgs, f"armid report {name}")
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise ArmidError(
            f"{folder / kind.file}, or details.json beside it, is not what `{kind.command}` writes "
            f"({type(error).__name__}: {error}): a folder that it wrote is expected"
        ) from error


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


def made_by() -> dict[str, Any]:
    """Return the command that is running, as a shell takes it, and the value of each of its options, for JSON."""
    context = click.get_current_context()
    words = [str(word) for word in context.find_root().obj or ()]
    settings = {name: json.loads(json.dumps(value, default=str)) for name, value in context.params.items()}
    return {"command": shlex.join(["armid", *words]), "settings": settings}


class NewFiles:
    """Write files beside a folder and move them in when all are there, so that nothing half-written is found.

    names: the files so far. A folder that is made for them goes again when nothing comes into it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names: list[str] = []

    def __enter__(self) -> "NewFiles":
        if self.folder.exists() and not self.folder.is_dir():
            raise ArmidError(f"--out {self.folder} is a file: a folder is expected")
        self._is_new = not self.folder.exists()
        self.folder.mkdir(parents=True, exist_ok=True)
        self._beside = TemporaryDirectory(dir=self.folder, prefix=".armid-")
        return self

    @property
    def place(self) -> Path:
        """Where the files are until all are there."""
        return Path(self._beside.name)

    def path(self, name: str) -> Path:
        """Return where to write a file for now.

        Raises ArmidError when a folder has its name.
        """
        if (self.folder / name).is_dir():
            raise ArmidError(f"--out {self.folder} holds a folder {name}: a place for a file of that name is expected")
        self.names.append(name)
        path = self.place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:
            for name in self.names:
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                os.replace(self.place / name, self.folder / name)
        self._beside.cleanup()
        if self._is_new:
            with suppress(OSError):
                self.folder.rmdir()


def refuse_unwritable(folder: Path | None) -> None:
    """Refuse a folder before the work, not after it.

    Raises ArmidError for a file, OSError for a place where nothing can be written.
    """
    if folder is not None:
        with NewFiles(folder):
            pass


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
