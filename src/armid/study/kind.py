"""Kinds of studies: what one run does, and what the store keeps of it."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from armid.study.outcome import Outcome

Perform = Callable[..., Outcome]


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

    performed_by: "module:function" of (task, workshop) -> Outcome, imported where runs are performed only.
    tables: name -> what the outcome's rows hold.
    """

    performed_by: str
    tables: dict[str, Table]

    def perform(self) -> Any:
        """Return the function."""
        module, _, name = self.performed_by.partition(":")
        return getattr(import_module(module), name)


IDENTIFY = Kind(
    "armid.study.identify_run:identify_run",
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
)  # fmt: skip

KINDS: dict[str, Kind] = {"identify": IDENTIFY}
