"""A page: what it says, in order, before it becomes HTML."""

from dataclasses import dataclass, field
from typing import ClassVar

from markupsafe import Markup

from armid.page.equations import Line


@dataclass(frozen=True)
class Cell:
    """Hold one cell: its text, and the number that it is sorted by, None for one that is sorted as text."""

    text: str
    number: float | None = None

    @property
    def key(self) -> str:
        """The number as a script reads it, "" for none."""
        return "" if self.number is None else repr(self.number).replace("inf", "Infinity")


@dataclass(frozen=True)
class Grid:
    """Hold one table. right: which columns hold numbers; note: what it shows, or what it leaves out."""

    kind: ClassVar[str] = "grid"
    title: str
    headers: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    right: tuple[bool, ...]
    note: str = ""


@dataclass(frozen=True)
class Drawing:
    """Hold one figure. svg: harmless (see `inline`); note: what it shows."""

    kind: ClassVar[str] = "drawing"
    title: str
    svg: Markup
    note: str = ""


@dataclass(frozen=True)
class Gallery:
    """Hold figures side by side.

    slider: label of one control for all of them, which fades between their layers "before" and "after"; "" for none.
    """

    kind: ClassVar[str] = "gallery"
    drawings: tuple[Drawing, ...]
    slider: str = ""


@dataclass(frozen=True)
class Sentences:
    """Hold sentences, one a bullet, under a title or none."""

    kind: ClassVar[str] = "sentences"
    sentences: tuple[str, ...]
    title: str = ""


@dataclass(frozen=True)
class Listing:
    """Hold lines that are shown as they are, each with "+" or "-" where it came or went; folded: shown when asked."""

    kind: ClassVar[str] = "listing"
    title: str
    lines: tuple[Line, ...]
    folded: bool = False


Part = Grid | Drawing | Gallery | Sentences | Listing


@dataclass(frozen=True)
class Section:
    """Hold one heading with what stands under it."""

    title: str
    parts: tuple[Part, ...]
    words: str = ""


@dataclass(frozen=True)
class Page:
    """Hold a whole page.

    of: what made it, in a word or two; question; answer: up to three sentences; warning: what must be known first, ""
    for nothing; sections: in order.
    """

    title: str
    of: str
    question: str
    answer: tuple[str, ...]
    sections: tuple[Section, ...]
    warning: str = field(default="", kw_only=True)
