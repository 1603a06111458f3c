"""The improvements of a run, and how they are stored."""

import zlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
