"""The train records as whitened residuals: what every fit and every test of the loop looks at."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.signal import lfilter

from armid.estimation.least_squares import WeightedRecords
from armid.model import Plant
from armid.problem.replay import Replay
from armid.problem.space import Space
from armid.record import Record
from armid.record.noise import correlation_sum

# The noise of a sensor as its rest before the motion shows it, and the filter that makes it white.
#
# Coloured noise (a 40 Hz gyro sampled at 1 kHz) holds far fewer independent samples than samples. An autoregression of
# the pooled rest, applied to residuals and sensitivities alike, turns it white: every test then counts samples.

Array = NDArray[np.float64]
# The engine's own error is a 200,000th of the speed scale; a noise of ten times that hides it.
LEAST_NOISE = 5e-5
MOST_TERMS = 8
FEWEST_FOR_COLOUR = 50
LAGS = 500


@dataclass(frozen=True, eq=False)
class NoiseLevel:
    """Hold the noise of the records of one sensor.

    rms: [unit of the records]. terms: autoregression e_t = w_t - sum a_k w_(t-k), (n_terms,), empty for white noise.
    innovation: rms of e_t. head: turns the first n_terms samples white, (n_terms, n_terms).
    n_samples: samples at rest from which it is known, 0 where none were recorded: then `rms` comes from differences of
    the motion, and is a lower bound rather than a measurement. n_slow, n_power: of these, how many count as independent
    for slow signals, n/(1 + 2 sum rho), and for a mean square, n/(1 + 2 sum rho^2).
    """

    rms: float
    terms: Array
    innovation: float
    head: Array
    n_samples: int
    n_slow: float
    n_power: float

    @property
    def is_white(self) -> bool:
        """Whether the noise shows no correlation in time."""
        return not len(self.terms)

    @property
    def known(self) -> bool:
        """Whether the noise was measured at rest."""
        return self.n_samples > 0

    def white(self, values: Array, lengths: Sequence[int]) -> Array:
        """Return signals so filtered that the noise in them is white with a standard deviation of 1.

        values: [unit of the records], shape (..., n_samples), pieces end to end; lengths: of the pieces.
        """
        if self.is_white:
            return np.asarray(values / self.innovation)
        edges = np.cumsum([0, *lengths])
        pieces = [self.white_piece(values[..., a:b]) for a, b in pairwise(edges)]
        return np.concatenate(pieces, axis=-1)

    def white_piece(self, values: Array) -> Array:
        """Return one piece filtered; its first samples through the inverse Cholesky factor of their covariance."""
        n = len(self.terms)
        filtered = lfilter(np.concatenate([[1.0], -self.terms]), [1.0], values, axis=-1) / self.innovation
        filtered[..., :n] = values[..., :n] @ self.head.T
        return np.asarray(filtered)


def noise_levels(records: Sequence[Record], plant: Plant, others: Sequence[Record] = ()) -> tuple[NoiseLevel, ...]:
    """Return the noise of each record: pooled over the rests of all records that were sampled at one interval.

    plant: its speed scale gives the floor below which the engine's error would count as a discrepancy. others: records
    of the same sensor whose rests count too.
    """
    floor = LEAST_NOISE * plant.scales.speed
    rests = [*records, *others]
    intervals = [r.manoeuvre.interval for r in records]
    pooled = {t: pooled_level([r for r in rests if r.manoeuvre.interval == t], floor) for t in set(intervals)}
    return tuple(pooled[t] for t in intervals)


def pooled_level(records: Sequence[Record], floor: float) -> NoiseLevel:
    """Return the common noise of records of one sampling interval."""
    rested = [r for r in records if r.noise.source == "rest"]
    if not rested:
        return white_level(max(float(np.median([r.noise.rms for r in records])), floor), 0)
    rests = [r.rest - np.mean(r.rest) for r in rested]
    n = sum(len(r) - 1 for r in rests)
    # Quantisation alone has noise that a rest on one step does not show: the record's own figure knows of it.
    rms = max(np.sqrt(sum(float(r @ r) for r in rests) / n), min(r.noise.rms for r in rested), floor)
    return coloured_level(rests, rms, n) if n >= FEWEST_FOR_COLOUR else white_level(rms, n)


def white_level(rms: float, n_samples: int) -> NoiseLevel:
    """Return the level of white noise."""
    return NoiseLevel(float(rms), np.empty(0), float(rms), np.empty((0, 0)), n_samples, n_samples, n_samples)


def coloured_level(rests: Sequence[Array], rms: float, n: int) -> NoiseLevel:
    """Return the autoregression of pooled rests with the order that the Bayesian criterion asks for.

    Yule-Walker on the pooled, biased autocovariance: stable for any data (Brockwell and Davis, section 8.1).
    """
    covariance = pooled_covariance(rests, MOST_TERMS)
    if covariance[0] <= 0.0:
        return white_level(rms, n)
    fits = [yule_walker(covariance, order) for order in range(MOST_TERMS + 1)]
    scores = [n * np.log(variance) + order * np.log(n) for order, (_, variance) in enumerate(fits)]
    order = int(np.argmin(scores))
    if order == 0:
        return white_level(rms, n)
    terms, variance = fits[order]
    rho = correlations(terms, covariance[: order + 1] / covariance[0])
    slow, power = n / max(1.0 + 2.0 * rho.sum(), 1.0), n / (1.0 + 2.0 * float(rho @ rho))
    # Each mean that was taken out took more than one sample's worth of slow noise with it.
    rms *= float(np.sqrt(1.0 / max(1.0 - len(rests) / slow, 0.5)))
    # Scaled so that the rest has the rms that is reported; degrees of freedom went into the terms.
    scale = rms**2 / covariance[0]
    innovation = float(np.sqrt(variance * scale * n / (n - order)))
    factor = cholesky(toeplitz(covariance[:order] * scale), lower=True)
    head = solve_triangular(factor, np.eye(order), lower=True)
    return NoiseLevel(float(rms), terms, innovation, head, n, slow, power)


def correlations(terms: Array, first: Array) -> Array:
    """Return the autocorrelation of an autoregression at lags from 1 to 500; first: at lags 0 to its order."""
    rho = list(first)
    while len(rho) <= LAGS:
        rho.append(float(terms @ np.array(rho[: -len(terms) - 1 : -1])))
    return np.array(rho[1:])


def pooled_covariance(rests: Sequence[Array], most: int) -> Array:
    """Return the autocovariance at lags 0 to `most`, from all rests together."""
    total = sum(len(r) for r in rests)
    return np.array([sum(float(r[lag:] @ r[: len(r) - lag]) for r in rests) / total for lag in range(most + 1)])


def yule_walker(covariance: Array, order: int) -> tuple[Array, float]:
    """Return the terms of an autoregression and the variance of its innovations."""
    if order == 0:
        return np.empty(0), float(covariance[0])
    terms = np.linalg.solve(toeplitz(covariance[:order]), covariance[1 : order + 1])
    return np.asarray(terms, dtype=np.float64), float(covariance[0] - terms @ covariance[1 : order + 1])


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
