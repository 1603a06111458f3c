"""A document: what a result says, in order, before it is rendered.

Every result (identification, identifiability, closed loop, study) is one `Document`: the answer, then sections of text,
tables, figures and listings. `terminal.show`, `markdown.markdown`, `html.html` and `files.write_files` render it and
word nothing themselves; each escapes what comes from files.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from difflib import SequenceMatcher
from typing import TYPE_CHECKING, Any, ClassVar, Union

if TYPE_CHECKING:
    from pandas import DataFrame

# Rows of a table that are shown; its file holds all.
MOST_SHOWN = 60
FIRST_NUMBER = re.compile(r"\s*(?:below )?([-+]?(?:inf|(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?))(?=[\s%,;(]|$)")


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Parameters
    ----------
    key : name in the frame, and in the header of the CSV file.
    header : heading with the unit; "" where it needs none.
    digits : format of its numbers, such as ".3g"; "" for text. Numbers stand to the right.
    factor : from the number in the frame (SI) to the one shown.
    """

    key: str
    header: str
    digits: str = ""
    factor: float = 1.0


@dataclass(frozen=True)
class Cell:
    """A cell as shown, and the number (SI) it is sorted by; None for one that is sorted as text."""

    text: str
    number: float | None = None

    @property
    def key(self) -> str:
        """The number as a script reads it, "" for none."""
        return "" if self.number is None else repr(self.number).replace("inf", "Infinity")


@dataclass(frozen=True, eq=False)
class Table:
    """A table.

    Parameters
    ----------
    name : of its files, without ending; "" for a table that is not written to files.
    title, caption : the caption says how each number was computed.
    frame : SI values, as a pandas frame or as rows in the order of the columns; None and NaN are left empty.
    columns : what is shown, in order.
    most : rows that are shown, 0 for a table that is only written to its CSV file.
    grouped : whether rows that share the first column stand under it as a heading (terminal only).
    """

    kind: ClassVar[str] = "table"
    name: str
    title: str
    caption: str
    frame: Union["DataFrame", Sequence[Sequence[Any]]]
    columns: tuple[Column, ...]
    most: int = MOST_SHOWN
    grouped: bool = False

    @property
    def note(self) -> str:
        """The caption, and how many rows are not shown."""
        hidden = len(self.frame) - self.most
        return f"{self.caption} {hidden} more lines are in {self.name}.csv." if hidden > 0 else self.caption

    def cells(self) -> list[list[Cell]]:
        """Return the rows that are shown."""
        frame: Any = self.frame
        if hasattr(frame, "columns"):
            rows = zip(*(frame[c.key].head(self.most) for c in self.columns), strict=True)
        else:
            rows = frame[: self.most]
        return [[cell(value, column) for value, column in zip(row, self.columns, strict=True)] for row in rows]


def table(
    title: str, columns: Sequence[object], rows: Sequence[Sequence[Any]], caption: str = "", name: str = ""
) -> Table:
    """Return a table of plain rows, all shown; a column of text may be given by its header alone."""
    told = tuple(c if isinstance(c, Column) else Column(str(c), str(c)) for c in columns)
    return Table(name, title, caption, rows, told, max(len(rows), 1))


def cell(value: Any, column: Column) -> Cell:
    """Return a cell; text is sorted by the number it begins with, if any."""
    if value is None or value != value:  # noqa: PLR0124 - a NaN differs from itself
        return Cell("")
    if column.digits and not isinstance(value, str):
        # + 0.0 takes the sign off a zero
        return Cell(format(column.factor * float(value) + 0.0, column.digits), float(value))
    found = FIRST_NUMBER.match(str(value))
    return Cell(str(value), float(found.group(1)) if found else None)


@dataclass(frozen=True, eq=False)
class Figure:
    """A figure.

    Parameters
    ----------
    name : of its files, without ending.
    title, caption : the caption says what each mark is.
    draw : returns it as matplotlib's; None for one that is only stored.
    svg : its stored text; "" for one that is drawn when it is needed.
    """

    kind: ClassVar[str] = "figure"
    name: str
    title: str
    caption: str
    draw: Callable[[], Any] | None = None
    svg: str = ""


@dataclass(frozen=True)
class Gallery:
    """Figures side by side on a page.

    Parameters
    ----------
    figures : in order.
    slider : label of one control that fades all of them between their layers "before" and "after"; "" for none.
    name : of the PNG file that shows them together, for Markdown; "" for none.
    wide : whether each has a row of its own.
    """

    kind: ClassVar[str] = "gallery"
    figures: tuple[Figure, ...]
    slider: str = ""
    name: str = ""
    wide: bool = False


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    kind: ClassVar[str] = "text"
    text: str


@dataclass(frozen=True)
class Sentences:
    """Sentences, one a bullet, under a title or none."""

    kind: ClassVar[str] = "sentences"
    sentences: tuple[str, ...]
    title: str = ""


@dataclass(frozen=True)
class Line:
    """A line of a listing; mark: "+" for one that came, "-" for one that went, "" for one that stayed."""

    text: str
    mark: str = ""


@dataclass(frozen=True)
class Listing:
    """Lines that are shown as they are; folded: on a page only when asked for."""

    kind: ClassVar[str] = "listing"
    title: str
    lines: tuple[Line, ...]
    folded: bool = False


Part = Table | Figure | Gallery | Text | Sentences | Listing


@dataclass(frozen=True, eq=False)
class Section:
    """A heading with what stands under it: a paragraph, then parts."""

    title: str
    parts: tuple[Part, ...]
    text: str = ""


@dataclass(frozen=True, eq=False)
class Document:
    """A whole document.

    Parameters
    ----------
    title : name of the campaign or study.
    of : what made it, in a word or two.
    question, answer : the answer in up to three sentences.
    warning : what must be known first, "" for nothing.
    facts : how it was made, a sentence each.
    sections : in order.
    main : the parts of the sections that a terminal shows below the answer.
    """

    title: str
    of: str
    question: str
    answer: tuple[str, ...]
    sections: tuple[Section, ...]
    warning: str = field(default="", kw_only=True)
    facts: tuple[str, ...] = field(default=(), kw_only=True)
    main: tuple[Part, ...] = field(default=(), kw_only=True)

    @property
    def tables(self) -> tuple[Table, ...]:
        """All tables in order."""
        return tuple(p for s in self.sections for p in s.parts if isinstance(p, Table))

    @property
    def figures(self) -> tuple[Figure, ...]:
        """All figures in order, without those of galleries."""
        return tuple(p for s in self.sections for p in s.parts if isinstance(p, Figure))


def listing(title: str, text: str, folded: bool = False) -> Listing:
    """Return a text as it is."""
    return Listing(title, lines(text), folded)


def lines(text: str) -> tuple[Line, ...]:
    """Return the lines of a text."""
    return tuple(Line(line) for line in text.splitlines())


def changed(before: str, after: str) -> tuple[Line, ...]:
    """Return the lines of two texts as one, marked where they differ."""
    old, new = before.splitlines(), after.splitlines()
    found: list[Line] = []
    for what, i, j, k, m in SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if what == "equal":
            found += [Line(t) for t in old[i:j]]
            continue
        found += [Line(t, "-") for t in old[i:j]] + [Line(t, "+") for t in new[k:m]]
    return tuple(found)


def slug(*texts: str) -> str:
    """Return a file name of letters, digits and underscores: "pso, literal" becomes "pso_literal"."""
    return re.sub(r"[^A-Za-z0-9]+", "_", "_".join(texts)).strip("_").lower()


def unlike(names: list[str]) -> list[str]:
    """Return the names with a number behind those that are there already."""
    found: list[str] = []
    for name in names:
        again = sum(re.fullmatch(rf"{re.escape(name)}(_\d+)?", f) is not None for f in found)
        found.append(f"{name}_{again + 1}" if again else name)
    return found
