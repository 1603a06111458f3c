"""Interim names, until study/blind has moved."""

from dataclasses import dataclass

from armid.report.document import Figure, Table


@dataclass(frozen=True, eq=False)
class ReportSection:
    """Hold one heading with what stands under it."""

    title: str
    words: str = ""
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()


@dataclass(frozen=True, eq=False)
class Report:
    """Hold a whole report.

    question: what the study asks; state: how much of it was run, one sentence; facts: how it was made, one sentence
    each; main: the table that answers the question; sections: everything, the main table's first; answer: the answer in
    at most two sentences, empty where only the tables give one.
    """

    name: str
    question: str
    state: str
    facts: tuple[str, ...]
    main: Table
    sections: tuple[ReportSection, ...]
    answer: tuple[str, ...] = ()

    @property
    def tables(self) -> tuple[Table, ...]:
        """All tables in order."""
        return tuple(t for s in self.sections for t in s.tables)

    @property
    def figures(self) -> tuple[Figure, ...]:
        """All figures in order."""
        return tuple(f for s in self.sections for f in s.figures)
