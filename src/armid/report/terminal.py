"""Show a document on a terminal: the answer first, then its main parts. No number is ever cut."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING

from armid.errors import printable
from armid.report.document import Cell, Column, Document, Sentences, Table, Text

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable

# Letters between columns, and those of the frame.
BETWEEN_COLUMNS, FRAME = 3, 1
# A column of words is folded down to this width before another column is left out; one of numbers in words, such as
# intervals, to the second.
LEAST_WORDS, LEAST_NUMBERS = 12, 22
FOLDED_WIDTH = 5
# The first column tells the rows apart, and is not folded down to this width.
NAME_WIDTH = 28


def show(document: Document) -> None:
    """Print warning, answer and main parts of a document; nothing from files is taken for markup or control codes.

    The width is that of the terminal, or COLUMNS; into a pipe without either tables are 80 wide and sentences whole.
    """
    from rich.console import Console

    console, whole = Console(), not sys.stdout.isatty()

    def say(*sentences: str) -> None:
        for text in filter(None, sentences):
            console.print(printable(text), highlight=False, markup=False, emoji=False, soft_wrap=whole)

    with console.capture() as captured:
        say(*document.said)
        for part in document.main:
            if isinstance(part, Table):
                print_table(part, console)
                say(part.note)
            elif isinstance(part, Sentences):
                say(part.title and f"{part.title}:", *(f"- {text}" for text in part.sentences))
            elif isinstance(part, Text):
                say(part.text)
    # not by rich, which ends the program where a pipe is broken
    print(captured.get(), end="", flush=True)


def print_table(table: Table, console: "Console") -> None:
    """Print the columns of a table that fit, the first ones first, and name the others below."""
    rows = [[replace(c, text=type(c.text)(printable(c.text))) for c in row] for row in table.cells()]
    columns = [replace(c, header=printable(c.header)) for c in table.columns]
    if not console.is_terminal:
        # nothing can be struck through in a pipe
        rows = [[replace(c, text=f"~{c.text}~") if c.is_struck else c for c in row] for row in rows]
    skip = int(table.grouped and len(columns) > 1)
    widths = fitted(columns[skip:], [row[skip:] for row in rows], console.width)
    names = [c.header or printable(c.key) for c in columns[skip + len(widths) :] if c.header or table.name]
    kept = columns[skip : skip + len(widths)]
    say = partial(console.print, markup=False, emoji=False, highlight=False, soft_wrap=True)
    say(printable(table.title), style="italic")
    for i, (group, own) in enumerate(groupby(rows, lambda row: row[0].text if skip else "")):
        if skip and group:
            say(f"{columns[0].header}: {group}", style="bold")
        console.print(drawn(kept, [row[skip:] for row in own], widths, not i))
    if names:
        place = f"in {table.name}.csv" if table.name else "on the page, and on a wider terminal"
        say(f"({place}: {', '.join(names)})", style="dim")


def fitted(columns: Sequence[Column], rows: Sequence[Sequence[Cell]], room: int) -> list[int]:
    """Return the widths of the columns that fit, the first at least; intervals are folded to make room for five."""
    whole, folded = (folded_to(columns, rows, room, least) for least in (LEAST_NUMBERS, LEAST_WORDS))
    return folded if len(whole) < min(FOLDED_WIDTH, len(columns)) else whole


def folded_to(columns: Sequence[Column], rows: Sequence[Sequence[Cell]], room: int, least_numbers: int) -> list[int]:
    whole, least = [], []
    for column, *cells in zip(columns, *rows, strict=True):
        texts = [cell.text for cell in cells]
        width = max((len(line) for text in texts for line in text.splitlines()), default=0)
        word = max((len(word) for text in texts for word in text.split()), default=0)
        head = max(map(len, column.header.split()), default=0)
        folded = least_numbers if any(map(str.isdigit, "".join(texts))) else LEAST_WORDS
        whole.append(max(width, len(column.header)))
        least.append(max(head, width if column.digits else min(width, max(folded, word))))
    least[0] = min(whole[0], max(least[0], NAME_WIDTH))
    n = max((k for k in range(1, len(columns) + 1) if FRAME + sum(least[:k]) + BETWEEN_COLUMNS * k <= room), default=1)
    widths = least[:n]
    left = room - FRAME - sum(widths) - BETWEEN_COLUMNS * n
    for i in range(n):
        more = max(min(left, whole[i] - widths[i]), 0)
        widths[i], left = widths[i] + more, left - more
    widths[0] = min(widths[0], max(room - FRAME - BETWEEN_COLUMNS, 1))
    return widths


def drawn(
    columns: Sequence[Column], rows: Sequence[Sequence[Cell]], widths: Sequence[int], headed: bool
) -> "RichTable":
    from rich.table import Table as RichTable
    from rich.text import Text as RichText

    made = RichTable(show_header=headed)
    for column, width in zip(columns, widths, strict=False):
        # as Text: a name is not markup
        shown = RichText(column.header if len(column.header) <= width else column.header.replace(" ", "\n"))
        made.add_column(shown, width=width, overflow="fold", justify="right" if column.digits else "left")
    for row in rows:
        made.add_row(*(RichText(cell.text, style="strike" if cell.is_struck else "")
                       for cell, _ in zip(row, widths, strict=False)))  # fmt: skip
    return made
