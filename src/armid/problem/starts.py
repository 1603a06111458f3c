"""Starts of records in motion, fitted with the parameters: nuisances of each piece that cost a search no dimension.

What the reader saw of a start is what the outputs showed. A sensor that a model holds to be off shows another state.

Near one start the signals are almost linear in its constants. The best start of each candidate is then a projection
(`StartCorrection`), and a fit sees only what no start explains. `with_starts` finds the start of one candidate about
which this holds.
Source of the projection: Golub, Pereyra 1973, doi:10.1137/0710036.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from armid.engine import probes
from armid.model import Array
from armid.problem.cover import Cover
from armid.problem.problem import ReadyRecord, Replay, by_record, with_each
from armid.problem.space import Space
from armid.record import Piece
from armid.record.record import Samples, StartCorrection
from armid.record.sensor import correlation_sum
from armid.record.start import VisibleOutputs

# Step of the differences, as a share of the plant's speed scale; a speed held for a second is the size of a position.
MOVE = 1e-4
# So many steps to the start at most; a step ends them that lowers chi2 by less than this. Steps that do not are halved.
MOST_OF_START, ARRIVED_START, MOST_HALVINGS = 10, 1e-3, 6
N_PROBES_OF_STARTS = 48
# What the reader saw of a start holds it with so many times its deviation: the fit sees the same samples again.
WIDER_START = 3.0
# The noise counts as at least this share of the size of an output, where a simulation has none.
LEAST_NOISE = 1e-6


def with_starts(replays: Sequence[Replay], candidate: Array) -> tuple[Replay, ...]:
    """Return replays whose pieces start where one whole candidate fits best, ready to correct others about there.

    Pieces whose start was measured and is not to be fitted (where noise of the inputs counts) start where the
    candidate's outputs show what the reader saw; those of a record that is held out from what its first samples tell,
    which judge nothing. Gauss-Newton steps from the piece's own start minimise

    J(s) = |x - y(s)|^2 / (max(1, m) c) + |(s - s_reader) / 3 deviations|^2

    in units of the noise. m is the mean square that no start brings down, c = 1 + 2 sum rho its correlation in time: a
    start that the first samples rule out must not hide what the model lacks.
    """

    def started(ready: ReadyRecord) -> ReadyRecord:
        starts = [Start(ready, k) for k in range(len(ready.record.pieces))]
        return replace(
            ready, record=replace(ready.record, pieces=tuple(one.placed(ready.own(candidate)) for one in starts))
        )

    return with_each(replays, started)


def with_shown_starts(ready: ReadyRecord) -> ReadyRecord:
    """Return a record whose fitted starts follow its present samples, after these were changed."""

    def shown(piece: Piece) -> Piece:
        if piece.correction is None:
            return piece
        return replace(piece, correction=replace(piece.correction, measured=ready.record.seen_by_all(piece)))

    return replace(ready, record=ready.record.with_pieces(shown))


def answers_to_start(piece: Piece) -> list[Array]:
    """Return how the seen signals of a piece answer to its start, where that is fitted.

    Each signal has a column for each start constant, (n_seen, n_constants), moved as far as the fit may move it.
    """
    answer = piece.correction
    if answer is None:
        return []
    pairs = zip(answer.slopes.swapaxes(0, 1), answer.samples, strict=True)
    return [(reach_of_start(piece) * slopes.T)[samples] for slopes, samples in pairs]


def reach_of_start(piece: Piece) -> Array:
    """Return how far a fit may move each start constant from what the reader saw, SI, (n_constants,)."""
    return WIDER_START * np.array([piece.start_deviation[name] for name in piece.shown_start])


def likely_candidate(replays: Sequence[Replay], space: Space) -> Array:
    """Return the whole candidate of 48 over the box that comes nearest to the records, each from its best start."""
    spread = space.complete(probes(space.low[space.free], space.high[space.free], N_PROBES_OF_STARTS))
    chi2 = np.zeros(len(spread))
    for ready in by_record(replays):
        for k in range(len(ready.record.pieces)):
            start = Start(ready, k)
            signals, answers = start.linear(start.constants, spread)
            residual, slopes = start.residual(signals), start.seen_slopes(answers)
            for i in np.flatnonzero(np.isfinite(chi2)):
                chi2[i] += float(np.sum(start.beyond(residual[i], slopes[:, i]) ** 2))
    return np.asarray(spread[int(np.argmin(chi2))])


def fits_starts(replays: Sequence[Replay]) -> bool:
    return any(piece.shown_start for r in replays for piece in r.pieces)


@dataclass(frozen=True, eq=False)
class Start:
    """Fit the start of one piece of a record, to all its signals; index: which piece.

    off: by how much the reader saw other start constants than the candidate's outputs would show, SI, (n_constants,).
    """

    ready: ReadyRecord
    index: int
    off: Array | float = 0.0

    @property
    def piece(self) -> Piece:
        return self.ready.record.pieces[self.index]

    @property
    def names(self) -> list[str]:
        return list(self.piece.start_deviation)

    @property
    def constants(self) -> Array:
        given = self.piece.manoeuvre.constants
        return np.array([given[name] for name in self.names])

    @cached_property
    def places(self) -> tuple[int, ...]:
        return tuple(r.place for r in self.ready.each)

    @cached_property
    def samples(self) -> tuple[Samples, ...]:
        return tuple(signal.samples(self.piece) for signal in self.ready.record.signals)

    @cached_property
    def weights(self) -> Array:
        """1/noise of each sample that is seen, 0 of what is guessed, the outputs one behind the other, (n_seen,)."""
        sizes, signals = self.ready.model.plant.sizes, self.ready.record.signals
        noise = [max(s.noise.rms, LEAST_NOISE * sizes[i]) for s, i in zip(signals, self.places, strict=True)]
        return np.concatenate([s.told(self.piece) / size for s, size in zip(signals, noise, strict=True)])

    @cached_property
    def measured(self) -> Array:
        return self.ready.record.seen_by_all(self.piece)

    def signals(self, starts: Array, population: Array) -> Array:
        """Return the outputs of the file, each candidate from its own start, (n_outputs, n_candidates, n_samples)."""
        prepared = self.ready.prepared[self.index]
        constants, order = np.tile(prepared.constants, (len(starts), 1)), list(self.ready.model.constants)
        constants[:, [order.index(name) for name in self.names]] = starts
        outputs = prepared.run(population, self.ready.threads, constants).outputs
        return np.asarray(outputs[list(self.places)])

    @cached_property
    def zeros(self) -> Cover | None:
        """What the zeros of counting sensors do, as far as they are in doubt; None where no sensor counts."""
        signals = self.ready.record.signals
        if not any(s.zero_doubt for s in signals):
            return None
        weights = np.split(self.weights, np.cumsum([len(s.seen(self.piece)) for s in signals[:-1]]))
        return Cover.of(block_diag(*(s.zero_doubt * w[:, np.newaxis] for s, w in zip(signals, weights, strict=True))))

    def white(self, seen: Array) -> Array:
        """Return what is seen over the noise, (..., n_seen), over that and the doubt of the zeros together."""
        return seen if self.zeros is None else self.zeros.white(seen)

    def seen(self, signals: Array) -> Array:
        """Return what is seen in the windows over the noise, the outputs one behind the other, (n_candidates, n)."""
        pairs = zip(signals, self.samples, strict=True)
        return self.white(self.weights * np.concatenate([signal[:, samples] for signal, samples in pairs], axis=1))

    def residual(self, signals: Array) -> Array:
        return np.asarray(self.white(self.weights * self.measured) - self.seen(signals))

    def linear(self, constants: Array, population: Array) -> tuple[Array, Array]:
        """Return signals and d signal / d constant about one start, all in one population, by central differences."""
        n, step = len(constants), MOVE * self.ready.model.plant.scales.speed
        starts = constants + step * np.concatenate([np.zeros((1, n)), np.eye(n), -np.eye(n)])
        signals = self.signals(np.repeat(starts, len(population), axis=0), np.tile(population, (len(starts), 1)))
        by_start = signals.reshape(len(signals), len(starts), len(population), -1).swapaxes(0, 1)
        return by_start[0], (by_start[1 : 1 + n] - by_start[1 + n :]) / (2.0 * step)

    @cached_property
    def shown(self) -> tuple[Array, Array]:
        """The start that the reader saw, and how far from it the fit may go, SI, both (n_constants,)."""
        return np.array(list(self.piece.shown_start.values())) - self.off, reach_of_start(self.piece)

    def beyond(self, residual: Array, slopes: Array) -> Array:
        """Return what no start can do of a residual, (n_seen,), infinite where the simulation diverges."""
        if not (np.isfinite(residual).all() and np.isfinite(slopes).all()):
            return np.full(len(residual), np.inf)
        scale = np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-300)
        return np.asarray(residual - np.linalg.lstsq((slopes / scale).T, residual)[0] @ (slopes / scale))

    def misfit(self, residual: Array, slopes: Array) -> float:
        """Return by what squares are divided: their mean that no start brings down, at least 1, by how long it lasts.

        What a model lacks is alike in neighbours: these are one witness against the reader's start, and not many.
        """
        rest = self.beyond(residual, slopes)
        square = float(np.sum(rest**2)) / max(rest.size, 1)
        return max(square, 1.0) * (1.0 + 2.0 * correlation_sum(rest))

    def answer(self, constants: Array, slopes: Array, misfit: float) -> tuple[Array, Array]:
        """Return gain and offset of a step, (n_constants, n_seen) and (n_constants,); misfit: that is left."""
        pull = self.pull(misfit) * (self.shown[0] - constants)
        both = np.linalg.solve(self.normal(slopes, misfit), np.column_stack([slopes, pull]))
        return np.asarray(both[:, :-1]), np.asarray(both[:, -1])

    def pull(self, misfit: float) -> Array:
        """Return how strongly the start that the reader saw holds each constant, times the misfit, (n_constants,)."""
        return np.asarray(misfit / self.shown[1] ** 2)

    def normal(self, slopes: Array, misfit: float) -> Array:
        """Return the matrix of the normal equations, times the misfit, (n_constants, n_constants)."""
        return np.asarray(slopes @ slopes.T + np.diag(self.pull(misfit)))

    def placed(self, candidate: Array) -> Piece:
        """Return the piece from the start that belongs to a candidate, see `with_starts`."""
        if not self.piece.shown_start:
            return self.from_spent(candidate) if self.piece.n_spent and self.names else self.read(candidate)
        return self.held(candidate) if self.piece.smoothed else self.fitted(candidate)

    def from_spent(self, candidate: Array) -> Piece:
        """Return a piece that is held out from the start at which a candidate meets the samples that judge nothing.

        A curve through them knows nothing of how the machine moves. The doubt is that of the same fit.
        """
        read = self.read(candidate)
        shown = {name: read.manoeuvre.constants[name] for name in self.names}
        first = replace(read, window=slice(0, read.n_spent), shown_start=shown).until_window_end()
        found = self.alone(self.alone(first).fitted(candidate))
        signals, slopes = found.linear(found.constants, candidate[np.newaxis])
        residual, seen = found.residual(signals)[0], found.seen_slopes(slopes)[:, 0]
        if not (np.isfinite(residual).all() and np.isfinite(seen).all()):
            return read
        misfit = found.misfit(residual, seen)
        doubt = np.sqrt(misfit * np.diag(np.linalg.inv(found.normal(seen, misfit))))
        fitted = read.with_constants(dict(zip(self.names, map(float, found.constants), strict=True)))
        return replace(fitted, start_deviation=dict(zip(self.names, map(float, doubt), strict=True)))

    def alone(self, piece: Piece) -> "Start":
        """Return the start of one piece, as if the record had no other."""
        record, calibrations = replace(self.ready.record, pieces=(piece,)), (self.ready.calibrations[self.index],)
        return Start(replace(self.ready, record=record, calibrations=calibrations), 0)

    def held(self, candidate: Array) -> Piece:
        """Return the piece from where the candidate's outputs show what the reader saw, as it is where it diverges.

        Where noise of the inputs counts, the doubt about the start is part of it (`whitening.with_answers`).
        """
        population = candidate[np.newaxis]
        (first,) = self.signals(self.constants[np.newaxis], population)[:, :, 0].T
        constants = replace(self, off=self.off_by(first)).shown[0]
        signals, slopes = self.linear(constants, population)
        if not np.isfinite(slopes).all():
            return self.piece
        still = np.zeros((len(constants), self.weights.size)), np.zeros(len(constants))
        return self.corrected(constants, signals, slopes, *still, self.by_outputs)

    def fitted(self, candidate: Array) -> Piece:
        """Return the piece from the best start of a candidate, as it is where the candidate diverges."""
        constants, population = self.constants, candidate[np.newaxis]
        signals, slopes = self.linear(constants, population)
        start = replace(self, off=self.off_by(signals[:, 0, 0]))
        for _ in range(MOST_OF_START):
            residual, seen = start.residual(signals)[0], start.seen_slopes(slopes)[:, 0]
            if not (np.isfinite(residual).all() and np.isfinite(seen).all()):
                return self.piece
            misfit = start.misfit(residual, seen)
            gain, offset = start.answer(constants, seen, misfit)
            shorter = constants + (gain @ residual + offset) / 2.0 ** np.arange(MOST_HALVINGS)[:, np.newaxis]
            tried = start.residual(start.signals(shorter, np.repeat(population, MOST_HALVINGS, axis=0)))
            before, costs = start.cost(constants, residual, misfit), start.cost(shorter, tried, misfit)
            better = np.flatnonzero(costs < before)
            if not len(better):
                break
            constants = shorter[better[0]]
            signals, slopes = start.linear(constants, population)
            if before - costs[better[0]] < ARRIVED_START:
                break
        if not np.isfinite(slopes).all():
            return self.piece
        seen = start.seen_slopes(slopes)[:, 0]
        by_reader = np.linalg.solve(start.normal(seen, misfit), np.diag(start.pull(misfit)))
        answer = start.answer(constants, seen, misfit)
        return self.corrected(constants, signals, slopes, *answer, np.asarray(by_reader @ self.by_outputs))

    def corrected(
        self, constants: Array, signals: Array, slopes: Array, gain: Array, offset: Array, by_first: Array
    ) -> Piece:  # fmt: skip
        """Return the piece from one start, with how far others move it from there; gain: of samples over the noise."""
        gain, first = self.white(gain) * self.weights, signals[:, 0, 0]
        correction = StartCorrection(
            self.places, slopes[:, :, 0], gain, offset, by_first, first, self.measured, self.samples
        )
        known = dict(zip(self.names, map(float, constants), strict=True))
        return replace(self.piece.with_constants(known), correction=correction)

    def read(self, candidate: Array) -> Piece:
        """Return the piece from where the outputs of a candidate are as the reader saw them."""
        if not self.names:
            return self.piece
        (first,) = self.signals(self.constants[np.newaxis], candidate[np.newaxis])[:, :, 0].T
        start = dict(zip(self.names, map(float, self.constants - self.off_by(first)), strict=True))
        return self.piece.with_constants(start)

    def off_by(self, first: Array) -> Array:
        """Return by how much start constants are off; first: outputs of a model that starts from them, (n_outputs,).

        The plant's own outputs are functions of its states: what a model shows besides is what its sensors are off by.
        """
        start = dict(zip(self.names, map(float, self.constants), strict=True))
        own = self.visible.at(start)
        off = np.array([y - own.get(name, y) for name, y in zip(self.outputs, first, strict=True)])
        return self.by_outputs @ off if off.any() and np.isfinite(off).all() else np.zeros(len(self.names))

    @cached_property
    def by_outputs(self) -> Array:
        """How the start that the reader saw follows a change of each output, (n_constants, n_outputs)."""
        start = dict(zip(self.names, map(float, self.constants), strict=True))
        own = [name for name in self.outputs if name in self.visible.at(start)]
        by_outputs = np.zeros((len(self.names), len(self.outputs)))
        by_outputs[:, [self.outputs.index(name) for name in own]] = self.visible.by_outputs(start, own)
        return by_outputs

    @property
    def outputs(self) -> list[str]:
        return [self.ready.model.plant.outputs[place].name for place in self.places]

    @cached_property
    def visible(self) -> VisibleOutputs:
        return VisibleOutputs(self.ready.model.plant, self.piece.manoeuvre.constants)

    def seen_slopes(self, slopes: Array) -> Array:
        shape = (len(slopes), slopes.shape[2], len(self.weights))
        return np.array([self.seen(slope) for slope in slopes]).reshape(shape)

    def cost(self, constants: Array, residual: Array, misfit: float) -> Any:
        shown, width = self.shown
        return np.sum(residual**2, axis=-1) / misfit + np.sum(((constants - shown) / width) ** 2, axis=-1)
