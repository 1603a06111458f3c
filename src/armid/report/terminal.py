"""Show a document on a terminal: the answer first, then its main parts."""

import sys
from typing import TYPE_CHECKING

from armid.report.document import Document, Sentences, Table, Text

if TYPE_CHECKING:
    from rich.table import Table as RichTable


# Columns of text and of tables where the output is no terminal.
TEXT_WIDTH, TABLE_WIDTH = 120, 150


def show(document: Document) -> None:
    """Print warning, answer and main parts of a document; nothing from files is taken for markup or control codes."""
    from rich.console import Console

    text_width, table_width = (None, None) if sys.stdout.isatty() else (TEXT_WIDTH, TABLE_WIDTH)
    console = Console(width=table_width)

    def say(text: str) -> None:
        console.print(printable(text), highlight=False, markup=False, emoji=False, width=text_width)

    for sentence in (document.warning, *document.answer):
        if sentence:
            say(sentence)
    for part in document.main:
        if isinstance(part, Table):
            console.print(drawn(part))
            if part.note:
                say(part.note)
        elif isinstance(part, Sentences):
            for sentence in part.sentences:
                say(f"- {sentence}")
        elif isinstance(part, Text):
            say(part.text)


def drawn(table: Table) -> "RichTable":
    """Return a table as rich draws it; what the first column of a grouped one repeats becomes a line of its own."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table as RichTable
    from rich.text import Text as RichText

    rows = [[RichText(printable(c.text)) for c in row] for row in table.cells()]
    title = RichText(printable(table.title), style="italic")
    if not table.grouped:
        made = RichTable(title=title)
        for column in table.columns:
            made.add_column(RichText(printable(column.header)))
        for row in rows:
            made.add_row(*row)
        return made
    made = RichTable(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    first, *others = table.columns
    for column in others:
        header = RichText(printable(column.header.replace(" ", "\n", 1)))
        made.add_column(header, justify="right" if column.digits else "left")
    before = ""
    for group, *cells in rows:
        if group.plain != before:
            made.add_section()
            made.add_row(RichText(f"{printable(first.header)}: {group}"), style="bold")
        before = group.plain
        made.add_row(*cells)
    return made


def printable(text: str) -> str:
    return "".join(c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in text)
