"""Write a document as Markdown; figures are the PNG files in its folder."""

import re

from armid.report.document import Document, Figure, Gallery, Listing, Part, Sentences, Table, Text


def markdown(document: Document, made_by: str = "") -> str:
    """Return the page; made_by: a last sentence of its head, which may hold `code`."""
    texts = [f"# {escaped(document.title)}", escaped(document.question)]
    texts += [f"**{escaped(sentence)}**" for sentence in (document.warning, *document.answer[:1]) if sentence]
    texts += [escaped(" ".join(document.answer[1:])), bullets(document.facts), made_by]
    for section in document.sections:
        texts += [f"## {escaped(section.title)}", escaped(section.text)]
        texts += [text for part in section.parts for text in part_texts(part, section.title)]
    return "\n\n".join(part for part in texts if part) + "\n"


def part_texts(part: Part, section: str) -> list[str]:
    if isinstance(part, Text):
        return [escaped(part.text)]
    if isinstance(part, Gallery):
        return [f"![{escaped(part.slider or part.name)}]({part.name}.png)"] if part.name else []
    if (isinstance(part, Table) and not part.most) or (isinstance(part, Listing) and part.folded):
        return []
    title = f"### {escaped(part.title)}" if part.title not in ("", section) else ""
    if isinstance(part, Table):
        return [title, table_text(part), escaped(part.note)]
    if isinstance(part, Figure):
        return [title, f"![{escaped(part.title)}]({part.name}.png)", escaped(part.caption)]
    return [title, bullets(part.sentences) if isinstance(part, Sentences) else code(part)]


def table_text(table: Table) -> str:
    header = [escaped(c.header) for c in table.columns]
    rule = ["---:" if c.digits else "---" for c in table.columns]
    rows = [[f"~~{escaped(c.text)}~~" if c.is_struck else escaped(c.text) for c in row] for row in table.cells()]
    return "\n".join(f"| {' | '.join(line)} |" for line in (header, rule, *rows))


def bullets(sentences: tuple[str, ...]) -> str:
    return "\n".join(f"- {escaped(sentence)}" for sentence in sentences)


def code(listing: Listing) -> str:
    """Return lines as they are, in a fence that none of them closes."""
    marked = any(line.mark for line in listing.lines)
    lines = [f"{line.mark or ' '} {line.text}" if marked else line.text for line in listing.lines]
    fence = "`" * max(3, *(1 + len(run) for run in re.findall("`+", "\n".join(lines))), 3)
    return "\n".join([fence + ("diff" if marked else "text"), *lines, fence])


def escaped(text: str) -> str:
    """Return text that stays in its place and as it is: one cell, no HTML, no link, no image, no emphasis."""
    for plain, safe in (("\\", "\\\\"), ("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("|", "\\|"), ("\n", " ")):
        text = text.replace(plain, safe)
    text = re.sub(r"\*|~~|(?<!\w)_|_(?!\w)", r"\\\g<0>", text)
    # every kind of link and image has a closing bracket before one of these
    return re.sub(r"\](?=\s*[(\[:])", r"\\]", text)
