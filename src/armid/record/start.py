"""The state from which a piece starts, smoothed out of a record as far as its noise asks for it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from armid.record.grid import moved_onto_grid
from armid.record.noise import noise_of, quantisation_step
from armid.record.timing import Timing

Array = NDArray[np.float64]
POSITION, SPEED = "start_position", "start_speed"
# A window holds only what a polynomial of one of these degrees describes ...
DEGREES = (1, 2)
# ... and its value is taken from one of so many degrees more, whose bias is of a higher order.
HIGHER = 2
# Standard deviations by which squares may exceed those of the noise.
CHANCE = 3.0
GROWTH, LONGEST = 1.25, 400


@dataclass(frozen=True, eq=False)
class Track:
    """Hold a signal from which a start is taken.

    values: [SI], (n_samples,). noise: standard deviation of one sample [SI]. step: of the sensor [SI], 0 for a fine
    one.
    """

    values: Array
    noise: float
    step: float = 0.0


def track_of(values: Array, times: Array, timing: Timing) -> Track:
    """Return a column on the even grid, with its noise from the differences of what is in the file.

    values: [SI], (n_rows,). times: [s], (n_rows,).
    """
    irregular = times if timing.irregularity else None
    noise = noise_of(np.empty(0), values, timing.interval, irregular)
    return Track(moved_onto_grid(values, times, timing), noise.rms, quantisation_step(values))


def state_at(tracks: Mapping[str, Track], index: int) -> tuple[dict[str, float], dict[str, float]]:
    """Return constants (`start_position`, `start_speed`) and their standard deviations (SI) at one sample.

    A step of the sensor that no motion averages out is counted in full.
    """
    found = {name: smoothed(t.values, index, t.noise) for name, t in tracks.items()}
    deviations = {name: float(max(d, tracks[name].step / np.sqrt(12.0))) for name, (_, d) in found.items()}
    return {name: value for name, (value, _) in found.items()}, deviations


def smoothed(values: Array, index: int, noise: float) -> tuple[float, float]:
    """Return the value of a signal at one sample and its standard deviation, both in the unit of the signal.

    A polynomial of degree 1 or 2 is fitted to a window around the sample (at the ends of a record beside it), which
    grows from 5 to 400 samples until its squares are more than noise: sum r^2 > noise^2 (f + 3 sqrt(2 f)) with f
    degrees of freedom, or the same for what the next two degrees explain. The value is that of the polynomial with
    these two degrees more on the last window that held, so that its bias is small against its deviation. The window of
    the smallest deviation wins; a signal without noise is not smoothed.

    values: (n_samples,). noise: standard deviation of one sample, taken for white.
    Source of the higher degree: Calonico, Cattaneo, Titiunik 2014, doi:10.3982/ECTA11757.
    """
    best = float(values[index]), noise
    for degree in DEGREES:
        n = degree + HIGHER + 2
        while n <= min(values.size, LONGEST):
            low = min(max(index - (n - 1) // 2, 0), values.size - n)
            found = fitted(values[low : low + n], index - low, degree, noise)
            if found is None:
                break
            best = min(best, found, key=lambda pair: pair[1])
            n = int(n * GROWTH) + 1
    return best


def fitted(window: Array, place: int, degree: int, noise: float) -> tuple[float, float] | None:
    """Return value and standard deviation at one place of a window, None where it holds more than a polynomial."""
    basis, mean = polynomials(window.size, degree + HIGHER), float(np.mean(window))
    centred = window - mean
    parts = basis.T @ centred
    inside, beyond = parts[: degree + 1], parts[degree + 1 :]
    left = float(centred @ centred - inside @ inside)
    freedom = window.size - degree - 1
    if exceeds(left, freedom, noise) or exceeds(float(beyond @ beyond), HIGHER, noise):
        return None
    row = basis[place]
    return mean + float(row @ parts), noise * float(np.sqrt(row @ row))


def exceeds(squares: float, freedom: int, noise: float) -> bool:
    """Tell whether a sum of squares is more than what noise gives with so many degrees of freedom."""
    return bool(squares > noise**2 * (freedom + CHANCE * np.sqrt(2.0 * freedom)))


@cache
def polynomials(n: int, degree: int) -> Array:
    """Return orthonormal polynomials on n even samples, lowest degree first, shape (n, degree + 1)."""
    places = np.linspace(-1.0, 1.0, n)
    return np.asarray(np.linalg.qr(np.vander(places, degree + 1, increasing=True))[0])
