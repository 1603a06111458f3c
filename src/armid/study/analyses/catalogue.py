"""All analyses in the order of the report, and how one of a user becomes a section of it."""

from collections.abc import Callable, Mapping
from typing import Any

from pandas import DataFrame, RangeIndex
from pandas.api.types import is_bool_dtype, is_extension_array_dtype, is_integer_dtype, is_numeric_dtype

from armid.contract.check import parts_of
from armid.report.document import Column, Figure, Part, Section, Table, slug, unlike
from armid.report.style import pyplot
from armid.study.analyses.convergence import ANYTIME, CONVERGENCE
from armid.study.analyses.cramer_rao import CRAMER_RAO
from armid.study.analyses.errors import ERRORS
from armid.study.analyses.fitness_quality import FITNESS_QUALITY
from armid.study.analyses.overview import OVERVIEW, RUNS
from armid.study.analyses.ranks import BY_CLASS, RANKS
from armid.study.analyses.running_time import BEST_FITNESS, RUNNING_TIME
from armid.study.analyses.success import SUCCESS
from armid.study.analyses.table1 import TABLE1
from armid.study.analyses.table2 import TABLE2

# A new analysis is a file beside this one, and a name here.
ANALYSES = (
    OVERVIEW, TABLE1, TABLE2, CRAMER_RAO, FITNESS_QUALITY, SUCCESS, RUNNING_TIME, BEST_FITNESS, CONVERGENCE, ERRORS,
    RANKS, BY_CLASS, ANYTIME, RUNS,
)  # fmt: skip
# What stands in the report of a suite: no statistic of single parameters, which differ from problem to problem.
OF_SUITES = (BY_CLASS, ANYTIME, BEST_FITNESS, SUCCESS, RUNNING_TIME, RUNS)
# name -> function of the runs, see `armid.contract.check`.
OwnAnalyses = Mapping[str, Callable[[DataFrame], Any]]


def own_sections(own: OwnAnalyses, runs: DataFrame) -> tuple[Section, ...]:
    """Return a section for each analysis of a user that returns something; each gets a copy of the runs."""
    # before a plug-in imports it: no window is opened, and the figures look alike
    pyplot()
    sections = []
    for name, function in own.items():
        found = parts_of(name, function(runs.copy()))
        files = unlike([slug("own", name, title if title != name else "") for title in found])
        parts = [part(file, title, one) for file, (title, one) in zip(files, found.items(), strict=True)]
        if parts:
            sections.append(Section(name.replace("_", " ").capitalize(), tuple(parts)))
    return tuple(sections)


def part(file: str, title: str, found: Any) -> Part:
    if not isinstance(found, DataFrame):
        return Figure(file, title, "", lambda: found)
    frame = found if isinstance(found.index, RangeIndex) else found.reset_index()
    frame = frame.set_axis([" ".join(map(str, c)).strip() if isinstance(c, tuple) else str(c) for c in frame], axis=1)
    columns = tuple(Column(str(c), str(c), digits(frame[c].dtype)) for c in frame)
    # what is missing in a column of a pandas type of its own is no number
    for c in frame:
        if is_extension_array_dtype(frame[c].dtype):
            frame = frame.assign(**{str(c): frame[c].astype(object).where(frame[c].notna(), None)})
    return Table(file, title, "", frame, columns)


def digits(kind: Any) -> str:
    if is_bool_dtype(kind) or not is_numeric_dtype(kind):
        return ""
    return ".0f" if is_integer_dtype(kind) else ".6g"
