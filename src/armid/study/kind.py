"""Kinds of studies: what one run does, and what the store keeps of it."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from armid.study.outcome import Outcome

Perform = Callable[..., Outcome]
IDENTIFIES, CLOSES_LOOP = "identify", "close_loop"


@dataclass(frozen=True)
class Table:
    """Declare a table of the store: its columns beside `run`, as SQL declares them, and what tells rows of a run apart.

    rows_by: the column that does, "" for a table with one row a run.
    """

    columns: tuple[str, ...]
    rows_by: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns beside `run`."""
        return tuple(column.split()[0] for column in self.columns)


@dataclass(frozen=True)
class Kind:
    """Declare a kind of studies.

    Functions are told as "module:function" and imported where they are called only.
    performed_by: of (task, workshop) -> Outcome. tables: name -> what the outcome's rows hold.
    read_by: of (table, text, folder, where, known) -> the study. described_by: of (study, folder of the store) -> what
    a report needs, as JSON can hold it. planned_by: of the study -> its runs. checked_by: of the study, before anything
    is written; "" where nothing is to be checked.
    reported_by: of (stored results, key) -> Report. summed_up_by: of stored results -> a report of one table.
    """

    performed_by: str
    tables: dict[str, Table]
    read_by: str
    described_by: str
    planned_by: str
    reported_by: str
    summed_up_by: str
    checked_by: str = ""

    def perform(self) -> Any:
        """Return the function that performs a run."""
        return function(self.performed_by)


def function(place: str) -> Any:
    """Return a function from where it is told to be: "module:function"."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


IDENTIFY = Kind(
    "armid.study.run:identify_run",
    {
        "identified": Table((
            "used INTEGER", "n_failed INTEGER", "value REAL", "stopped TEXT", "train_rmse REAL", "train_s REAL",
            "train_s1 REAL", "train_s2 REAL", "holdout_rmse REAL",
        )),
        "parameters": Table((
            "parameter TEXT NOT NULL", "unit TEXT", "value REAL", "low REAL", "high REAL", "deviation REAL",
            "correlation_max REAL", "at_bound INTEGER",
        ), rows_by="parameter"),
        "traces": Table(("names TEXT", "trace BLOB")),
    },
    read_by="armid.study.study:read_identifying",
    described_by="armid.study.study:description",
    planned_by="armid.study.plan:planned_runs",
    reported_by="armid.study.document:identify_report",
    summed_up_by="armid.study.document:identify_summary",
    checked_by="armid.study.runner:check_motion",
)  # fmt: skip
CLOSE_LOOP = Kind(
    "armid.study.loops:close_loop_run",
    {"loops": Table(("verdict TEXT NOT NULL", "cpu_seconds REAL NOT NULL", "report TEXT NOT NULL"))},
    read_by="armid.study.loops:read_loops",
    described_by="armid.study.loops:describe_loops",
    planned_by="armid.study.loops:planned_loops",
    reported_by="armid.study.blind.report:loops_report",
    summed_up_by="armid.study.blind.report:loops_summary",
)

KINDS: dict[str, Kind] = {IDENTIFIES: IDENTIFY, CLOSES_LOOP: CLOSE_LOOP}
