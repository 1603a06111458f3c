"""Noise of measured inputs: how far it moves the simulated signals, and how a fit counts it.

A measured current or torque is not quite what drove the machine. Where a noisy torque is integrated to a speed, what a
right model leaves looks like a random walk. What drove the machine was smoother than what was measured: a fit takes its
best estimate, and the error of that, as the machine answers to it, is part of the noise of each output.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.ndimage import uniform_filter1d

from armid.estimation.noise_model import NoiseModel
from armid.model import Array
from armid.problem.problem import Replay, by_record
from armid.record import Piece, Record
from armid.record.sensor import InputNoise

# Simulations of each record, and the seed of the errors.
DRAWS, SEED = 16, 1
# Second differences that share a size, and steps towards these sizes.
NEIGHBOURS, ROUNDS = 9, 40
# Least variance of a second difference, in that of the noise.
LEAST = 1e-12
# Samples of a piece that tell of its noise; bands of its spectrum, each as wide as its frequency asks for.
FEWEST, BANDS = 100, 100
# Where the search for a spectrum begins: inverse hyperbolic tangents of the memory of noise, and of what it adds.
START = np.array([2.0, 1.0])


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Hold what is known of an input that was measured with noise: it is normal about an estimate.

    values: the estimate [unit of the input], (n,). variance: of the noise. bends: precision of each second difference
    of the input, (n - 2,). factor: Cholesky factor of the precision of the input, banded, (3, n).
    """

    values: Array
    variance: float
    bends: Array
    factor: Array

    @classmethod
    def of(cls, measured: Array, variance: float, bends: Array) -> "Smoothed":
        precision = np.zeros((3, measured.size))
        precision[2] = 1.0 / variance
        for first, weight in enumerate((1.0, -2.0, 1.0)):
            for second in range(first, 3):
                row = precision[2 - (second - first)]
                row[second : second + bends.size] += weight * (1.0, -2.0, 1.0)[second] * bends
        factor = cholesky_banded(precision)
        return cls(cho_solve_banded((factor, False), measured / variance), variance, bends, factor)

    def errors(self, n: int, rng: np.random.Generator) -> Array:
        """Return drawn errors of the estimate, (n_samples, n)."""
        drawn = rng.standard_normal((self.values.size, n)) / np.sqrt(self.variance)
        bent = np.sqrt(self.bends)[:, np.newaxis] * rng.standard_normal((self.bends.size, n))
        for first, weight in enumerate((1.0, -2.0, 1.0)):
            drawn[first : first + self.bends.size] += weight * bent
        return np.asarray(cho_solve_banded((self.factor, False), drawn))

    def followed(self, errors: Array) -> Array:
        """Return how the estimate follows errors of the column, (n_samples,)."""
        return np.asarray(cho_solve_banded((self.factor, False), errors / self.variance))


def smoothed(values: Array, noise: InputNoise) -> Smoothed:
    """Return the estimate of an input that was measured with noise, (n_samples,).

    Its second differences are normal, with a size that neighbours share: it is large at a jump and small at rest. The
    sizes are those under which the column is most probable (expectation and maximisation, by drawn errors).
    """
    rng, variance = np.random.default_rng(SEED), noise.rms**2 + noise.step**2 / 12.0
    bends = np.full(values.size - 2, 1.0 / variance)
    for _ in range(ROUNDS):
        now = Smoothed.of(values, variance, bends)
        squares = np.diff(now.values, 2) ** 2 + np.mean(np.diff(now.errors(DRAWS, rng), 2, axis=0) ** 2, axis=1)
        bends = 1.0 / np.maximum(uniform_filter1d(squares, NEIGHBOURS, mode="nearest"), LEAST * variance)
    return Smoothed.of(values, variance, bends)


def pooled_noise(records: Sequence[Record]) -> dict[str, InputNoise]:
    """Return the noise of each measured input: the median over the records that show it, and their smallest step.

    A motion that passes few values shows multiples of the step.
    """
    seen: dict[str, list[InputNoise]] = {}
    for record in records:
        for name, noise in record.input_noise.items():
            seen.setdefault(name, []).append(noise)
    rms = {name: float(np.median([n.rms for n in noises])) for name, noises in seen.items()}
    steps = {name: min((n.step for n in noises if n.step), default=0.0) for name, noises in seen.items()}
    return {name: InputNoise(rms[name], steps[name]) for name in seen}


def estimated(record: Record, noise: Mapping[str, InputNoise]) -> Record:
    """Return a record with the best estimates of its measured inputs; itself where it holds them."""

    def driven(piece: Piece) -> Piece:
        if piece.smoothed:
            return piece
        found = {name: smoothed(piece.manoeuvre.inputs[name], of) for name, of in noise.items()}
        return with_inputs(replace(piece, smoothed=found), {name: one.values for name, one in found.items()})

    return record.with_pieces(driven)


def with_errors(record: Record, noise: Mapping[str, InputNoise], rng: np.random.Generator) -> Record:
    """Return a record that holds estimates of its inputs with drawn errors of these.

    What a coarse sensor rounds away stays while its value stays: the estimate follows it.
    """

    def driven(piece: Piece) -> Piece:
        drawn = {}
        for name, of in noise.items():
            known, values = piece.smoothed[name], piece.manoeuvre.inputs[name]
            rounded = known.followed(of.rounding(known.values, rng)) if of.step else 0.0
            drawn[name] = values + (known.errors(1, rng)[:, 0] + rounded)[: values.size]
        return with_inputs(piece, drawn)

    return record.with_pieces(driven)


def with_inputs(piece: Piece, inputs: Mapping[str, Array]) -> Piece:
    return replace(piece, manoeuvre=replace(piece.manoeuvre, inputs={**piece.manoeuvre.inputs, **inputs}))


def errors_by_inputs(
    replays: Sequence[Replay], candidate: Array, noise: Mapping[str, InputNoise]
) -> Iterator[tuple[Replay, Array]]:  # fmt: skip
    """Yield what drawn errors of the measured inputs do to each signal, (DRAWS, n_samples).

    candidate: whole, SI, (n_parameters,).
    """
    rng, whole = np.random.default_rng(SEED), candidate[np.newaxis]
    for ready, signals in by_record(replays).items() if noise else ():
        record = estimated(ready.record, noise)
        exact = replace(ready, record=record).runs(whole)
        runs = [replace(ready, record=with_errors(record, noise, rng)).runs(whole) for _ in range(DRAWS)]
        for r in signals:
            yield r, np.concatenate([r.seen(run) for run in runs]) - r.seen(exact)


def moved_by_inputs(replays: Sequence[Replay], candidate: Array) -> dict[str, float]:
    """Return how far noise of the inputs moves each output, from simulations with drawn errors.

    Parameters
    ----------
    replays : sequence of Replay
        Of records whose inputs may be measured with noise.
    candidate : array, (n_parameters,)
        Whole, SI.

    Returns
    -------
    dict
        Output -> rms [its unit]; empty where all inputs are commands.
    """
    squares: dict[str, list[Array]] = {}
    for r, moved in errors_by_inputs(replays, candidate, pooled_noise([ready.record for ready in by_record(replays)])):
        squares.setdefault(r.model.plant.outputs[r.place].name, []).append(np.ravel(moved) ** 2)
    return {name: float(np.sqrt(np.mean(np.concatenate(values)))) for name, values in squares.items()}


def levels_with_inputs(
    levels: Sequence[NoiseModel], replays: Sequence[Replay], candidate: Array, noise: Mapping[str, InputNoise]
) -> tuple[NoiseModel, ...]:  # fmt: skip
    """Return the noise of each signal with what noise of the inputs adds to it at a candidate.

    That of a record in pieces too short to tell stays.
    """
    own, rng = dict(zip(replays, levels, strict=True)), np.random.default_rng(SEED)
    for r, moved in errors_by_inputs(replays, candidate, noise):
        whole = [part + own[r].drawn(part.size, rng) for part in moved]
        parts = [x for part in whole for x in np.split(part, np.cumsum(r.record.lengths)[:-1]) if x.size > FEWEST]
        if parts:
            terms, averages, innovation = averages_of(parts)
            rms = float(np.sqrt(np.mean(moved**2)))
            own[r] = replace(own[r], terms=terms, averages=averages, innovation=innovation, moved=rms)
    return tuple(own[r] for r in replays)


def averages_of(parts: Sequence[Array]) -> tuple[Array, Array, float]:
    """Return the autoregression with averages of noise, and the rms of what each sample adds.

    Its spectrum is the likeliest one for the mean periodogram (Whittle 1953), of the order that the Bayesian criterion
    asks for: a machine that turns freely is of first order, one that swings of second.
    """
    from scipy.optimize import minimize  # slow to load, and commands without noisy inputs do without it

    spectra = [spectrum(x) for x in parts]
    frequency, power = (np.concatenate(each) for each in zip(*spectra, strict=True))
    place = np.searchsorted(np.geomspace(frequency.min(), 0.5, BANDS), frequency)
    n = np.bincount(place)
    frequency, power = (np.bincount(place, each)[n > 0] / n[n > 0] for each in (frequency, power))
    share = n[n > 0] / np.sum(n)

    def rational(partial: Array) -> tuple[Array, Array, Array, float]:
        """Return both polynomials of partial correlations, the shape of the spectrum and its size."""
        both = polynomial(np.tanh(partial[: partial.size // 2])), polynomial(np.tanh(partial[partial.size // 2 :]))
        waves = np.exp(-2j * np.pi * np.outer(frequency, np.arange(len(both[0]))))
        shape = np.abs(waves @ both[1]) ** 2 / np.abs(waves @ both[0]) ** 2
        return *both, shape, float(share @ (power / shape))

    def cost(partial: Array) -> float:
        *_, shape, size = rational(partial)
        return float(np.log(size) + share @ np.log(shape))

    tried, partial, length = list[tuple[float, Array]](), START, float(np.mean([x.size for x in parts]))
    while not tried or tried[-1][0] == min(tried, key=lambda one: one[0])[0]:
        found, order = minimize(cost, partial, method="BFGS"), partial.size // 2
        tried.append((length * found.fun + 2 * order * np.log(length), found.x))
        partial = np.insert(found.x, [order, 2 * order], 0.0)
    past, added, _, size = rational(min(tried, key=lambda one: one[0])[1])
    return -past[1:], added[1:], float(np.sqrt(size))


def spectrum(values: Array) -> tuple[Array, Array]:
    """Return frequencies above 0, in 1/samples, and the tapered periodogram there."""
    taper = np.hanning(values.size + 2)[1:-1]
    power = np.abs(np.fft.rfft(taper * values)) ** 2 / float(taper @ taper)
    return np.asarray(np.fft.rfftfreq(values.size)[1:], dtype=np.float64), np.asarray(power[1:])


def polynomial(partial: Array) -> Array:
    """Return 1 - sum c_k z^k with all roots outside the unit circle, of partial correlations (Durbin and Levinson)."""
    terms = np.empty(0)
    for correlation in partial:
        terms = np.append(terms - correlation * terms[::-1], correlation)
    return np.append(1.0, -terms)
