"""The train records as whitened residuals: what every fit and every test of the loop looks at.

Coloured noise (a 40 Hz gyro sampled at 1 kHz) holds far fewer independent samples than samples. An autoregression of
the sensor's signal at rest, pooled over the records and applied to residuals and sensitivities alike, turns it white
with a standard deviation of 1: every test then counts samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.signal import lfilter

from armid.estimation.information import MISFIT
from armid.estimation.least_squares import Estimates, LeastSquaresProblem
from armid.model import Array, Plant
from armid.problem.problem import signals_of
from armid.record import Record
from armid.record.noise import correlation_sum, new_share

# The engine's own error is a 200,000th of the speed scale; a noise of ten times that hides it.
LEAST_NOISE = 5e-5
MOST_TERMS, FEWEST_FOR_COLOUR, LAGS = 8, 50, 500


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
        return not len(self.terms)

    @property
    def known(self) -> bool:
        return self.n_samples > 0

    def white(self, values: Array, lengths: Sequence[int]) -> Array:
        """Return signals so filtered that the noise in them is white with a standard deviation of 1.

        The first samples of each piece go through the inverse Cholesky factor of their covariance.
        values: [unit of the records], shape (..., n_samples), pieces end to end; lengths: of the pieces.
        """
        if self.is_white:
            return np.asarray(values / self.innovation)
        n, pieces = len(self.terms), []
        for start, end in pairwise(np.cumsum([0, *lengths])):
            piece = values[..., start:end]
            filtered = lfilter(np.concatenate([[1.0], -self.terms]), [1.0], piece, axis=-1) / self.innovation
            filtered[..., :n] = piece[..., :n] @ self.head.T
            pieces.append(filtered)
        return np.concatenate(pieces, axis=-1)


def noise_levels(records: Sequence[Record], plant: Plant, others: Sequence[Record] = ()) -> tuple[NoiseLevel, ...]:
    """Return the noise of each record: pooled over the rests of all records of one output and sampling interval.

    plant: the sizes of its outputs give the floor below which the engine's error would count as a discrepancy. others:
    records of the same sensors whose rests count too.
    """
    sizes = {"": plant.sizes[0]} | {o.name: size for o, size in zip(plant.outputs, plant.sizes, strict=True)}
    sensors = [(r.output, r.manoeuvre.interval) for r in records]
    pooled = {
        (output, t): pooled_level([r for r in (*records, *others) if (r.output, r.manoeuvre.interval) == (output, t)],
                                  LEAST_NOISE * sizes[output]) for output, t in set(sensors)
    }  # fmt: skip
    return tuple(pooled[sensor] for sensor in sensors)


def pooled_level(records: Sequence[Record], floor: float) -> NoiseLevel:
    rested = [r for r in records if r.noise.source == "rest"]
    if not rested:
        return white_level(max(float(np.median([r.noise.rms for r in records])), floor), 0)
    rests = [r.rest - np.mean(r.rest) for r in rested]
    n = sum(len(r) - 1 for r in rests)
    # Quantisation alone has noise that a rest on one step does not show: the record's own figure knows of it.
    rms = max(np.sqrt(sum(float(r @ r) for r in rests) / n), min(r.noise.rms for r in rested), floor)
    return coloured_level(rests, rms, n) if n >= FEWEST_FOR_COLOUR else white_level(rms, n)


def white_level(rms: float, n_samples: int) -> NoiseLevel:
    return NoiseLevel(float(rms), np.empty(0), float(rms), np.empty((0, 0)), n_samples, n_samples, n_samples)


def coloured_level(rests: Sequence[Array], rms: float, n: int) -> NoiseLevel:
    """Return the autoregression of pooled rests with the order that the Bayesian criterion asks for.

    Yule-Walker on the pooled, biased autocovariance: stable for any data (Brockwell and Davis, section 8.1).
    """
    total = sum(len(r) for r in rests)
    covariance = np.array([sum(float(r[lag:] @ r[: len(r) - lag]) for r in rests) / total
                           for lag in range(MOST_TERMS + 1)])  # fmt: skip
    if covariance[0] <= 0.0:
        return white_level(rms, n)
    fits = [yule_walker(covariance, order) for order in range(MOST_TERMS + 1)]
    scores = [n * np.log(variance) + order * np.log(n) for order, (_, variance) in enumerate(fits)]
    order = int(np.argmin(scores))
    if order == 0:
        return white_level(rms, n)
    terms, variance = fits[order]
    correlation = list(covariance[: order + 1] / covariance[0])
    while len(correlation) <= LAGS:
        correlation.append(float(terms @ np.array(correlation[: -order - 1 : -1])))
    rho = np.array(correlation[1:])
    slow, power = n / max(1.0 + 2.0 * rho.sum(), 1.0), n / (1.0 + 2.0 * float(rho @ rho))
    # Each mean that was taken out took more than one sample's worth of slow noise with it.
    rms *= float(np.sqrt(1.0 / max(1.0 - len(rests) / slow, 0.5)))
    # Scaled so that the rest has the rms that is reported; degrees of freedom went into the terms.
    scale = rms**2 / covariance[0]
    innovation = float(np.sqrt(variance * scale * n / (n - order)))
    factor = cholesky(toeplitz(covariance[:order] * scale), lower=True)
    head = solve_triangular(factor, np.eye(order), lower=True)
    return NoiseLevel(float(rms), terms, innovation, head, n, slow, power)


def yule_walker(covariance: Array, order: int) -> tuple[Array, float]:
    """Return the terms of an autoregression and the variance of its innovations."""
    if order == 0:
        return np.empty(0), float(covariance[0])
    terms = np.linalg.solve(toeplitz(covariance[:order]), covariance[1 : order + 1])
    return np.asarray(terms, dtype=np.float64), float(covariance[0] - terms @ covariance[1 : order + 1])


@dataclass(frozen=True, eq=False)
class Cover:
    """Hold the covariance B B' that a signal without a form adds to whitened noise: 1 + B B' = 1 + Q L Q'.

    basis: Q, orthonormal, (n_samples, rank). sizes: L, (rank,).
    """

    basis: Array
    sizes: Array

    @classmethod
    def of(cls, columns: Array) -> "Cover":
        """Return the cover of columns B, each a signal of one standard deviation, (n_samples, n)."""
        left, values, _ = np.linalg.svd(columns, full_matrices=False)
        return cls(left, values**2)

    def white(self, signals: Array) -> Array:
        """Return signals divided by the root of the covariance, (..., n_samples)."""
        shares = 1.0 - 1.0 / np.sqrt(1.0 + self.sizes)
        return np.asarray(signals - ((signals @ self.basis) * shares) @ self.basis.T)


@dataclass(frozen=True, eq=False)
class WhitenedData:
    """Hold records with their noise; what is of each record is of each of its signals, the records one by one.

    levels: noise of each. sound: 0 where a sample is invalid, else 1, (n_samples,). estimates: where those of
    fits are kept, None: nowhere. cover: of a signal without a form; None for none.
    """

    records: tuple[Record, ...]
    levels: tuple[NoiseLevel, ...]
    sound: Array
    estimates: Estimates | None = None
    cover: Cover | None = None

    @property
    def log_cover(self) -> float:
        """Log determinant of the covariance that a signal without a form adds."""
        return 0.0 if self.cover is None else float(np.sum(np.log1p(self.cover.sizes)))

    @cached_property
    def each(self) -> tuple[Record, ...]:
        """The records, once for each of their signals."""
        return tuple(one for r in self.records for one in r.each)

    @cached_property
    def lengths(self) -> tuple[tuple[int, ...], ...]:
        """Samples in the windows of the pieces of each record."""
        return tuple(r.lengths for r in self.each)

    @cached_property
    def edges(self) -> NDArray[np.int64]:
        """Where the records begin in a vector of all samples, and its end, (n_records + 1,)."""
        return np.cumsum([0, *(sum(n) for n in self.lengths)])

    @property
    def known(self) -> bool:
        return all(level.known for level in self.levels)

    def n_noise(self, otherwise: float) -> float:
        """Return from how many independent samples the noise of slow signals is known; `otherwise` where from none."""
        return float(min((level.n_slow for level in self.levels if level.known), default=otherwise))

    def by_record(self, values: Array) -> list[Array]:
        return [values[..., a:b] for a, b in pairwise(self.edges)]

    def white(self, signals: Sequence[Array]) -> Array:
        """Return signals of all records, each (n_candidates, n_samples of the record), whitened and end to end."""
        triples = zip(self.levels, signals, self.lengths, strict=True)
        white = np.concatenate([level.white(s, lengths) for level, s, lengths in triples], axis=-1)
        # Invalid samples have weight 0.
        white = white if self.sound.all() else white * self.sound
        return white if self.cover is None else self.cover.white(white)

    def independent(self, residual: Array) -> float:
        """Return how many samples of a whitened residual are independent: sum over records of n/(1 + 2 sum rho).

        That of noise alone is white, and all count; what a model leaves unexplained is smooth, and few do. The mean of
        each record is taken out: a constant shift says nothing of how fast the rest forgets.
        """
        parts = [x - np.mean(x) for x in self.by_record(residual)]
        return float(sum(len(x) / (1.0 + 2.0 * correlation_sum(x)) for x in parts))

    def trust(self, residual: Array) -> Array:
        """Return the weight of each sample in intervals: 1, or n_eff/chi2 in records whose residual tells of more.

        Where the residual is more than noise its own size and correlation in time count (as in `information.level_of`).
        """
        found = []
        for level, part in zip(self.levels, self.by_record(residual), strict=True):
            # How well the noise itself is known: its mean square scatters by 2/n.
            doubt = 1.0 + 3.0 * np.sqrt(2.0 / (level.n_slow if level.known else len(part)))
            square, weight = float(np.mean(part**2)), 1.0
            if square > MISFIT * doubt:
                weight = 1.0 / square / (1.0 + 2.0 * correlation_sum(part))
            elif not level.known:
                # differences tell the least that the noise can be, and nothing of its colour
                weight = new_share(part) / max(square, 1.0)
            found.append(np.full(len(part), weight))
        return np.concatenate(found)


def whitened(records: Sequence[Record], plant: Plant, others: Sequence[Record] = ()) -> WhitenedData:
    """Return records with their noise; others: records of the same sensors whose rests tell of their noise too."""
    each, more = (tuple(one for r in some for one in r.each) for some in (records, others))
    levels = noise_levels(each, plant, more)
    sound = np.concatenate([soundness(r, len(level.terms)) for r, level in zip(each, levels, strict=True)])
    return WhitenedData(tuple(records), levels, sound)


def soundness(record: Record, reach: int) -> Array:
    """Return 0 for the samples of a record behind some that are no data, as far as the filter of the noise reaches."""
    sound = []
    for piece in record.pieces:
        n_seen = record.signals[0].n_seen(piece)
        apart = np.diff(np.arange(piece.manoeuvre.n_samples)[record.signals[0].samples(piece)])
        # of a sensor that holds its value, or comes rarely, the usual distance is not a gap
        near = np.append(True, apart <= 1.5 * np.median(apart)) if apart.size else np.ones(n_seen, np.bool_)
        unsound = ~near
        for _ in range(reach - 1):
            unsound[1:] |= unsound[:-1]
        sound.append(np.where(unsound & (reach > 0), 0.0, 1.0))
    return np.concatenate(sound)


@dataclass(frozen=True, eq=False)
class WhiteRecords(LeastSquaresProblem):
    """Give least squares the whitened residuals, and behind them a row for each parameter that is known beforehand.

    known: parameter -> mean and standard deviation of what is known, SI; the row is (value - mean)/deviation.
    """

    data: WhitenedData
    known: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @cached_property
    def rows(self) -> tuple[NDArray[np.int64], Array, Array]:
        """Places of the known parameters among the free ones, their means and deviations, SI."""
        names = [n for n in self.space.free_names if n in self.known]
        places = np.array([self.space.free_names.index(n) for n in names], dtype=np.int64)
        pairs = np.array([self.known[n] for n in names]).reshape(len(names), 2)
        return places, pairs[:, 0], pairs[:, 1]

    @cached_property
    def measured(self) -> Array:
        _, means, deviations = self.rows
        return np.append(self.weighted([r.measured for r in self.replays]), means / deviations)

    def signals(self, Z: Array) -> Array:
        places, _, deviations = self.rows
        found = self.weighted(self.simulated(Z))
        return np.hstack([found, self.values(Z)[:, places] / deviations]) if len(places) else found

    def weighted(self, signals: Sequence[Array]) -> Array:
        return self.data.white(signals)

    def whole_signals(self, candidates: Array) -> Array:
        return self.data.white(signals_of(self.replays, candidates))

    def padded(self, columns: Array) -> Array:
        """Return columns of the samples, (n_samples, n), with zeros in the rows of known parameters."""
        return np.vstack([columns, np.zeros((len(self.rows[0]), columns.shape[1]))])

    @property
    def plain(self) -> "WhiteRecords":
        """The problem of the samples alone."""
        return replace(self, known={}) if self.known else self
