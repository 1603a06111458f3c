"""From which state a record or a piece of it is simulated: what its outputs show at its first sample, smoothed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from armid.model import Array, Model, Plant
from armid.record.record import Signal
from armid.record.sensor import length_of_rest

State = tuple[dict[str, float], dict[str, float]]
# Of a record that is held out, the start comes from this share of its first samples, at most so long [s], at least so
# many samples; they do not judge.
SHARE_OF_START, LONGEST_S, FEWEST_OF_START = 0.05, 0.5, 5
STEPS, TINY = 4, 1e-6


@dataclass(frozen=True, eq=False)
class Track:
    """Hold a signal from which a start is taken, SI, on the grid.

    noise: deviation of one sample. step: of the sensor, 0 for a fine one. every: samples of the grid from one that was
    measured to the next; those between hold straight lines.
    """

    values: Array
    noise: float
    step: float = 0.0
    every: int = 1

    def smoothed(self, index: int, slope: bool = False, still: int = 0) -> tuple[float, float]:
        """Return the value at a sample of the grid, or its change from sample to sample, as `smoothed` does."""
        values = self.values[index % self.every :: self.every]
        value, deviation = smoothed(values, index // self.every, self.noise, slope, still // self.every)
        return (value / self.every, deviation / self.every) if slope else (value, deviation)


def track_of(signal: Signal) -> Track:
    """Return a signal with the noise of the start that it tells."""
    measured = 1.0 if signal.data is None else float(np.mean(signal.data))
    # lost samples leave fewer to tell it
    noise = signal.noise.rms / float(np.sqrt(min(signal.every * measured, 1.0)))
    return Track(signal.measured, noise, signal.sensor.step, signal.every)


def state_at(tracks: Mapping[str, Track], index: int) -> State:
    """Return constants (`start_position`, `start_speed`) and their standard deviations (SI) at one sample."""
    estimates = {name: t.smoothed(index) for name, t in tracks.items()}
    deviations = {name: float(max(d, tracks[name].step / np.sqrt(12.0))) for name, (_, d) in estimates.items()}
    return {name: value for name, (value, _) in estimates.items()}, deviations


def n_spent(n_samples: int, interval: float) -> int:
    """Return from how many first samples of a record (or piece) that is held out its start is taken."""
    return max(int(np.ceil(min(SHARE_OF_START * n_samples, LONGEST_S / interval))), FEWEST_OF_START)


def state_shown(
    plant: Plant, given: Mapping[str, float], tracks: Mapping[str, Track], interval: float, index: int,
    inputs: Sequence[Array],
) -> State:  # fmt: skip
    """Return the start constants that are not given, and their standard deviations, SI, as the outputs show them.

    The outputs are functions h of the states x. At the start their values are h(x), and they change by dh/dx f(x). The
    rates f depend there on states and constants alone (the rate of a position is a speed). Values and slopes of the
    smoothed outputs, each weighed by its deviation, are met by least squares. What no output shows keeps its default,
    with the plant's own size for its deviation. inputs: from this sample on; while they do not change the machine may
    stand still.
    """
    outputs = VisibleOutputs(plant, given)
    names = [c for c in plant.start_constants.values() if c not in given]
    units = {c.name: c.unit for c in plant.constants}
    sizes = np.array([plant.scales.effort if units[n] in ("N", "N m") else plant.scales.speed for n in names])
    values, rates = [], []
    every = min((t.every for t in tracks.values()), default=1)
    # noise of an input is white from row to row alone
    still = every * n_still([u[::every] for u in inputs])
    for output in (o for o in plant.outputs if o.name in tracks):
        track, floor = tracks[output.name], 1e-9 * plant.scales.speed
        value, deviation = track.smoothed(index, still=still)
        values.append((value, max(deviation, track.step / np.sqrt(12.0), floor), output.signal))
        slope, deviation = track.smoothed(index, slope=True, still=still)
        rates.append((slope / interval, max(deviation / interval, floor), output.signal))
    shown = [(v, d, key, outputs.value) for v, d, key in values if outputs.shows(key)]
    shown += [(v, d, key, outputs.rate) for v, d, key in rates if outputs.shows_rate(key)]
    start = np.array([outputs.constants[n] for n in names])

    def missed(constants: Array) -> Array:
        states = outputs.states(dict(zip(names, constants, strict=True)))
        return np.array([(value - function(key, states)) / deviation for value, deviation, key, function in shown])

    slopes = np.zeros((len(shown), len(names)))
    for _ in range(STEPS if names and shown else 0):
        moves = TINY * np.diag(sizes)
        slopes = np.array([(missed(start - m) - missed(start + m)) / (2.0 * TINY) for m in moves]).T
        # in shares of the sizes; of what is not shown the least change
        start = start + sizes * np.linalg.lstsq(slopes, missed(start), rcond=1e-12)[0]
    covariance = np.linalg.inv(slopes.T @ slopes + np.eye(len(names)))
    deviations = sizes * np.sqrt(np.diag(covariance))
    return dict(zip(names, map(float, start), strict=True)), dict(zip(names, map(float, deviations), strict=True))


def n_still(inputs: Sequence[Array]) -> int:
    """Return during how many first samples no input changes, or changes by no more than its noise."""
    if not inputs:
        return 0
    changed = np.flatnonzero(np.any([u != u[0] for u in inputs], axis=0))
    return max(int(changed[0]) if changed.size else len(inputs[0]), length_of_rest(inputs))


class VisibleOutputs:
    """Evaluate those outputs of a plant, and how fast they change, that states and constants alone decide.

    given: constants of the manoeuvre; a start replaces those of its name.
    """

    def __init__(self, plant: Plant, given: Mapping[str, float]) -> None:
        self.graph, self.plant = Model(plant).graph, plant
        self.constants: dict[str, Any] = {c.name: c.value for c in plant.constants} | dict(given)
        self.known = [s.name for s in plant.states if self.leaves(f"initial__{s.name}") <= set(self.constants)]

    def leaves(self, key: str) -> set[str]:
        node = self.graph.nodes[key]
        if node.function is None and node.kind != "port":
            return {key}
        return {leaf for needed in node.needs for leaf in self.leaves(needed)}

    def shows(self, key: str) -> bool:
        return self.leaves(key) <= {*self.known, *self.constants}

    def shows_rate(self, key: str) -> bool:
        moving = self.leaves(key) & {s.name for s in self.plant.states}
        return self.shows(key) and all(self.shows(f"rate__{name}") for name in moving)

    def states(self, start: Mapping[str, float]) -> dict[str, Any]:
        known = self.graph.values([f"initial__{n}" for n in self.known], self.constants | dict(start))
        return self.constants | {n: known[f"initial__{n}"] for n in self.known}

    def value(self, key: str, states: Mapping[str, Any]) -> float:
        return float(self.graph.values([key], states)[key])

    def rate(self, key: str, states: Mapping[str, Any]) -> float:
        moving = sorted(self.leaves(key) & set(self.known))
        rates = self.graph.values([f"rate__{n}" for n in moving], states)
        later, earlier = ({n: states[n] + side * TINY * rates[f"rate__{n}"] for n in moving} for side in (1.0, -1.0))
        return (self.value(key, {**states, **later}) - self.value(key, {**states, **earlier})) / (2.0 * TINY)

    def at(self, start: Mapping[str, float]) -> dict[str, float]:
        """Return the outputs at the first sample, output -> its unit; start: constant -> SI."""
        states = self.states(start)
        return {o.name: self.value(o.signal, states) for o in self.plant.outputs if self.shows(o.signal)}

    def moved(self, start: Mapping[str, float], changes: Mapping[str, float]) -> dict[str, float]:
        """Return the start at which outputs are larger by some changes, by least squares; changes: output -> its unit.

        The start itself where nothing changes, or where a change is not finite.
        """
        move = np.array(list(changes.values()))
        if not (move.any() and np.isfinite(move).all()):
            return dict(start)
        here = np.array(list(start.values()))
        return dict(zip(start, map(float, here + self.by_outputs(start, list(changes)) @ move), strict=True))

    def by_outputs(self, start: Mapping[str, float], names: Sequence[str]) -> Array:
        """Return how a start follows changes of outputs, by least squares, (n_constants, n_outputs)."""
        here, step = np.array(list(start.values())), TINY * self.plant.scales.speed

        def at(values: Array) -> Array:
            known = self.at(dict(zip(start, map(float, values), strict=True)))
            return np.array([known[name] for name in names])

        sides = [at(here + step * one) - at(here - step * one) for one in np.eye(len(here))]
        return np.asarray(np.linalg.pinv(np.array(sides).T / (2.0 * step), rcond=1e-12))


# A window of smoothing holds only what a polynomial of one of these degrees describes ...
DEGREES = (1, 2)
# ... and its value is taken from one of so many degrees more, whose bias is of a higher order.
HIGHER = 2
# Standard deviations by which squares may exceed those of the noise.
BY_CHANCE = 3.0
WINDOW_GROWTH, LONGEST_WINDOW = 1.25, 400


def smoothed(values: Array, index: int, noise: float, slope: bool = False, still: int = 0) -> tuple[float, float]:
    """Return the value of a signal at one sample and its standard deviation, or its change from sample to sample.

    A polynomial of degree 1 or 2 is fitted to windows of 5 to 400 samples around the sample (one-sided at the ends of a
    record). A window holds unless its squares are more than noise: sum r^2 > noise^2 (f + 3 sqrt(2 f)) with f degrees
    of freedom, or the same for what the next two degrees explain. A short one may fail by chance, so that longer ones
    are tried all the same. The value is that of the polynomial with these two degrees more, so that its bias is small
    against its deviation. The window of the smallest deviation wins; a signal without noise is not smoothed. Source of
    the higher degree: Calonico, Cattaneo, Titiunik 2014, doi:10.3982/ECTA11757.
    still: number n of samples from there on in which no input changes. If the signal is constant there too, its change
    is 0; the deviation is that of a straight line through these samples, noise * sqrt(12/n^3).
    """
    best = float(values[index]), noise
    if slope:
        low, n = window_at(index, FEWEST_OF_START, values.size), min(FEWEST_OF_START, values.size)
        row = polynomials(n, n - 1, slope)[index - low] @ polynomials(n, n - 1).T
        best = float(row @ values[low : low + n]), noise * float(np.sqrt(row @ row))
    rest = values[index : index + still]
    if rest.size >= FEWEST_OF_START and fitted(rest, 0, 0, noise, slope) is not None:
        at_rest = (0.0, noise * np.sqrt(12.0 / rest.size**3)) if slope else (np.mean(rest), noise / np.sqrt(rest.size))
        best = min(best, (float(at_rest[0]), float(at_rest[1])), key=lambda pair: pair[1])
    for degree in DEGREES:
        n = degree + HIGHER + 2
        while n <= min(values.size, LONGEST_WINDOW):
            low = window_at(index, n, values.size)
            estimate = fitted(values[low : low + n], index - low, degree, noise, slope)
            if estimate is not None:
                best = min(best, estimate, key=lambda pair: pair[1])
            n = int(n * WINDOW_GROWTH) + 1
    return best


def window_at(index: int, n: int, n_samples: int) -> int:
    return max(min(max(index - (n - 1) // 2, 0), n_samples - n), 0)


def fitted(window: Array, place: int, degree: int, noise: float, slope: bool) -> tuple[float, float] | None:
    """Return value and standard deviation at one place of a window, None where it holds more than a polynomial."""

    def exceeds(squares: float, freedom: int) -> bool:
        return bool(squares > noise**2 * (freedom + BY_CHANCE * np.sqrt(2.0 * freedom)))

    basis, mean = polynomials(window.size, degree + HIGHER), float(np.mean(window))
    centred = window - mean
    parts = basis.T @ centred
    inside, beyond = parts[: degree + 1], parts[degree + 1 :]
    left = float(centred @ centred - inside @ inside)
    if exceeds(left, window.size - degree - 1) or exceeds(float(beyond @ beyond), HIGHER):
        return None
    row = polynomials(window.size, degree + HIGHER, slope)[place]
    return (0.0 if slope else mean) + float(row @ parts), noise * float(np.sqrt(row @ row))


@cache
def polynomials(n: int, degree: int, slope: bool = False) -> Array:
    """Return orthonormal polynomials on n even samples, lowest degree first, (n, degree + 1); slope: their slopes."""
    powers = np.vander(np.linspace(-1.0, 1.0, n), degree + 1, increasing=True)
    basis, triangle = np.linalg.qr(powers)
    if not slope:
        return np.asarray(basis)
    rises = np.hstack([np.zeros((n, 1)), powers[:, :-1] * np.arange(1.0, degree + 1.0)]) * 2.0 / (n - 1)
    return np.asarray(np.linalg.solve(triangle.T, rises.T).T)
