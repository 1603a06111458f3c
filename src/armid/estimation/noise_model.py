"""The noise of a record as fits take it: `NoiseModel` in the loop, `Level` outside it.

Coloured noise (a 40 Hz gyro sampled at 1 kHz) holds far fewer independent samples than samples. A `NoiseModel` is an
autoregression of the sensor's signal at rest, pooled over the records. A `Level` counts independent samples.
What a single column tells of its noise when it is read stands in record/sensor.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil
from typing import TypeVar

import numpy as np
from scipy.linalg import cholesky, cholesky_banded, solve_banded, solve_triangular, toeplitz
from scipy.special import fdtrc

from armid.engine import FINE, hiding_noise
from armid.errors import ArmidError
from armid.model import Array, Plant
from armid.problem.problem import Replay
from armid.problem.space import Space
from armid.record import Noise, Record
from armid.record.sensor import FEWEST_REST_SAMPLES, changing, correlation_sum, difference_rms, memory_of, new_share

T = TypeVar("T")
# Output, sampling interval [s] and step [unit of the output].
SensorKey = tuple[str, float, str]
MOST_TERMS, FEWEST_FOR_COLOUR, MOST_LAGS_OF_NOISE = 8, 50, 500
# A mean square of the residual above this many times that of the noise is not noise; below this many errors of the
# engine it is the engine's.
MISFIT, ENGINE_ERRORS = 2.0, 3.0
# Chance below which a residual is not noise; independent samples in the blocks whose means are looked at.
CHANCE_OF_COLOUR, BLOCKS = 1e-3, (8, 32)
# Least share of an error that comes back in the next sample, with the other sign, where noise alternates. That of
# differences of counts is 1, less where the sensor has other noise too. White noise shows a small share by chance.
LEAST_ALTERNATION = 0.5
# Noise that is assumed of a record without noise, as a share of its rms.
ASSUMED = 1e-3
IS_ASSUMED = f"assumed, {ASSUMED:.1%} of the motion, as the records hold none"


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Hold the noise of the records of one sensor.

    rms: [unit of the records]. terms: autoregression e_t = w_t - sum a_k w_(t-k), (n_terms,), empty for white noise.
    innovation: rms of e_t. head: turns the first n_terms samples white, (n_terms, n_terms). moved: rms by which noise
    of the inputs moves the signal, 0 where it does not count [unit of the records].
    n_samples: samples at rest from which it is known, 0 where none were recorded: then `rms` comes from differences of
    the motion, and is a lower bound rather than a measurement. n_slow, n_power: of these, how many count as independent
    for slow signals, n/(1 + 2 sum rho), and for a mean square, n/(1 + 2 sum rho^2). assumed: the records hold none.
    """

    rms: float
    terms: Array
    innovation: float
    head: Array
    n_samples: int
    n_slow: float
    n_power: float
    moved: float = 0.0
    growth: float = 0.0
    still: float = 0.0
    alternation: float = 0.0
    assumed: bool = False

    @property
    def is_white(self) -> bool:
        return not (len(self.terms) or self.alternation)

    @property
    def known(self) -> bool:
        return self.n_samples > 0

    @property
    def in_motion(self) -> str:
        """What the noise does in motion and at no rest, in words."""
        if self.alternation:
            return "it alternates from sample to sample, as that of differences of counts does"
        return f"in motion it grows with the reading, by {self.growth:.2%} of it" if self.growth else ""

    @property
    def remark(self) -> str:
        """What is special about the noise, in words."""
        return IS_ASSUMED if self.assumed else self.in_motion

    @property
    def hides(self) -> float:
        """Rms of the white noise that hides a slow error as well as this noise does: small where it alternates."""
        return self.innovation * (1.0 - self.alternation)

    @property
    def total(self) -> float:
        """Rms of what a right model leaves."""
        return float(np.hypot(self.rms, self.moved))

    def weights(self, readings: Array) -> Array:
        """Return `rms` over the noise of each reading, (n_samples,): sigma^2 = still^2 + (growth x reading)^2."""
        if not self.growth:
            return np.ones_like(readings)
        return np.asarray(self.rms / np.hypot(self.still, self.growth * readings))

    def white(self, values: Array, lengths: Sequence[int]) -> Array:
        """Return signals so filtered that the noise in them is white with a standard deviation of 1.

        The first samples of each piece go through the inverse Cholesky factor of their covariance.
        values: [unit of the records], shape (..., n_samples), pieces end to end; lengths: of the pieces.
        """
        if self.is_white:
            return np.asarray(values / self.innovation)
        # a command that fits nothing never comes here, and scipy.signal is slow to load
        from scipy.signal import lfilter

        n, pieces = len(self.terms), []
        for start, end in pairwise(np.cumsum([0, *lengths])):
            piece = values[..., start:end]
            if self.alternation:
                pieces.append(without_alternation(piece, self.alternation) / self.innovation)
                continue
            filtered = lfilter(np.concatenate([[1.0], -self.terms]), [1.0], piece, axis=-1) / self.innovation
            filtered[..., :n] = piece[..., :n] @ self.head.T
            pieces.append(filtered)
        return np.concatenate(pieces, axis=-1)


def without_alternation(values: Array, alternation: float) -> Array:
    """Return values without the correlation of their noise, which is w_t - alternation w_(t-1) at sample t.

    By the Cholesky factor of its covariance. values: (..., n_samples).
    """
    n = values.shape[-1]
    covariance = np.array([[1.0 + alternation**2], [-alternation]]) * np.ones(n)
    factor = cholesky_banded(covariance, lower=True)
    return np.asarray(solve_banded((1, 0), factor, values.reshape(-1, n).T, check_finite=False).T.reshape(values.shape))


def noise_levels(records: Sequence[Record], plant: Plant, others: Sequence[Record] = ()) -> tuple[NoiseModel, ...]:
    """Return the noise of each record: pooled over the rests of all records of one sensor, see `sensor_of`.

    plant: the sizes of its outputs give the floor below which the engine's error would count as a discrepancy. others:
    records of the same sensors whose rests count too.
    """
    pooled = {
        sensor: pooled_level([r for r in (*records, *others) if sensor_of(r) == sensor],
                             hiding_noise(plant, sensor[0], FINE))
        for sensor in set(map(sensor_of, records))
    }  # fmt: skip
    return tuple(pooled[sensor_of(r)] for r in records)


def sensor_of(record: Record) -> SensorKey:
    """Return output, sampling interval and step of a record: its noise is that of all records with the same.

    A step below the noise counts as 0. Larger ones are compared to three digits, as two records may not show more.
    """
    step = record.signals[0].sensor.step
    return record.output, record.manoeuvre.interval, f"{step if step > record.noise.rms else 0.0:.3g}"


def by_sensor(records: Sequence[Record], values: Sequence[T]) -> dict[SensorKey, list[T]]:
    """Return the values of the records of each sensor."""
    groups: dict[SensorKey, list[T]] = {}
    for record, value in zip(records, values, strict=True):
        groups.setdefault(sensor_of(record), []).append(value)
    return groups


def levels_left(
    levels: Sequence[NoiseModel], replays: Sequence[Replay], left: Sequence[Array]
) -> tuple[NoiseModel, ...]:  # fmt: skip
    """Return the noise of each record where no rest tells it: that in what a model leaves, where this is less.

    Of a fast motion with few samples the differences hold the motion too; what a model leaves holds less of it. Where
    that is noise alone, it shows how long the noise of a filtered sensor remembers, too; sharp errors of a model would
    look like memory. left: of each record, its unit, not whitened.
    """
    moving = [changing(r.measured) for r in replays]
    parts = [x[moved] if moved.sum() >= FEWEST_REST_SAMPLES else x for x, moved in zip(left, moving, strict=True)]
    records = [r.record for r in replays]
    steps = by_sensor(records, [r.signals[0].sensor.rounding for r in records])
    shown = {sensor: memory_and_sizes(several) for sensor, several in by_sensor(records, parts).items()}
    noises = []
    for replay, level in zip(replays, levels, strict=True):
        sensor = sensor_of(replay.record)
        memory, sizes = shown[sensor]
        rms = max(float(np.median(np.maximum(sizes, steps[sensor]))), hiding_noise(replay.model.plant, sensor[0], FINE))
        stays = level.known or level.assumed or (level.rms <= rms and not memory)
        noises.append(level if stays else remembering_level(rms, memory))
    return tuple(noises)


def levels_in_motion(
    levels: Sequence[NoiseModel], replays: Sequence[Replay], left: Sequence[Array]
) -> tuple[NoiseModel, ...]:  # fmt: skip
    """Return the noise of each record as a model that may be right shows it.

    A rest does not show noise that grows with the reading; where records have no rest, differences of the motion have
    shown its size. A rest does not show the noise of a speed from differences of counts either, which alternates.
    Such noise counts where the residuals of a sensor are more probable with it than with the known noise and with white
    noise of any size. Each of its parameters costs half the log of the number of samples (Schwarz 1978,
    doi:10.1214/aos/1176344136).
    left: of each record, its unit, not whitened.
    """
    records, plant = [r.record for r in replays], replays[0].model.plant
    grouped = by_sensor(records, list(zip(levels, replays, left, strict=True)))
    shown = {}
    for sensor, group in grouped.items():
        known, theirs, parts = (list(one) for one in zip(*group, strict=True))
        readings = [r.measured for r in theirs]
        if known[0].assumed:
            shown[sensor] = known[0]
            continue
        floor = max(hiding_noise(plant, sensor[0], FINE), *(r.record.signals[0].sensor.rounding for r in theirs))
        white = white_level(max(float(np.sqrt(np.mean(np.concatenate(parts) ** 2))), floor), 0)
        options = [(0, known[0]), (1, white), (2, alternating_level(parts, floor))]
        options += [(2, growing_level(readings, parts, floor))] if known[0].known else []
        n = sum(map(len, parts))
        probable = [sum(log_density(level, r, x) for r, x in zip(readings, parts, strict=True)) - 0.5 * k * np.log(n)
                    for k, level in options]  # fmt: skip
        shown[sensor] = options[int(np.argmax(probable))][1]
    found = [shown[sensor_of(r)] for r in records]
    return tuple(new if new.in_motion else level for new, level in zip(found, levels, strict=True))


def log_density(level: NoiseModel, readings: Array, residual: Array) -> float:
    """Return the log density of the residual of a record, up to a constant."""
    weights = level.weights(readings)
    white = level.white(residual, [len(residual)]) * weights
    return float(np.sum(np.log(weights / level.innovation)) - 0.5 * white @ white)


def growing_level(readings: Sequence[Array], parts: Sequence[Array], floor: float) -> NoiseModel:
    """Return the noise that makes residuals most probable where it grows with the reading.

    floor: the least that it is anywhere [unit of the readings].
    """
    from scipy.optimize import minimize

    residual, reading = np.concatenate(parts), np.concatenate(readings)
    sizes = np.sqrt(np.mean(residual**2)) / np.array([1.0, np.sqrt(np.mean(reading**2))])

    def sigma(logs: Array) -> Array:
        return np.asarray(np.hypot(max(np.exp(logs[0]), floor), np.exp(logs[1]) * reading))

    def surprise(logs: Array) -> float:
        return float(np.sum(2.0 * np.log(sigma(logs)) + (residual / sigma(logs)) ** 2))

    logs = minimize(surprise, np.log(sizes), method="Nelder-Mead").x
    still, growth = np.exp(logs)
    rms = float(np.sqrt(np.mean(sigma(logs) ** 2)))
    return replace(white_level(rms, 0), growth=float(growth), still=max(float(still), floor))


def alternating_level(parts: Sequence[Array], floor: float) -> NoiseModel:
    """Return the noise that makes residuals most probable where neighbouring samples differ in sign.

    floor: the least that it is, rms [unit of the residuals].
    """
    from scipy.optimize import minimize_scalar

    def size(alternation: float) -> float:
        return float(np.sqrt(np.mean(np.concatenate([without_alternation(x, alternation) for x in parts]) ** 2)))

    alternation = float(minimize_scalar(size, bounds=(LEAST_ALTERNATION, 1.0), method="bounded").x)
    rms = max(size(alternation) * float(np.sqrt(1.0 + alternation**2)), floor)
    return replace(white_level(rms, 0), innovation=rms / float(np.sqrt(1.0 + alternation**2)), alternation=alternation)


def memory_and_sizes(parts: Sequence[Array]) -> tuple[float, list[float]]:
    """Return how long the noise in residuals remembers, see `memory_of`, and its rms in each.

    By differences of what each sample adds to the last; no memory where the residuals hold more than such noise.
    """

    def sizes(memory: float) -> list[float]:
        return [difference_rms(x[1:] - memory * x[:-1]) / float(np.sqrt(1.0 - memory**2)) for x in parts]

    memory = memory_of(parts)
    if memory and np.mean(np.concatenate(parts) ** 2) > MISFIT * np.median(sizes(memory)) ** 2:
        memory = 0.0
    return memory, sizes(memory)


def pooled_level(records: Sequence[Record], floor: float) -> NoiseModel:
    if all(r.is_noise_free for r in records):
        return replace(white_level(max(assumed_rms([r.measured for r in records]), floor), 0), assumed=True)
    rested = [r for r in records if r.noise.source == "rest"]
    if not rested:
        return white_level(max(float(np.median([r.noise.rms for r in records])), floor), 0)
    rests = [r.rest - np.mean(r.rest) for r in rested]
    n = sum(len(r) - 1 for r in rests)
    # Quantisation alone has noise that a rest on one step does not show: the record's own figure knows of it.
    rms = max(np.sqrt(sum(float(r @ r) for r in rests) / n), min(r.noise.rms for r in rested), floor)
    return coloured_level(rests, rms, n) if n >= FEWEST_FOR_COLOUR else white_level(rms, n)


def white_level(rms: float, n_samples: int) -> NoiseModel:
    return NoiseModel(float(rms), np.empty(0), float(rms), np.empty((0, 0)), n_samples, n_samples, n_samples)


def remembering_level(rms: float, memory: float) -> NoiseModel:
    """Return noise whose correlation is memory^k at lag k, known from no rest."""
    if not memory:
        return white_level(rms, 0)
    return NoiseModel(rms, np.array([memory]), rms * float(np.sqrt(1.0 - memory**2)), np.array([[1.0 / rms]]), 0, 0, 0)


def coloured_level(rests: Sequence[Array], rms: float, n: int) -> NoiseModel:
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
    while len(correlation) <= MOST_LAGS_OF_NOISE:
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
    return NoiseModel(float(rms), terms, innovation, head, n, slow, power)


def yule_walker(covariance: Array, order: int) -> tuple[Array, float]:
    """Return the terms of an autoregression and the variance of its innovations."""
    terms = np.linalg.solve(toeplitz(covariance[:order]), covariance[1 : order + 1])
    return np.asarray(terms, dtype=np.float64), float(covariance[0] - terms @ covariance[1 : order + 1])


@dataclass(frozen=True)
class Level:
    """How far a record scatters about the model.

    rms: [unit of the record]; effective_fraction: independent samples per sample; from_residual: the residual was far
    above the noise, so that it, with its correlation in time, is what scatters; assumed: nothing was measured.
    """

    rms: float
    effective_fraction: float
    from_residual: bool = False
    assumed: bool = False

    @property
    def remark(self) -> str:
        """What is special about the noise, in words."""
        return IS_ASSUMED if self.assumed else ""


def assumed_rms(signals: Sequence[Array]) -> float:
    """Return the rms of the noise that is assumed of signals without noise [their unit].

    A simulated motion has errors of its simulation, of unknown size: what is much smaller shows nothing.
    """
    return ASSUMED * float(np.sqrt(np.mean(np.concatenate(signals) ** 2)))


def known_level(replay: Replay) -> Level:
    """Return the noise of a record, or what is assumed of one without noise."""
    noise = replay.record.noise
    if not replay.record.is_noise_free:
        return Level(noise.rms, noise.effective_fraction)
    floor = hiding_noise(replay.model.plant, replay.record.output, FINE)
    return Level(max(assumed_rms([replay.measured]), floor), noise.effective_fraction, assumed=True)


def level_of(replay: Replay, space: Space, x: Array) -> Level:
    known = known_level(replay)
    noise = replace(replay.record.noise, rms=known.rms)
    candidate = space.complete(x[np.newaxis])
    residual = replay.measured - replay.signal(candidate)[0]
    rms = float(np.sqrt(np.mean(residual**2)))
    is_hidden = rms <= ENGINE_ERRORS * replay.engine_error_at(candidate[0]) or (known.assumed and rms <= known.rms)
    if not np.isfinite(rms) or is_hidden:
        return known
    if not is_noise(residual, noise):
        return Level(max(rms, noise.rms), 1.0 / (1.0 + 2.0 * correlation_sum(residual)), from_residual=True)
    # differences tell the least that the noise can be, and nothing of its colour
    return known if noise.source == "rest" else Level(max(rms, noise.rms), new_share(residual))


def is_noise(residual: Array, noise: Noise) -> bool:
    """Tell whether a residual, (n_samples,), may be the noise of its record and nothing more.

    By F tests, in independent samples: its mean square against that of the rest; the means of its blocks, where a
    smooth misfit far below the noise of a sample stands out, against its own mean square. Noise from differences is a
    lower bound that knows no correlation: there only a mean square of more than twice that is a misfit.
    """
    if noise.rms == 0.0:
        return not residual.any()
    square, share = float(np.mean(residual**2)), noise.effective_fraction
    ratio, known = square / noise.rms**2, noise.n_samples * share
    if noise.source != "rest":
        # how well the noise itself is known: its mean square scatters by 2/n_eff
        return bool(ratio <= MISFIT * (1.0 + 3.0 * np.sqrt(2.0 / known)))
    tests = [(ratio, residual.size * share, known)]
    for length in (ceil(n / share) for n in BLOCKS):
        blocks = residual[: residual.size // length * length].reshape(-1, length).mean(axis=1)
        if blocks.size:
            spread = float(np.mean(blocks**2)) * length * share / square
            # of white noise nothing else has to be known
            tests.append((spread, blocks.size, residual.size if share == 1.0 else known))
    # scipy.stats would take longer to load than an identification
    return all(float(fdtrc(above, below, value)) > CHANCE_OF_COLOUR for value, above, below in tests)


def levels_of(replays: Sequence[Replay], space: Space, x: Array, noise: float | None = None) -> tuple[Level, ...]:
    """Return the level of each record at a candidate: its noise, or its residual where that is far above the noise.

    Without noise there is nothing to weigh a change against: then white noise is assumed, see `assumed_rms`, and the
    level says so. noise: rms to assume for every record in place of all that.
    """
    if noise is not None:
        if len({r.place for r in replays}) > 1:
            raise ArmidError(f"a noise of {noise:g} was given, but records hold several outputs: none is expected")
        return tuple(Level(noise, 1.0, assumed=True) for _ in replays)
    return tuple(level_of(replay, space, x) for replay in replays)


def level_weights(levels: Sequence[Level]) -> tuple[float, ...]:
    """Return sqrt(effective fraction)/rms of each level, so that weighted squares sum to chi2 of effective samples."""
    return tuple(float(np.sqrt(level.effective_fraction)) / level.rms for level in levels)


def coloured(rng: np.random.Generator, shape: tuple[int, int], level: Level) -> Array:
    """Return normal noise of a level, correlated from sample to sample as its effective fraction says."""
    from scipy.signal import lfilter

    white = rng.standard_normal(shape)
    memory = (1.0 - level.effective_fraction) / (1.0 + level.effective_fraction)
    if memory > 0.0:
        white[:, 1:] *= np.sqrt(1.0 - memory**2)
        white = np.asarray(lfilter([1.0], [1.0, -memory], white, axis=1))
    return level.rms * white
