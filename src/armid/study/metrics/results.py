"""What the report needs to know of a study: the shape of its stored results."""

from collections.abc import Iterator
from typing import Any, Protocol

from pandas import DataFrame

from armid.study.trace import RunTrace


class Results(Protocol):
    """Stored results of a study: tidy frames, and the traces one by one."""

    @property
    def runs(self) -> DataFrame:
        """Return one row a run."""
        ...

    @property
    def parameters(self) -> DataFrame:
        """Return one row a run and free parameter."""
        ...

    @property
    def study(self) -> dict[str, Any]:
        """Return what was asked: name, question, cases, identifiers, numbers of runs."""
        ...

    def iter_traces(self) -> Iterator[RunTrace]:
        """Return the traces one after the other."""
        ...
