"""The report as a Markdown page."""

from collections.abc import Callable, Iterator
from pathlib import Path

from armid.study.analyses.drawing import save
from armid.study.analyses.table import Table, csv, escaped, latex, markdown
from armid.study.report import Report, ReportSection


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


def section_text(section: ReportSection) -> Iterator[str]:
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


PAGE = "report.md"


def write_report(report: Report, command: str, path_of: Callable[[str], Path]) -> None:
    """Write the page, each table as CSV and LaTeX and each figure as PNG and SVG.

    command: what makes it again, named on the page. path_of: file name -> where to write it. The bytes depend on the
    stored results and the versions of the packages only: no date, no place.
    """
    for table in report.tables:
        path_of(f"{table.name}.csv").write_text(csv(table), encoding="utf-8")
        if table.most:
            path_of(f"{table.name}.tex").write_text(latex(table), encoding="utf-8")
    for figure in report.figures:
        save(figure.draw(), path_of(f"{figure.name}.png"), path_of(f"{figure.name}.svg"))
    path_of(PAGE).write_text(page(report, command), encoding="utf-8")
