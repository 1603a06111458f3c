"""What sensors make of a motion: noise, steps of an encoder, a value that is held, lost rows, uneven times, faults."""

from dataclasses import dataclass

import numpy as np

from machines.catalogue import Array

FAULTS = ("late", "offset", "gain", "drift")
DIRT = ("none", "none", "lost")
SMOOTH_DIRT = ("none", "lost", "jitter", "jitter")
"""Times jitter only where the drive is smooth: a step between two samples has no time of its own in a file."""
NOISE = (-2.8, -1.7)
"""Decimal logarithm of the noise over the rms of the motion."""
HELD_S = 0.06
"""Longest time for which a sensor holds its value [s]."""
TURN = 2.0 * np.pi
FACTORS = {"rpm": TURN / 60.0, "deg": np.pi / 180.0, "mm": 1e-3}


@dataclass(frozen=True)
class Sensor:
    """Declare the sensor of one output.

    header: of its column. noise: rms of its white noise [SI]. step: of its quantisation [SI], 0 for a fine one. hold:
    samples for which it keeps a value. counts: of an encoder in a turn where its header says counts.
    """

    header: str
    noise: float
    step: float = 0.0
    hold: int = 1
    counts: int = 0

    @property
    def floor(self) -> float:
        """Rms of the noise and of the quantisation [SI]."""
        return float(np.hypot(self.noise, self.step / np.sqrt(12.0)))

    @property
    def kind(self) -> str:
        return "held" if self.hold > 1 else "quantised" if self.step else "white"

    def column(self, values: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return the column as written, in the unit of its header, and the noise in it [SI], (n_samples,)."""
        read = values + self.noise * rng.standard_normal(values.size)
        if self.step:
            read = self.step * np.rint(read / self.step)
        renewed = self.hold * (np.arange(values.size) // self.hold)
        factor = TURN / self.counts if self.counts else FACTORS.get(self.header.rpartition("_")[2], 1.0)
        column = read[renewed] / factor
        return np.rint(column) if self.counts else column, (read - values)[renewed]


def draw_sensor(headers: tuple[str, ...], unit: str, size: float, dt: float, rng: np.random.Generator) -> Sensor:
    """Draw a sensor for an output whose rms is `size` [SI], read every dt [s]; a speed may be held for 0.06 s."""
    header, noise = str(rng.choice(headers)), size * float(10.0 ** rng.uniform(*NOISE))
    if header.endswith("counts"):
        counts = int(2 ** np.ceil(np.log2(TURN / (3.0 * noise))))
        return Sensor(header, 0.3 * TURN / counts, TURN / counts, counts=counts)
    quantised = rng.random() < 0.4
    factor = FACTORS.get(header.rpartition("_")[2], 1.0)
    # a step is 1, 2 or 5 of a decimal of the unit that is written
    decimal = 10.0 ** np.floor(np.log10(noise / factor))
    step = float(decimal * rng.choice([1.0, 2.0])) * factor if quantised else 0.0
    longest = min(int(HELD_S / dt), 18)
    hold = int(rng.integers(2, longest + 1)) if unit == "rad/s" and longest >= 2 and rng.random() < 0.4 else 1
    return Sensor(header, 0.5 * noise if quantised else noise, step, hold)


def faulty(kind: str, size: float, times: Array, values: Array) -> Array:
    """Return an output of a record at fault: late [s], with an offset [SI], a gain [1] or a drift [SI/s]."""
    if kind == "late":
        return np.interp(times - size, times, values)
    if kind == "gain":
        return values * (1.0 + size)
    return values + (size if kind == "offset" else size * times)


def fault_size(kind: str, times: Array, values: Array, floor: float, rng: np.random.Generator) -> float:
    """Draw the size of a fault that moves the record by 3 to 10 times the floor; of a delay at most 0.1 s."""
    wanted = floor * float(rng.uniform(3.0, 10.0)) * float(rng.choice([-1.0, 1.0]))
    if kind == "late":
        rate = float(np.sqrt(np.mean(np.gradient(values, times) ** 2)))
        return min(abs(wanted) / rate, 0.1)
    if kind == "gain":
        return wanted / float(np.sqrt(np.mean(values**2)))
    return wanted if kind == "offset" else wanted / float(times[-1]) * 3.0**0.5


def kept_rows(dirt: str, inputs: Array, rng: np.random.Generator) -> Array:
    """Return which rows of a record are written: some are lost, never the first, the last or one with a new input.

    inputs: (n_inputs, n_samples).
    """
    n = inputs.shape[1]
    if dirt != "lost":
        return np.arange(n)
    changes = np.any(np.diff(inputs, axis=1, prepend=inputs[:, :1]) != 0.0, axis=0)
    may = (rng.random(n) < 0.02) & ~changes
    may[[0, -1]] = False
    return np.flatnonzero(~may)
