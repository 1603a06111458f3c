"""How the simulated arm is measured: the gyro, its noise, a record."""

import math
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from stand import RefusalError
from stand.arm import Manoeuvre
from stand.motion import SAMPLES_PER_SECOND, Trajectory

FloatArray = npt.NDArray[np.float64]
REST_SAMPLES = 100
"""Samples of rest that a record begins with, unless more are asked for."""
NOISE_DAMPING = 0.7
"""Damping ratio of the gyro that colours the noise, an estimate."""


@dataclass(frozen=True)
class Gyro:
    """Hold what the gyro does to the speed it is shown, in deg/s and Hz; 0 switches any but the range off.

    The paper gives a range of +-200 deg/s, a resolution below 0.15 % and 1 kHz. The step of 0.1 deg/s is an estimate:
    about what 12 bits make of 400 deg/s (0.098), and below 0.15 % of 200 deg/s (0.3). The noise is an estimate too.
    """

    noise_deg_s: float = 0.25
    quantisation_deg_s: float = 0.1
    noise_bandwidth_hz: float = 0.0
    range_deg_s: float = 200.0

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not (math.isfinite(value) and value >= 0.0):
                raise RefusalError(f"the gyro's {each.name} must be a number of 0 or more, not {value}")
        if self.range_deg_s <= self.quantisation_deg_s:
            raise RefusalError("the gyro's range must exceed its quantisation step")
        if self.noise_bandwidth_hz >= SAMPLES_PER_SECOND / 2:
            raise RefusalError(f"the noise bandwidth must stay below 500 Hz, but is {self.noise_bandwidth_hz} Hz")

    @property
    def decimals(self) -> int:
        """Give the decimals that write a multiple of the quantisation step exactly, at most 6."""
        step = self.quantisation_deg_s
        exact = (digits for digits in range(6) if step and math.isclose(round(step, digits), step, rel_tol=1e-9))
        return next(exact, 6)


def record_times(trajectory: Trajectory, rest_samples: int = REST_SAMPLES) -> FloatArray:
    """Give the times of a record [s]: samples of rest under the brake, then the manoeuvre from t = 0."""
    return np.arange(-rest_samples, trajectory.time_s.size) / SAMPLES_PER_SECOND


def measure(
    trajectory: Trajectory, gyro: Gyro, bias_deg_s: float, rng: np.random.Generator, rest_samples: int = REST_SAMPLES
) -> FloatArray:
    """Give one record of a trajectory [deg/s], rest included: speed plus noise, rounded to steps, kept in range."""
    rest = np.full(rest_samples, bias_deg_s)
    shown, step = np.concatenate((rest, np.degrees(trajectory.gyro))), gyro.quantisation_deg_s
    speed = shown + noise(shown.size, gyro, rng)
    if not step:
        return np.clip(speed, -gyro.range_deg_s, gyro.range_deg_s)
    most = math.floor(gyro.range_deg_s / step + 1e-9)
    # adding 0 turns a written -0 into 0
    return np.clip(np.round(speed / step), -most, most) * step + 0.0


def noise(size: int, gyro: Gyro, rng: np.random.Generator) -> FloatArray:
    """Draw stationary noise of the asked rms [deg/s]: white, or white noise that a second-order gyro has smoothed.

    The colour is the impulse response h(t) = exp(-z w t) sin(w sqrt(1 - z^2) t), w = 2 pi f, scaled to unit energy.
    """
    if not gyro.noise_bandwidth_hz:
        return gyro.noise_deg_s * rng.standard_normal(size)
    natural = 2.0 * math.pi * gyro.noise_bandwidth_hz
    memory = math.ceil(8.0 * SAMPLES_PER_SECOND / (NOISE_DAMPING * natural))
    time = np.arange(1, memory + 1) / SAMPLES_PER_SECOND
    ringing = np.sin(natural * math.sqrt(1.0 - NOISE_DAMPING**2) * time)
    response = np.exp(-NOISE_DAMPING * natural * time) * ringing
    white = rng.standard_normal(size + memory - 1)
    return gyro.noise_deg_s * np.convolve(white, response / np.linalg.norm(response), mode="valid")


@dataclass(frozen=True)
class Record:
    """Hold one record: file name, manoeuvre, role, the file it repeats, times [s], speeds [deg/s].

    `noise` is the rms of what was written less what the arm did, from t = 0 on [rad/s].
    """

    file: str
    manoeuvre: Manoeuvre
    role: str
    repeat_of: str | None
    time_s: FloatArray
    speed_deg_s: FloatArray
    noise: float


def recorded(
    trajectory: Trajectory, gyro: Gyro, bias_deg_s: float, rng: np.random.Generator, rest_samples: int,
    told: tuple[str, Manoeuvre, str, str | None],
) -> Record:  # fmt: skip
    """Measure a trajectory; `told` are file, manoeuvre, role and the file it repeats."""
    speed = measure(trajectory, gyro, bias_deg_s, rng, rest_samples)
    left = rms(np.radians(speed[rest_samples:]) - trajectory.gyro)
    return Record(*told, record_times(trajectory, rest_samples), speed, left)


def rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
