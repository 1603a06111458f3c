"""Records and the model side by side: what the model does in each of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armid.engine import Calibration, Prepared, accuracy_against, calibrate, prepare, probes
from armid.model import Model
from armid.problem.space import Space
from armid.record import Piece, Record

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Replay:
    """Simulate the pieces of one record, each on its own calibrated schedule."""

    record: Record
    model: Model
    pieces: tuple[Piece, ...]
    calibrations: tuple[Calibration, ...]
    threads: int = 1

    def outputs(self, candidates: Array) -> Iterator[tuple[Piece, Array]]:
        """Yield each piece with the recorded signal of whole candidates in its window, (n_candidates, n_samples)."""
        for piece, prepared in zip(self.pieces, self.prepared, strict=True):
            run = prepared.run(candidates, self.threads)
            yield piece, run.output[:, piece.window] if piece.window.start else run.output

    def signal(self, candidates: Array) -> Array:
        """Return the signal in the windows of all pieces, end to end, shape (n_candidates, n_samples)."""
        parts = [output for _, output in self.outputs(candidates)]
        return np.ascontiguousarray(parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1))

    @cached_property
    def prepared(self) -> tuple[Prepared, ...]:
        """What simulates each piece, made ready at the first call."""
        pairs = zip(self.pieces, self.calibrations, strict=True)
        return tuple(prepare(self.model, piece.manoeuvre, c.schedule) for piece, c in pairs)

    @property
    def measured(self) -> Array:
        """Measured signal in the windows of all pieces, end to end [unit of the record]."""
        return np.concatenate([p.measured[p.window] for p in self.pieces])

    @property
    def times(self) -> Array:
        """Times of these samples [s]."""
        return np.concatenate([p.manoeuvre.times()[p.window] for p in self.pieces])

    @property
    def engine_error(self) -> float:
        """Largest error of the engine that was measured on the probes [unit of the record]."""
        return max(c.error for c in self.calibrations)


def accuracy_for(record: Record, model: Model) -> str:
    """Return "fine" for a record whose noise would not hide the engine's standard error, else "standard"."""
    return accuracy_against(record.noise.rms, model)


def replay_of(
    record: Record, model: Model, space: Space, accuracy: str | None = None, threads: int = 1,
    known: dict[object, Calibration] | None = None,
) -> Replay:  # fmt: skip
    """Calibrate the engine on candidates spread over the space and make a record ready to be simulated.

    accuracy: "standard", "fine", or None: as the record's noise asks for. known: calibrations of the same model and
    space by manoeuvre, so that none is calibrated twice; those that are made are added.
    Raises ArmidError for an unknown accuracy.
    """
    spread = space.complete(probes(space.low[space.free], space.high[space.free]))
    wanted = accuracy or accuracy_for(record, model)
    pieces = tuple(p.until_window_end() for p in record.pieces)
    known = {} if known is None else known
    calibrations = []
    for piece in pieces:
        key = (wanted, *piece.manoeuvre.likeness())
        if key not in known:
            known[key] = calibrate(model, piece.manoeuvre, spread, wanted)
        calibrations.append(known[key])
    return Replay(record, model, pieces, tuple(calibrations), threads)


def replays(
    records: Sequence[Record], model: Model, space: Space, accuracy: str | None = None, threads: int = 1
) -> tuple[Replay, ...]:
    """Make several records ready to be simulated; a manoeuvre that several repeat is calibrated once."""
    known: dict[object, Calibration] = {}
    return tuple(replay_of(r, model, space, accuracy, threads, known) for r in records)


def residuals(replays: Sequence[Replay], space: Space, X: ArrayLike, weights: ArrayLike) -> Array:
    """Return w_i (x' - x) over all samples of all records, (n_candidates, n_total); NaN in a row that diverged.

    replays: n_records of them; X: free parameters, SI, (n_candidates, n_free) or (n_free,).
    weights: of the records, (n_records,), such as 1/noise [1/signal's unit].
    """
    candidates = space.complete(np.atleast_2d(np.asarray(X, dtype=np.float64)))
    signals = [replay.signal(candidates) for replay in replays]
    return weighted(signals, [replay.measured for replay in replays], weights)


def weighted(signals: Sequence[Array], measured: Sequence[Array], weights: ArrayLike) -> Array:
    """Return w_i (x' - x), end to end: signals (n_candidates, n_samples) and measured (n_samples,) of each record."""
    pairs = zip(signals, measured, np.asarray(weights, dtype=np.float64), strict=True)
    return np.concatenate([weight * (signal - x) for signal, x, weight in pairs], axis=1)
