"""What every result shows of itself: a few lines, a table, a figure, its page and files; and results read back."""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from shutil import disk_usage
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from armid.errors import ArmidError, printable
from armid.units import DEG, angles_in

if TYPE_CHECKING:
    from pandas import DataFrame

    from armid.report.document import Document

DETAILS_FILE = "details.json"
# How the name of a folder begins in which files are made before they are moved in.
HIDDEN_PREFIX = ".armid-"
# Room on a disk without which no search is begun: results take some MB.
LEAST_ROOM = 3_000_000
# How a page tells a path whose name is not UTF-8.
ODD_NAMES = "backslashreplace"
# Letters of a result's `repr`.
MOST_LETTERS = 1_500
# What making a document of damaged numbers raises.
UNSHOWABLE = (KeyError, TypeError, ValueError, AttributeError, IndexError, ArithmeticError, RecursionError,
              FileNotFoundError)  # fmt: skip
Draw = Callable[[], Any]


class Parts(NamedTuple):
    """What is stored of a result, what else its page needs, and name -> what draws a figure."""

    result: dict[str, Any]
    details: dict[str, Any]
    figures: dict[str, Draw]


@dataclass(frozen=True)
class Kind:
    """A kind of result of a command on a campaign.

    module, function: of what makes its document of (result, details, SVG by name, command); imported when asked for, as
    every other command starts faster without it. The module's FIGURES names the SVG files on the page, the first of
    them the one that `plot` draws; its `parts_of` makes the Parts of a result.
    """

    command: str
    file: str
    page: str
    markdown: str
    module: str
    function: str
    details: str = DETAILS_FILE

    @property
    def figures(self) -> tuple[str, ...]:
        return tuple(import_module(self.module).FIGURES)

    def document(self, result: Mapping[str, Any], *others: Any) -> "Document":
        """Return the document of a stored result; others: details, SVG by name, command."""
        with angles_in(result.get("angle", DEG)):
            made: Document = getattr(import_module(self.module), self.function)(result, *others)
        return replace(made, angle=result.get("angle", DEG))

    def parts_of(self, result: object) -> Parts:
        made: Parts = import_module(self.module).parts_of(result)
        return made


IDENTIFICATION = Kind("armid identify", "result.json", "report.html", "report.md",
                      "armid.estimation.identify_document", "identify_document")  # fmt: skip
IDENTIFIABILITY = Kind("armid identifiability", "identifiability.json", "identifiability.html", "identifiability.md",
                       "armid.estimation.identifiability_document", "identifiability_document", "")  # fmt: skip
LOOP = Kind("armid close-loop", "report.json", "report.html", "report.md", "armid.loop.document", "loop_document")
STUDY_FILE = "study.sqlite"
# File -> what makes it with a page report.html, which would take the place of the page of another.
OWN_FOLDER = {IDENTIFICATION.file: IDENTIFICATION.command, LOOP.file: LOOP.command, STUDY_FILE: "armid study"}


class Shown:
    """Show a document in Python and in a notebook; a subclass says which document."""

    def document(self) -> "Document":
        raise NotImplementedError

    @property
    def table(self) -> "DataFrame":
        """The first table, with the units and digits that people read; numbers in SI are in `to_dict`."""
        from armid.report.files import frame_of

        return frame_of(self.document().main_tables[0])

    def __repr__(self) -> str:
        text = "\n".join(map(printable, self.document().said))
        return text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]} ..."

    def _repr_html_(self) -> str:
        from armid.report.html import fragment

        return fragment(self.document())


class Result(Shown):
    """Show and store the result of a command on a campaign, the same way from Python and from the command."""

    kind: ClassVar[Kind]
    campaign: Any

    @cached_property
    def parts(self) -> Parts:
        """What is stored of it; made once."""
        with angles_in(self.campaign.angle):
            made = self.kind.parts_of(self)
        return made._replace(result={**made.result, "angle": self.campaign.angle})

    def to_dict(self) -> dict[str, Any]:
        """Return the result as the command stores it as JSON, SI throughout; what is not known is None."""
        return self.parts.result

    def document(self) -> "Document":
        return self.kind.document(self.parts.result, self.parts.details, {}, "")

    def plot(self, name: str = "") -> Any:
        """Draw one figure and return it as a figure of matplotlib. name: of the figure, "" for the first."""
        from armid.report.style import detached

        figures = self.parts.figures
        if name and name not in figures:
            raise ArmidError(f"there is no figure '{name}': {', '.join(figures)} are known")
        with angles_in(self.campaign.angle):
            return detached(figures[name or next(iter(figures))]())

    def save(self, folder: str | Path, made_by: Mapping[str, Any] | None = None) -> list[str]:
        """Write JSON, figures, page and Markdown to a folder, all or none, and return their names.

        made_by: the command that is running and its settings, for the page.
        """
        from armid.report.style import save

        kind, (result, details, figures) = self.kind, self.parts
        with NewFiles(Path(folder)) as files, angles_in(self.campaign.angle):
            files.path(kind.file).write_text(json.dumps(result, indent=2, allow_nan=False) + "\n", encoding="utf-8")
            for name, draw in figures.items():
                endings = ("png", "svg") if name in kind.figures else ("png",)
                save(draw(), *(files.path(f"{name}.{ending}") for ending in endings))
            if details:
                stored = {"made_by": dict(made_by or {}), **details}
                files.path(DETAILS_FILE).write_text(json.dumps(stored, allow_nan=False) + "\n", encoding="utf-8")
            document = document_of(files.place, kind, str(folder))
            write_pages(document, kind, files)
        for name in set(kind.figures) - figures.keys():
            # an earlier result in the folder drew what this one has not
            for ending in ("png", "svg"):
                (Path(folder) / f"{name}.{ending}").unlink(missing_ok=True)
        return files.names


def write_pages(document: "Document", kind: Kind, files: "NewFiles") -> None:
    from armid.report.files import markdown
    from armid.report.html import html

    for name, text in ((kind.markdown, markdown(document)), (kind.page, html(document))):
        files.path(name).write_text(text, encoding="utf-8", errors=ODD_NAMES)


def document_of(folder: Path, kind: Kind, name: str) -> "Document":
    """Return the document of what a folder holds; name: of it, in the command that makes the page again."""
    files = {figure: folder / f"{figure}.svg" for figure in kind.figures}
    with refuse_damaged(folder, kind):
        result, details = (json.loads((folder / file).read_text(encoding="utf-8")) if file else {}
                           for file in (kind.file, kind.details))  # fmt: skip
        svgs = {figure: path.read_text(encoding="utf-8") for figure, path in files.items() if path.is_file()}
        return kind.document(result, details, svgs, f"armid report {name}")


@contextmanager
def refuse_damaged(folder: Path, kind: Kind) -> Iterator[None]:
    """Tell in one sentence that stored JSON cannot be shown: what makes a document of it, or draws its figures."""
    try:
        yield
    except UNSHOWABLE as error:
        if isinstance(error, ArmidError):
            raise
        raise ArmidError(f"{folder / kind.file}, or a file next to it, is not what `{kind.command}` writes, it was "
                         "damaged or changed: a folder as that command left it is expected") from error  # fmt: skip


class NewFiles:
    """Write files next to a folder and move them in when all are there, so that nothing half-written is found.

    A folder that is made for them goes again when nothing comes into it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names: list[str] = []

    def __enter__(self) -> "NewFiles":
        if self.folder.exists() and not self.folder.is_dir():
            raise ArmidError(f"{self.folder} is a file: a folder is expected")
        self._is_new = not self.folder.exists()
        self.folder.mkdir(parents=True, exist_ok=True)
        self._beside = TemporaryDirectory(dir=self.folder, prefix=HIDDEN_PREFIX)
        return self

    @property
    def place(self) -> Path:
        return Path(self._beside.name)

    def path(self, name: str) -> Path:
        if (self.folder / name).is_dir():
            raise ArmidError(f"{self.folder} holds a folder {name}: a place for a file of that name is expected")
        self.names.append(name)
        path = self.place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def __exit__(self, kind: object, error: object, *_: object) -> None:
        if isinstance(error, OSError) and error.filename is None and self.names:
            # a disk that is full does not say which file it had no room for
            error.filename = str(self.folder / self.names[-1])
        if kind is None:
            for name in self.names:
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                os.replace(self.place / name, self.folder / name)
        self._beside.cleanup()
        if self._is_new:
            with suppress(OSError):
                self.folder.rmdir()


def refuse_unwritable(folder: Path | None, file: str = "") -> None:
    """Refuse a folder before the work, not after it; file: the first that would come into it.

    A folder that holds the result of another command is refused, too.
    """
    if folder is not None:
        try:
            with NewFiles(folder):
                left = disk_usage(folder).free
        except OSError as error:
            where = folder / file if HIDDEN_PREFIX in str(error.filename) else error.filename or folder
            why = f"cannot be used: {error.strerror or error}, a folder that can be written is expected"
            raise ArmidError(f"{where} {why}") from error
        others = OWN_FOLDER.keys() - {file} if file in OWN_FOLDER else set()
        for other in sorted(name for name in others if (folder / name).is_file()):
            raise ArmidError(
                f"{folder} holds {other}, which is of `{OWN_FOLDER[other]}`: a folder without one is "
                "expected, since report.html would be overwritten"
            )
        if left < LEAST_ROOM:
            expected = f"at least {LEAST_ROOM / 1e6:.0f} MB are expected"
            raise ArmidError(f"{folder / file}: {left / 1e6:.1f} MB are left on its disk, {expected}")
