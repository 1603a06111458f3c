"""A run as it is planned, handed out and performed, and the trace of its improvements."""

import hashlib
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

DONE, FAILED = "done", "failed"
# Hexadecimal digits of a run's id: two of a million runs share theirs with a probability of 1e-8.
ID_LENGTH = 16
# Little-endian on every machine; the values of a trace have few equal bytes, so that a higher level gains nothing.
COUNTS, VALUES, LEVEL = "<i8", "<f8", 1


class Planned(NamedTuple):
    """A run: its id, its settings (JSON), and the words under which it is reported.

    noise_deg_s: None for records that are read; they keep the noise that they have.
    """

    run: str
    settings: str
    case: str
    identifier: str
    fitness: str
    noise_deg_s: float | None
    window: str
    seed: int
    budget: int


def planned(settings: Mapping[str, Any], *words: Any) -> Planned:
    """Return a run whose id is a hash of all that decides its result; words: the fields of Planned after settings."""
    text = json.dumps(settings, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return Planned(hashlib.sha256(text.encode()).hexdigest()[:ID_LENGTH], text, *words)


class MissingRun(NamedTuple):
    """A run that is to be performed: its id, and its settings as the store keeps them (JSON)."""

    run: str
    settings: str


Rows = Mapping[str, Sequence[tuple[Any, ...]]]


class Performed(NamedTuple):
    """What performing a run gave: simulations used, the model's equations, and rows by table of the store."""

    used: int
    model: str
    rows: Rows


@dataclass(frozen=True)
class Outcome:
    """What a run gave, as plain values that a store can keep.

    status: "done", or "failed" with the reason in `error`. used: simulations. seconds: of the wall clock. started_at:
    for people; nothing depends on it. rows: table of the store -> rows of it without their run.
    """

    run: str
    status: str
    error: str = ""
    used: int = 0
    seconds: float = 0.0
    started_at: str = ""
    model: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    rows: Rows = field(default_factory=dict)


Array = NDArray[np.float64]


class RunTrace(NamedTuple):
    """The improvements of one run: counts from 1 and best fitness, (n,); X: candidates, SI, (n, n_parameters)."""

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
