"""What a runner needs to know of a study, whatever its kind."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from armid.study.known import Known


class AnyStudy(Protocol):
    """A study that was read: `KINDS[kind]` tells how it is planned, described, performed and reported."""

    @property
    def name(self) -> str:
        """Return the name of the study and of its folder of results."""
        ...

    @property
    def kind(self) -> str:
        """Return the name of its kind."""
        ...

    @property
    def folder(self) -> Path:
        """Return where its file lies."""
        ...

    @property
    def known(self) -> Known:
        """Return what it may name."""
        ...

    @property
    def case_names(self) -> Sequence[str]:
        """Return what it is tried on."""
        ...

    @property
    def labels(self) -> Sequence[str]:
        """Return who tries."""
        ...
