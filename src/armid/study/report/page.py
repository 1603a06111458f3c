"""The report as a Markdown page."""

from collections.abc import Iterator

from armid.study.report.report import Report, Section
from armid.study.tables import Table, escaped, markdown


def page(report: Report, command: str) -> str:
    """Return the page; tables and figures are named as their files beside it.

    command: what makes the page again.
    """
    return "\n\n".join([*head(report, command), *(part for s in report.sections for part in section_text(s))]) + "\n"


def head(report: Report, command: str) -> Iterator[str]:
    """Yield title, question, state and facts."""
    yield f"# {escaped(report.name)}"
    if report.question:
        yield escaped(report.question)
    yield f"**{escaped(report.state)}**"
    yield "\n".join(f"- {escaped(fact)}" for fact in report.facts)
    yield f"Made from the stored results by `{command}`; each table is there as CSV and LaTeX too, each figure as SVG."


def section_text(section: Section) -> Iterator[str]:
    """Yield heading, words, tables and figures of a section."""
    yield f"## {escaped(section.title)}"
    if section.words:
        yield escaped(section.words)
    for table in section.tables:
        if table.most:
            yield from table_text(table)
    for figure in section.figures:
        yield f"### {escaped(figure.title)}"
        yield f"![{escaped(figure.title)}]({figure.name}.png)"
        yield escaped(figure.words)


def table_text(table: Table) -> Iterator[str]:
    """Yield title, cells and words of a table."""
    yield f"### {escaped(table.title)}"
    yield markdown(table)
    more = f" {table.n_hidden} more lines are in {table.name}.csv." if table.n_hidden else ""
    yield escaped(f"{table.words}{more}")
