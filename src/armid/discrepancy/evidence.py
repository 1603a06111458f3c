"""The train records as whitened residuals: what every fit and every test of the loop looks at."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.noise_level import NoiseLevel, noise_levels
from armid.identifiability import WeightedRecords
from armid.model import Plant
from armid.problem import Replay, Space
from armid.record import Record
from armid.record.noise import correlation_sum

Array = NDArray[np.float64]
BLOCKS = 5


@dataclass(frozen=True, eq=False)
class Evidence:
    """Hold records with their noise.

    levels: noise of each record. kept: which of all samples enter fits, (n_samples,).
    """

    records: tuple[Record, ...]
    levels: tuple[NoiseLevel, ...]
    kept: NDArray[np.bool_]

    @cached_property
    def lengths(self) -> tuple[tuple[int, ...], ...]:
        """Samples in the windows of the pieces of each record."""
        return tuple(tuple(p.n_samples for p in r.pieces) for r in self.records)

    @cached_property
    def edges(self) -> NDArray[np.int64]:
        """Where the records begin in a vector of all samples, and its end, (n_records + 1,)."""
        return np.cumsum([0, *(sum(n) for n in self.lengths)])

    @property
    def known(self) -> bool:
        """Whether the noise of every record was measured at rest."""
        return all(level.known for level in self.levels)

    def by_record(self, values: Array) -> list[Array]:
        """Return the part of each record of a vector of all samples."""
        return [values[..., a:b] for a, b in pairwise(self.edges)]

    def white(self, signals: Sequence[Array]) -> Array:
        """Return signals of all records, each (n_candidates, n_samples of the record), whitened and end to end."""
        triples = zip(self.levels, signals, self.lengths, strict=True)
        return np.concatenate([level.white(s, lengths) for level, s, lengths in triples], axis=-1)

    def parts(self) -> list[NDArray[np.int64]]:
        """Return what is left out in turn, as numbers of samples: one manoeuvre with its repeats, or blocks of time.

        A repeat stays with its original: left in, it would tell what was left out.
        """
        names = [r.repeat_of or r.file for r in self.records]
        rows = self.by_record(np.arange(self.edges[-1]))
        pairs = list(zip(rows, names, strict=True))
        whole = [np.concatenate([x for x, n in pairs if n == name]) for name in dict.fromkeys(names)]
        return whole if len(whole) > 1 else list(np.array_split(whole[0], BLOCKS))

    def without(self, part: NDArray[np.int64]) -> "Evidence":
        """Return the evidence whose fits do not see some samples."""
        kept = self.kept.copy()
        kept[part] = False
        return replace(self, kept=kept)

    def independent(self, residual: Array) -> float:
        """Return how many samples of a whitened residual are independent: sum over records of n/(1 + 2 sum rho).

        That of noise alone is white, and all count; what a model leaves unexplained is smooth, and few do. The mean of
        each record is taken out: a constant shift says nothing of how fast the rest forgets.
        """
        parts = [x - np.mean(x) for x in self.by_record(residual)]
        return float(sum(len(x) / (1.0 + 2.0 * correlation_sum(x)) for x in parts))


def evidence_of(records: Sequence[Record], plant: Plant, others: Sequence[Record] = ()) -> Evidence:
    """Return all of some records as evidence; others: records of the same sensor whose rests tell of its noise too."""
    n = sum(r.n_samples for r in records)
    return Evidence(tuple(records), noise_levels(records, plant, others), np.ones(n, dtype=np.bool_))


@dataclass(frozen=True, eq=False)
class WhiteRecords(WeightedRecords):
    """Give least squares the whitened residuals of the samples that are kept.

    Weights stand for nothing here: the noise levels weigh.
    """

    evidence: Evidence = field(kw_only=True)

    @cached_property
    def measured(self) -> Array:
        """Whitened measured signals of the kept samples, (n_kept,)."""
        return self.evidence.white([r.measured for r in self.replays])[self.evidence.kept]

    def signals(self, Z: Array) -> Array:
        """Return whitened simulated signals of candidates in shares, (n_candidates, n_kept)."""
        return self.whole_signals(self.space.complete(self.values(Z)))[:, self.evidence.kept]

    def whole_signals(self, candidates: Array) -> Array:
        """Return whitened simulated signals of whole candidates, SI, on all samples, (n_candidates, n_samples)."""
        return self.evidence.white([r.signal(candidates) for r in self.replays])

    def whole(self) -> "WhiteRecords":
        """Return the problem that sees every sample."""
        return replace(self, evidence=replace(self.evidence, kept=np.ones_like(self.evidence.kept)))


def white_records(replays: tuple[Replay, ...], space: Space, evidence: Evidence) -> WhiteRecords:
    """Return records, a space and the evidence as one least-squares problem."""
    return WhiteRecords(replays, space, (), evidence=evidence)
