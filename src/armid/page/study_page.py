"""The page of a study, from the report that its stored results give."""

from collections.abc import Mapping, Sequence

from armid.page.cells import number_cell, text_cell
from armid.page.equations import Line
from armid.page.page import Cell, Drawing, Grid, Listing, Page, Part, Section, Sentences
from armid.page.parts import drawing, listing
from armid.study.report import Report
from armid.study.report import Section as ReportSection
from armid.study.tables import Table, shown_rows


def study_page(
    report: Report, svgs: Mapping[str, str], text: str, models: Sequence[str], commands: Sequence[str]
) -> Page:
    """Return the page.

    svgs: name of a figure -> SVG; text: the study's TOML file; models: equations of its models; commands: make the
    results and the page again.
    """
    complete = report.state.startswith("Complete")
    answer = (*report.answer, report.state) if complete else report.answer or (report.state,)
    sections = [page_section(s, svgs) for s in report.sections]
    sections.append(made_section(report, text, models, commands))
    return Page(report.name, "Study", report.question, answer, tuple(sections),
                warning="" if complete else report.state)  # fmt: skip


def page_section(section: ReportSection, svgs: Mapping[str, str]) -> Section:
    """Return a section with its tables and figures."""
    parts: list[Part] = [study_grid(t) for t in section.tables if t.most]
    parts += [study_drawing(f.name, f.title, f.words, svgs) for f in section.figures if f.name in svgs]
    return Section(section.title, tuple(parts), section.words)


def study_drawing(name: str, title: str, words: str, svgs: Mapping[str, str]) -> Drawing:
    """Return a figure."""
    return drawing(title, svgs[name], f"{name}-", words)


def study_grid(table: Table) -> Grid:
    """Return a table as the report shows it; it sorts by its numbers, not by their digits."""
    more = f" {table.n_hidden} more lines are in {table.name}.csv." if table.n_hidden else ""
    right = tuple(bool(c.digits) for c in table.columns)
    return Grid(table.title, tuple(c.header for c in table.columns), table_rows(table), right, f"{table.words}{more}")


def table_rows(table: Table) -> tuple[tuple[Cell, ...], ...]:
    """Return the cells."""
    frame = table.frame.head(table.most)
    columns = [list(frame[c.key]) for c in table.columns]
    rows = []
    for i, texts in enumerate(shown_rows(table)):
        cells = [number_cell(float(values[i]), c.digits, c.factor) if c.digits else text_cell(text)
                 for text, values, c in zip(texts, columns, table.columns, strict=True)]  # fmt: skip
        rows.append(tuple(cells))
    return tuple(rows)


def made_section(report: Report, text: str, models: Sequence[str], commands: Sequence[str]) -> Section:
    """Return facts, commands, the study's file and the equations."""
    parts: list[Part] = [
        Sentences(report.facts), Listing("Commands; the study's file is below", tuple(map(Line, commands))),
        listing(f"{report.name}.toml", text, folded=True),
    ]  # fmt: skip
    for i, model in enumerate(models):
        title = "Equations of the model" if len(models) == 1 else f"Equations of model {i + 1} of {len(models)}"
        parts.append(listing(title, model, folded=True))
    return Section("How it was made", tuple(parts))
