"""What is left of a run."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

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


Array = NDArray[np.float64]
# Little-endian on every machine; the values of a trace have few equal bytes, so that a higher level gains nothing.
COUNTS, VALUES, LEVEL = "<i8", "<f8", 1


class RunTrace(NamedTuple):
    """The improvements of one run.

    evaluations: counts from 1, (n_improvements,); values: best fitness from there on, (n_improvements,);
    X: its candidates, SI, (n_improvements, n_parameters), in the order of names.
    """

    run: str
    evaluations: NDArray[np.int64]
    values: Array
    X: Array
    names: tuple[str, ...]


def packed(evaluations: NDArray[np.int64], values: Array, X: Array) -> bytes:
    """Return a trace as compressed bytes: all evaluations, then all values, then X row by row."""
    parts = (evaluations.astype(COUNTS), values.astype(VALUES), np.ascontiguousarray(X, VALUES))
    return zlib.compress(b"".join(p.tobytes() for p in parts), LEVEL)


def unpacked(run: str, content: bytes, names: tuple[str, ...]) -> RunTrace:
    """Return a trace out of its bytes."""
    raw = zlib.decompress(content)
    n = len(raw) // (8 * (2 + len(names)))
    evaluations = np.frombuffer(raw, COUNTS, n)
    values = np.frombuffer(raw, VALUES, n, 8 * n)
    X = np.frombuffer(raw, VALUES, n * len(names), 16 * n).reshape(n, len(names))
    return RunTrace(run, evaluations.astype(np.int64), values.astype(np.float64), X.astype(np.float64), names)
