"""A small campaign to begin with: an axis that was made up, with a friction that its declared plant lacks."""

import numpy as np
from numpy.typing import NDArray

from armid.new.start import template

Array = NDArray[np.float64]
# The made-up axis: inertia [kg m2], viscous friction [N m s/rad], noise of the speed [rad/s].
INERTIA, FRICTION, NOISE = 0.05, 0.03, 0.01
INTERVAL, N_SAMPLES = 0.005, 401
# File -> size [N m] and frequency [Hz] of the drive, seed of the noise.
RECORDS = {"synthetic_train.csv": (1.0, 0.8, 1), "synthetic_holdout.csv": (0.7, 1.3, 2)}
FIRST_STEP = 0.1
DIGITS = 6


def campaign_text(name: str) -> str:
    """Return the text of campaign.toml."""
    return template("campaign.toml.txt").substitute(name=name, inertia=INERTIA, friction=FRICTION, noise=NOISE)


def synthetic_records() -> dict[str, dict[str, Array]]:
    """Return file -> header -> values, shape (401,), of the made-up axis; the same at every call."""
    return {file: record(*told) for file, told in RECORDS.items()}


def record(size: float, frequency: float, seed: int) -> dict[str, Array]:
    """Return header -> values of one record: a drive that steps to and fro, and the speed with noise.

    J dv/dt = u - c v with u constant between samples is solved exactly:
    v' = v exp(-c dt/J) + u/c (1 - exp(-c dt/J)).
    """
    times = INTERVAL * np.arange(N_SAMPLES)
    drive = np.where(times < FIRST_STEP, 0.0, size * np.sign(np.cos(2.0 * np.pi * frequency * (times - FIRST_STEP))))
    kept = np.exp(-FRICTION * INTERVAL / INERTIA)
    speed = np.zeros(N_SAMPLES)
    for i in range(N_SAMPLES - 1):
        speed[i + 1] = kept * speed[i] + drive[i] / FRICTION * (1.0 - kept)
    measured = speed + NOISE * np.random.default_rng(seed).standard_normal(N_SAMPLES)
    columns = {"time_s": times, "angular_velocity_rad_s": measured, "drive_N_m": drive}
    return {header: np.round(values, DIGITS) for header, values in columns.items()}
