"""Noise of measured inputs: how far it moves the simulated signals, and how a fit counts it.

A measured current or torque is not quite what drove the machine. Where a noisy torque is integrated to a speed, what a
right model leaves looks like a random walk. What drove the machine was smoother than what was measured: a fit takes its
best estimate, and the error of that, as the machine answers to it, is part of the noise of each output.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.ndimage import uniform_filter1d

from armid.model import Array
from armid.problem.cover import SMALLEST_SEEN
from armid.problem.problem import ReadyRecord, Replay, by_record
from armid.record import Piece, Record
from armid.record.sensor import InputNoise, Mask, length_of_rest

# Drawn errors, and their seed.
DRAWN_ERRORS, DRAWN_ANSWERS, SEED_OF_ERRORS = 16, 8, 1
# So many neighbouring second differences share a size; the sizes are estimated in so many rounds.
SHARING, ROUNDS = 9, 40
# Weights of neighbours in first and second differences.
CHANGE, BEND = (-1.0, 1.0), (1.0, -2.0, 1.0)
# Least variance of a difference, in that of the noise: what is held more tightly a fine sensor would show to be wrong.
STRAIGHTEST = 1e-5
# Cosines that are tried at once, and at most: fast errors move a machine least.
AT_ONCE, MOST_COSINES = 16, 1024
# What rounding may add to a correlation.
ROUNDING_OF_CORRELATION = 1e-9


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Hold what is known of an input that was measured with noise: it is normal about an estimate.

    values: the estimate [unit of the input], (n,). variance: of the noise. differences: weights of neighbours, and the
    precision of each such difference of the input. factor: Cholesky factor of the precision of the input, banded,
    (3, n).
    """

    values: Array
    variance: float
    differences: tuple[tuple[tuple[float, ...], Array], ...]
    factor: Array

    @classmethod
    def of(cls, measured: Array, variance: float, *differences: tuple[tuple[float, ...], Array]) -> "Smoothed":
        precision = np.zeros((3, measured.size))
        precision[2] = 1.0 / variance
        for weights, sizes in differences:
            for first, weight in enumerate(weights):
                for second in range(first, len(weights)):
                    row = precision[2 - (second - first)]
                    row[second : second + sizes.size] += weight * weights[second] * sizes
        factor = cholesky_banded(precision)
        return cls(cho_solve_banded((factor, False), measured / variance), variance, differences, factor)

    def errors(self, n: int, rng: np.random.Generator) -> Array:
        """Return drawn errors of the estimate, (n_samples, n)."""
        drawn = rng.standard_normal((self.values.size, n)) / np.sqrt(self.variance)
        for weights, sizes in self.differences:
            moved = np.sqrt(sizes)[:, np.newaxis] * rng.standard_normal((sizes.size, n))
            for first, weight in enumerate(weights):
                drawn[first : first + sizes.size] += weight * moved
        return self.solved(drawn)

    def covariance(self, waves: Array, step: float) -> Array:
        """Return the covariance of the error's parts along orthonormal waves, (n_samples, n).

        step: of the sensor. What it rounds away stays while its value stays, and the estimate follows.
        """
        known = self.solved(waves)
        if not step:
            return waves.T @ known
        begins = np.flatnonzero(np.diff(np.rint(self.values / step), prepend=np.nan) != 0.0)
        rounded = np.add.reduceat(known, begins) / self.variance
        return waves.T @ known + step**2 / 12.0 * rounded.T @ rounded

    def solved(self, columns: Array) -> Array:
        return np.asarray(cho_solve_banded((self.factor, False), columns))


def smoothed(values: Array, noise: InputNoise, still: Mask) -> Smoothed:
    """Return the estimate of an input that was measured with noise, (n_samples,).

    Its second differences are normal, with a size that neighbours share: it is large at a jump and small at rest. The
    sizes are those under which the column is most probable (expectation and maximisation, by drawn errors).
    still: where it is constant, (n_samples,).
    """
    return smoothed_bytes(values.tobytes(), noise, still.tobytes())


@lru_cache(maxsize=64)  # whole and cut pieces, and many models, ask for the same columns
def smoothed_bytes(column: bytes, noise: InputNoise, still: bytes) -> Smoothed:
    values, variance = np.frombuffer(column), noise.rms**2 + noise.step**2 / 12.0
    stays = np.frombuffer(still, dtype=np.bool_)
    steps = CHANGE, (stays[1:] & stays[:-1]) / (STRAIGHTEST * variance)
    rng, bends = np.random.default_rng(SEED_OF_ERRORS), np.full(values.size - 2, 1.0 / variance)
    for _ in range(ROUNDS):
        now = Smoothed.of(values, variance, (BEND, bends), steps)
        squares = np.diff(now.values, 2) ** 2 + np.mean(np.diff(now.errors(DRAWN_ERRORS, rng), 2, axis=0) ** 2, axis=1)
        bends = 1.0 / np.maximum(uniform_filter1d(squares, SHARING, mode="nearest"), STRAIGHTEST * variance)
    return Smoothed.of(values, variance, (BEND, bends), steps)


def at_rest(record: Record, piece: Piece, values: Array) -> Mask:
    """Return where an input and the machine stand still, at the begin and the end of a piece, (n_samples,).

    There the input is constant: a machine that noise of the drive moved would not stand still.
    """
    outputs = [(piece.of(s.measured), s.is_speed) for s in record.signals]
    still = np.zeros(values.size, dtype=np.bool_)
    for way in (slice(None), slice(None, None, -1)):
        still[way][: length_of_rest([values[way]], [(y[way], is_speed) for y, is_speed in outputs])] = True
    return still


def pooled_noise(records: Sequence[Record]) -> dict[str, InputNoise]:
    """Return the noise of each measured input: the median over the records that show it, and their smallest step.

    Where more than half show none it has none. A motion that passes few values shows multiples of the step.
    """
    seen: dict[str, list[InputNoise]] = {}
    for record in records:
        for name, noise in record.input_noise.items():
            seen.setdefault(name, []).append(noise)
    pooled = {}
    for name, noises in seen.items():
        known = [n.rms for n in noises if n.rms > 0.0]
        rms = float(np.median(known)) if 2 * len(known) >= len(noises) else 0.0
        pooled[name] = InputNoise(rms, min((n.step for n in noises if n.step), default=0.0))
    return pooled


def estimated(record: Record, noise: Mapping[str, InputNoise]) -> Record:
    """Return a record with the best estimates of its measured inputs; itself where it holds them."""

    def with_estimates(piece: Piece) -> Piece:
        if piece.smoothed:
            return piece
        inputs = {name: piece.manoeuvre.inputs[name] for name in noise}
        found = {name: smoothed(u, noise[name], at_rest(record, piece, u)) for name, u in inputs.items()}
        # a fit of the start would take up what such noise does
        still = piece.correction and replace(piece.correction, gain=0.0 * piece.correction.gain)
        driven = replace(piece, smoothed=found, correction=still)
        return driven.with_inputs({name: one.values for name, one in found.items()})

    return record.with_pieces(with_estimates)


def answers(
    ready: ReadyRecord, signals: Sequence[Replay], candidate: Array, noise: Mapping[str, InputNoise],
    sizes: Sequence[float],
) -> list[list[Array]]:  # fmt: skip
    """Return how signals of a record answer to the errors of its inputs: of each piece an array for each signal.

    Its columns, (n_samples, n), are the answers to independent errors of one standard deviation. candidate: whole, SI.
    noise: of the inputs. sizes: noise of each signal's sensor, rms [its unit].
    """
    ready = replace(ready, record=estimated(ready.record, noise))
    found: list[list[list[Array]]] = [[[] for _ in signals] for _ in ready.record.pieces]
    for name, of in noise.items():
        by_signal = answers_to_cosines(ready, signals, candidate, name, of, sizes)
        for i, piece in enumerate(ready.record.pieces):
            root = root_of_correlation(piece.smoothed[name], len(by_signal[0]), of.step)
            for j, (r, changes) in enumerate(zip(signals, by_signal, strict=True)):
                first = sum(r.record.lengths[:i])
                found[i][j].append(changes[:, first : first + r.record.lengths[i]].T @ root)
    return [[np.hstack(each) for each in piece] for piece in found]


def answers_to_cosines(
    ready: ReadyRecord, signals: Sequence[Replay], candidate: Array, name: str, noise: InputNoise,
    sizes: Sequence[float],
) -> list[Array]:  # fmt: skip
    """Return how each signal answers to cosines of one input, (n, n_samples), each of one standard deviation.

    From the slowest on until the sensors do not see the answers: each costs a simulation, of all pieces at once. Other
    arguments as for `answers`.
    """
    known = [piece.smoothed[name] for piece in ready.record.pieces]
    exact = signals_seen(ready, signals, candidate)
    most, columns = min(MOST_COSINES, *(one.values.size for one in known)), [list[Array]() for _ in signals]
    for first in range(0, most, AT_ONCE):
        numbers = np.arange(first, min(first + AT_ONCE, most))
        waves = [cosines(one.values.size, numbers) for one in known]
        scaled = [w * np.sqrt(np.diag(one.covariance(w, noise.step))) for w, one in zip(waves, known, strict=True)]
        seen = 0.0
        for k in range(len(numbers)):
            record = with_changes(ready.record, name, [w[:, k] for w in scaled])
            changes = changes_seen(ready, signals, candidate, record, exact)
            for column, change, size in zip(columns, changes, sizes, strict=True):
                column.append(change)
                seen = max(seen, float(np.sum(column[-1] ** 2)) / size**2)
        if seen < SMALLEST_SEEN:
            break
    return [np.array(column) for column in columns]


def moved_by_draws(
    ready: ReadyRecord, signals: Sequence[Replay], candidate: Array, noise: Mapping[str, InputNoise]
) -> list[float]:  # fmt: skip
    """Return how far drawn errors of the inputs move each signal of a record, of few the farthest, rms [its unit]."""
    ready, rng = replace(ready, record=estimated(ready.record, noise)), np.random.default_rng(SEED_OF_ERRORS)
    squares, exact = np.zeros((DRAWN_ANSWERS, len(signals))), signals_seen(ready, signals, candidate)
    drawn = {name: [piece.smoothed[name].errors(DRAWN_ANSWERS, rng) for piece in ready.record.pieces] for name in noise}
    for k in range(DRAWN_ANSWERS):
        record = ready.record
        for name, errors in drawn.items():
            record = with_changes(record, name, [each[:, k] for each in errors])
        squares[k] = [np.mean(x**2) for x in changes_seen(ready, signals, candidate, record, exact)]
    return [float(x) for x in np.sqrt(squares.max(axis=0))]


def signals_seen(ready: ReadyRecord, signals: Sequence[Replay], candidate: Array) -> list[Array]:
    runs = ready.runs(candidate[np.newaxis])
    return [r.seen(runs)[0] for r in signals]


def changes_seen(
    ready: ReadyRecord, signals: Sequence[Replay], candidate: Array, record: Record, exact: Sequence[Array]
) -> list[Array]:  # fmt: skip
    """Return how signals change with other inputs; exact: the signals with those of `ready`."""
    pairs = zip(signals_seen(replace(ready, record=record), signals, candidate), exact, strict=True)
    # a simulation that diverges adds no noise
    return [np.nan_to_num(changed - y, posinf=0.0, neginf=0.0) for changed, y in pairs]


def root_of_correlation(known: Smoothed, n: int, step: float) -> Array:
    """Return the Cholesky factor of the correlation of the error's first n cosines, (n, n); step: of the sensor."""
    covariance = known.covariance(cosines(known.values.size, np.arange(n)), step)
    deviations = np.sqrt(np.diag(covariance))
    # the cosines of a straight input are collinear
    return np.linalg.cholesky(covariance / np.outer(deviations, deviations) + ROUNDING_OF_CORRELATION * np.eye(n))


def cosines(n_samples: int, numbers: NDArray[np.int64]) -> Array:
    """Return orthonormal cosines over some samples, (n_samples, n): number 0 is a constant."""
    waves = np.cos(np.pi * np.outer(np.arange(n_samples) + 0.5, numbers) / n_samples)
    return np.asarray(waves * np.where(numbers == 0, 1.0, np.sqrt(2.0)) / np.sqrt(n_samples))


def with_changes(record: Record, name: str, changes: Sequence[Array]) -> Record:
    """Return a record with changes of an input, of each piece one that is as long or longer."""
    pairs = zip(record.pieces, changes, strict=True)
    pieces = ((piece, piece.manoeuvre.inputs[name], change) for piece, change in pairs)
    return replace(record, pieces=tuple(p.with_inputs({name: u + change[: u.size]}) for p, u, change in pieces))


def moved_by_inputs(
    replays: Sequence[Replay], candidate: Array, noise: Mapping[str, InputNoise] | None = None
) -> dict[str, float]:  # fmt: skip
    """Return how far noise of the inputs moves each output, to first order.

    Parameters
    ----------
    replays : sequence of Replay
        Of records whose inputs may be measured with noise.
    candidate : array, (n_parameters,)
        Whole, SI.
    noise : mapping of input to InputNoise, optional
        None: as these records show it.

    Returns
    -------
    dict
        Output -> rms [its unit]; empty where all inputs are commands.
    """
    noise = pooled_noise([ready.record for ready in by_record(replays)]) if noise is None else noise
    squares = dict[str, list[Array]]()
    for ready, signals in by_record(replays).items() if noise else ():
        sizes = [r.record.noise.rms for r in signals]
        for piece in answers(ready, signals, candidate, noise, sizes):
            for r, columns in zip(signals, piece, strict=True):
                squares.setdefault(r.model.plant.outputs[r.place].name, []).append(np.sum(columns**2, axis=1))
    return {name: float(np.sqrt(np.mean(np.concatenate(values)))) for name, values in squares.items()}
