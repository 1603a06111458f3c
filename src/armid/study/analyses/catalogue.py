"""All analyses in the order of the report, and how one of a user becomes a section of it."""

from collections.abc import Callable, Mapping
from typing import Any

from pandas import DataFrame, RangeIndex
from pandas.api.types import is_bool_dtype, is_extension_array_dtype, is_integer_dtype, is_numeric_dtype

from armid.errors import ArmidError
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

# A new analysis is a file in this folder, and a name here.
ANALYSES = (
    OVERVIEW, TABLE1, TABLE2, CRAMER_RAO, FITNESS_QUALITY, SUCCESS, RUNNING_TIME, BEST_FITNESS, CONVERGENCE, ERRORS,
    RANKS, BY_CLASS, ANYTIME, RUNS,
)  # fmt: skip
# What stands in the report of a suite: no statistic of single parameters, which differ from problem to problem.
OF_SUITES = (BY_CLASS, ANYTIME, BEST_FITNESS, SUCCESS, RUNNING_TIME, RUNS)
# name -> function of the runs, see `armid.study.analyses.analysis.wide_runs`.
OwnAnalyses = Mapping[str, Callable[[DataFrame], Any]]


def own_sections(own: OwnAnalyses, runs: DataFrame) -> tuple[Section, ...]:
    """Return a section for each analysis of a user that returns something; each gets a copy of the runs."""
    # before a plug-in imports it: no window is opened, and the figures look alike
    pyplot()
    sections = []
    for name, function in own.items():
        contents = parts_of(name, function(runs.copy()))
        files = unlike([slug("own", name, title if title != name else "") for title in contents])
        parts = [part(file, title, one) for file, (title, one) in zip(files, contents.items(), strict=True)]
        if parts:
            sections.append(Section(name.replace("_", " ").capitalize(), tuple(parts)))
    return tuple(sections)


def parts_of(name: str, output: Any) -> dict[str, Any]:
    """Return title -> DataFrame or matplotlib figure of what an analysis returned.

    output: a DataFrame, a figure (or what carries one, such as axes), or a dict, tuple or list of these; None: nothing.
    """
    from matplotlib.figure import Figure
    from pandas import DataFrame

    if output is None:
        return {}
    if isinstance(output, Mapping):
        titled = {str(title): part for title, part in output.items()}
    elif isinstance(output, tuple | list):
        titled = {f"{name} {i}": part for i, part in enumerate(output, 1)}
    else:
        titled = {name: output}
    parts = {title: part if isinstance(part, DataFrame) else getattr(part, "figure", part)
             for title, part in titled.items()}  # fmt: skip
    for title, part in parts.items():
        if not isinstance(part, DataFrame | Figure):
            raise ArmidError(f"analysis '{name}' returns a {type(part).__name__} as '{title}': a pandas DataFrame, a "
                             "matplotlib figure, or a dict or tuple of these is expected")  # fmt: skip
        if isinstance(part, DataFrame):
            names = [str(n) for n in (*(n for n in part.index.names if n is not None), *part.columns)]
            if twice := [n for n in names if names.count(n) > 1]:
                raise ArmidError(f"analysis '{name}' returns a table '{title}' with '{twice[0]}' twice as a column or "
                                 "index: each name once is expected")  # fmt: skip
    return parts


def part(file: str, title: str, content: Any) -> Part:
    if not isinstance(content, DataFrame):
        return Figure(file, title, "", lambda: content)
    frame = content if isinstance(content.index, RangeIndex) else content.reset_index()
    frame = frame.set_axis([" ".join(map(str, c)).strip() if isinstance(c, tuple) else str(c) for c in frame], axis=1)
    columns = tuple(Column(str(c), str(c), digits(frame[c].dtype)) for c in frame)
    # what is missing in a column of a pandas type of its own is not a number
    for c in frame:
        if is_extension_array_dtype(frame[c].dtype):
            frame = frame.assign(**{str(c): frame[c].astype(object).where(frame[c].notna(), None)})
    return Table(file, title, "", frame, columns)


def digits(kind: Any) -> str:
    if is_bool_dtype(kind) or not is_numeric_dtype(kind):
        return ""
    return ".0f" if is_integer_dtype(kind) else ".6g"
