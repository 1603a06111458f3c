"""What is left of a run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

DONE, FAILED = "done", "failed"


@dataclass(frozen=True)
class Task:
    """Hold a run that is to be performed: its id, and its settings as the store keeps them (JSON)."""

    run: str
    settings: str


@dataclass(frozen=True)
class Outcome:
    """Hold what a run gave, as plain values that a store can keep.

    status: "done", or "failed" with the reason in `error`. used: simulations. seconds: of the wall clock.
    started_at: date and time, for people; nothing depends on it. model: its equations. versions: package -> version.
    rows: table of the store -> rows of it without their run.
    """

    run: str
    status: str
    error: str = ""
    used: int = 0
    seconds: float = 0.0
    started_at: str = ""
    model: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    rows: Mapping[str, Sequence[tuple[Any, ...]]] = field(default_factory=dict)
