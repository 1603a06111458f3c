"""A small campaign to work on: one lowering of the arm, simulated, with the noise of a gyro."""

import os
from pathlib import Path

import numpy as np

from armid.bench.task import PLANT, arm_task
from armid.record import write_campaign

REST, NOISE = 100, np.deg2rad(0.2)

TOML = f"""\
name = "bench"
plant = "{PLANT}"
[[records]]
file = "lower.csv"
role = "train"
start_angle_deg = -48.0
target_angle_deg = 22.0
shell = true
supply_V = 28.0
"""


def write_sample(folder: Path, n_samples: int = 701, seed: int = 2) -> Path:
    """Write the campaign: 0.1 s of rest, then n_samples at 1 kHz, with white noise of 0.2 deg/s."""
    task = arm_task(1, n_samples)
    speed = np.concatenate([np.zeros(REST), task.run().output[0]])
    times = np.arange(-REST, n_samples) * task.manoeuvre.interval
    noisy = np.rad2deg(speed + np.random.default_rng(seed).normal(0.0, NOISE, speed.size))
    columns = {"time_s": times, "angular_velocity_deg_s": noisy}
    return write_campaign(folder, TOML, {"lower.csv": columns})


def child_environment() -> dict[str, str]:
    """Return the environment of a child process that finds this very package, installed or not."""
    home = str(Path(__file__).resolve().parents[2])
    paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
