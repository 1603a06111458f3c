"""The train records as whitened residuals: what every fit and every test of the loop looks at.

`NoiseModel` of estimation/noise_model.py turns noise white, of residuals and sensitivities alike, with a standard
deviation of 1: every test then counts samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from armid.estimation.input_noise import answers
from armid.estimation.least_squares import Estimates, LeastSquaresProblem
from armid.estimation.noise_model import MISFIT, NoiseModel, noise_levels, sensor_of
from armid.model import Array, Plant
from armid.problem.cover import Cover
from armid.problem.problem import Replay, by_record, samples_of, signals_of
from armid.problem.starts import answers_to_start
from armid.record import Record
from armid.record.sensor import FEWEST_REST_SAMPLES, InputNoise, correlation_sum, new_share, runs


@dataclass(frozen=True, eq=False)
class Block:
    """Hold how noise is correlated in the samples of a piece, all its signals together; at: theirs among all, (n,)."""

    at: NDArray[np.int64]
    cover: Cover


@dataclass(frozen=True, eq=False)
class WhitenedData:
    """Hold records with their noise. Lists and arrays have an entry for each signal, record by record.

    levels: noise of each. sound: 0 where a sample is invalid, else 1, or its weight where noise grows, (n_samples,).
    estimates: where those of fits are kept, None: nowhere. blocks: correlated noise, of pieces that have some. cover:
    of a signal without a form; None for none.
    """

    records: tuple[Record, ...]
    levels: tuple[NoiseModel, ...]
    sound: Array
    estimates: Estimates | None = None
    blocks: tuple[Block, ...] = ()
    cover: Cover | None = None

    @cached_property
    def log_noise(self) -> float:
        """Half of the log determinant of the covariance of the noise."""
        scale = sum(float(np.sum(np.log(level.innovation / sound[sound > 0.0])))
                    for level, sound in zip(self.levels, self.by_record(self.sound), strict=True))  # fmt: skip
        return float(scale + 0.5 * sum(np.sum(np.log1p(b.cover.sizes)) for b in self.sound_blocks))

    @cached_property
    def counts_all(self) -> bool:
        """Whether all samples count alike."""
        return bool((self.sound == 1.0).all())

    @cached_property
    def sound_blocks(self) -> tuple[Block, ...]:
        """The blocks in the samples that count."""
        return self.blocks if self.counts_all else blocks_of_rows(self.blocks, self.sound.tobytes())

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

    @property
    def n_simulated(self) -> int:
        """Samples of one simulation of all records; a sensor that holds its value shows fewer."""
        return sum(piece.manoeuvre.n_samples for record in self.records for piece in record.pieces)

    @cached_property
    def edges(self) -> NDArray[np.int64]:
        """Where the records begin in a vector of all samples, and its end, (n_records + 1,)."""
        return np.cumsum([0, *(sum(n) for n in self.lengths)])

    def with_levels(self, levels: tuple[NoiseModel, ...]) -> "WhitenedData":
        """Return the records with another noise."""
        return with_standstills(replace(self, levels=levels, sound=soundness_of(self.each, levels)))

    def of_records(self, which: Sequence[int]) -> "WhitenedData":
        """Return the data of some of the records."""
        signals = np.cumsum([0, *(len(r.each) for r in self.records)])
        own = [i for k in which for i in range(signals[k], signals[k + 1])]
        rows = np.concatenate([np.arange(self.edges[i], self.edges[i + 1]) for i in own])
        blocks = tuple(replace(b, at=np.searchsorted(rows, b.at)) for b in self.blocks if np.isin(b.at[0], rows))
        return replace(self, records=tuple(self.records[k] for k in which), levels=tuple(self.levels[i] for i in own),
                       sound=self.sound[rows], blocks=blocks)  # fmt: skip

    @property
    def known(self) -> bool:
        return all(level.known for level in self.levels)

    @property
    def inputs_count(self) -> bool:
        """Whether noise of the inputs is part of the noise."""
        return any(level.moved for level in self.levels)

    @property
    def sized(self) -> bool:
        """Whether the size of the noise is known: by rests, or as noise of the inputs outweighs that of the sensors."""
        return self.known or self.inputs_count

    @property
    def rests_have_colour(self) -> bool:
        """Whether a rest tells a colour of the noise, hence its spectrum too."""
        return any(level.known and not level.is_white for level in self.levels)

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
        white = white if self.counts_all else white * self.sound
        for block in self.sound_blocks:
            white[..., block.at] = block.cover.white(white[..., block.at])
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

        Where the residual is more than noise its own size and correlation in time count (as in `noise_model.level_of`).
        """
        weights = []
        for level, part in zip(self.levels, self.by_record(residual), strict=True):
            # How well the noise itself is known: its mean square scatters by 2/n.
            doubt = 1.0 + 3.0 * np.sqrt(2.0 / (level.n_slow if level.known else len(part)))
            square, weight = float(np.mean(part**2)), 1.0
            if square > MISFIT * doubt:
                weight = 1.0 / square / (1.0 + 2.0 * correlation_sum(part))
            elif not level.known:
                # differences tell the least that the noise can be, and nothing of its colour
                weight = new_share(part) / max(square, 1.0)
            weights.append(np.full(len(part), weight))
        return np.concatenate(weights)


@lru_cache(maxsize=6)  # many models are asked for the same five parts of the records; each takes 100 MB of the link
def blocks_of_rows(blocks: tuple[Block, ...], weights: bytes) -> tuple[Block, ...]:
    """Return blocks where samples have weights, (n_samples,)."""
    rows = np.frombuffer(weights)
    return tuple(b if (rows[b.at] == 1.0).all() else
                 replace(b, cover=Cover.seen(b.cover.columns * rows[b.at][:, np.newaxis])) for b in blocks)  # fmt: skip


def with_answers(
    data: WhitenedData, replays: Sequence[Replay], candidate: Array, noise: Mapping[str, InputNoise]
) -> WhitenedData:  # fmt: skip
    """Return data whose noise holds what noise of the inputs does at a candidate, to first order.

    Starts that the reader saw are part of it as well: fitted as if what a model leaves was white, they would take up
    what such noise does later in a record. replays: of these records. candidate: whole, SI, (n_parameters,).
    """
    levels, places = dict(zip(replays, data.levels, strict=True)), dict(zip(replays, data.edges, strict=False))
    blocks = {int(block.at[0]): block for block in data.blocks}
    for ready, signals in by_record(replays).items():
        pieces = answers(ready, signals, candidate, noise, [levels[r].rms for r in signals])
        for i, piece in enumerate(pieces):
            at = samples_of([places[r] for r in signals], [r.record.lengths for r in signals], i)
            starts = answers_to_start(ready.record.pieces[i])
            moved = [np.hstack(both) for both in zip(piece, starts, strict=True)] if starts else piece
            white = [levels[r].white(columns.T, [len(columns)]).T for r, columns in zip(signals, moved, strict=True)]
            own = [blocks[int(at[0])].cover.columns] if int(at[0]) in blocks else []
            blocks[int(at[0])] = Block(at, Cover.seen(np.hstack([*own, np.vstack(white)])))
        for j, r in enumerate(signals):
            squares = np.concatenate([np.sum(piece[j] ** 2, axis=1) for piece in pieces])
            levels[r] = replace(levels[r], moved=float(np.sqrt(np.mean(squares))))
    return replace(data, levels=tuple(levels[r] for r in replays), blocks=tuple(blocks.values()))


def with_standstills(data: WhitenedData) -> WhitenedData:
    """Return data whose noise knows that what a sensor rounds away at a standstill is the same in all its samples."""
    blocks, first = [], 0
    for record in data.records:
        own = range(first, first + len(record.each))
        lengths = [data.lengths[i] for i in own]
        for piece in range(len(lengths[0])):
            columns = [standstill_columns(data.each[i], data.levels[i], piece) for i in own]
            joint = block_diag(*columns)
            if joint.shape[1]:
                at = samples_of([int(data.edges[i]) for i in own], lengths, piece)
                blocks.append(Block(at, Cover.of(joint)))
        first += len(own)
    return replace(data, blocks=tuple(blocks))


def standstill_columns(record: Record, level: NoiseModel, piece: int) -> Array:
    """Return the rounding error of each long run of equal values of a piece, and of a position the error of its zero.

    Whitened, (n_samples, n_errors).
    """
    n, sensor = record.lengths[piece], record.signals[0].sensor
    first = sum(record.lengths[:piece])
    standstills = runs(record.seen[first : first + n], FEWEST_REST_SAMPLES) if sensor.step else []
    columns = np.zeros((len(standstills), n))
    for column, (a, b) in zip(columns, standstills, strict=True):
        column[a:b] = sensor.rounding
    if record.signals[0].zero_doubt:
        columns = np.vstack([columns, np.full(n, record.signals[0].zero_doubt)])
    # scipy's filter refuses an empty array
    return level.white(columns, [n]).T if len(columns) else columns.T


def whitened(records: Sequence[Record], plant: Plant, trained: WhitenedData | None = None) -> WhitenedData:
    """Return records with their noise; trained: records of the same sensors, which tell of their noise too."""
    each, more = (tuple(one for r in some for one in r.each) for some in (records, trained.records if trained else ()))
    levels = noise_levels(each, plant, more)
    if trained is not None:
        theirs = dict(zip(map(sensor_of, more), trained.levels, strict=True))
        # a rest of these does not show the noise in motion that a model showed on the train records
        levels = tuple(level if level.known and (own is None or own.known) else own or level for level, own in
                       zip(levels, [theirs.get(sensor_of(r)) for r in each], strict=True))  # fmt: skip
    return with_standstills(WhitenedData(tuple(records), levels, soundness_of(each, levels)))


def soundness_of(each: Sequence[Record], levels: Sequence[NoiseModel]) -> Array:
    return np.concatenate([soundness(r, len(level.terms)) * level.weights(r.seen)
                           for r, level in zip(each, levels, strict=True)])  # fmt: skip


def soundness(record: Record, reach: int) -> Array:
    """Return 0 for the samples of a record behind some that are no data, as far as the filter of the noise reaches."""
    sound = []
    for piece in record.pieces:
        n_seen = len(record.signals[0].seen(piece))
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

    def signals(self, Z: Array, shares: Mapping[str, Array] | None = None) -> Array:
        return self.with_known(self.whole_signals(self.whole(Z), shares), Z)

    def with_known(self, signals: Array, Z: Array) -> Array:
        """Return whitened signals of candidates with the rows of known parameters behind them."""
        places, _, deviations = self.rows
        return np.hstack([signals, self.values(Z)[:, places] / deviations]) if len(places) else signals

    def residuals(self, Z: Array, shares: Mapping[str, Array] | None = None) -> Array:
        return np.asarray(self.measured - self.signals(np.atleast_2d(Z), shares))

    def weighted(self, signals: Sequence[Array]) -> Array:
        return self.data.white(signals)

    def whole_signals(self, candidates: Array, shares: Mapping[str, Array] | None = None) -> Array:
        """Return whitened signals of whole candidates, (n_candidates, n_samples); shares: see `ReadyRecord.runs`."""
        return self.data.white(signals_of(self.replays, candidates, shares))

    def beginning(self, share: float) -> "WhiteRecords":
        """Return the problem of a share of each piece of the records, from its first sample on."""
        counts = [np.arange(n) < share * n for lengths in self.data.lengths for n in lengths]
        return replace(self, data=replace(self.data, sound=self.data.sound * np.concatenate(counts)))

    def padded(self, columns: Array) -> Array:
        """Return columns of the samples, (n_samples, n), with zeros in the rows of known parameters."""
        return np.vstack([columns, np.zeros((len(self.rows[0]), columns.shape[1]))])

    @property
    def plain(self) -> "WhiteRecords":
        """The problem of the samples alone."""
        return replace(self, known={}) if self.known else self
