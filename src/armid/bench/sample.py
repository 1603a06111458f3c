"""A small campaign to work on: one lowering of the arm, simulated, with the noise of a gyro."""

import os
from pathlib import Path

import numpy as np

from armid.bench.task import PLANT, arm_task
from armid.record import write_campaign

REST, NOISE = 100, np.deg2rad(0.2)

HEAD = f"""\
name = "bench"
plant = "{PLANT}"
"""
RECORD = """\
[[records]]
file = "lower.csv"
role = "train"
start_angle_deg = -48.0
target_angle_deg = 22.0
shell = true
supply_V = 28.0
"""


def write_sample(folder: Path, n_samples: int = 701, seed: int = 2, n_records: int = 1) -> Path:
    """Write the campaign: 0.1 s of rest, then n_samples at 1 kHz, with white noise of 0.2 deg/s.

    n_records: of the same motion, each with noise of its own.
    """
    task, rng = arm_task(1, n_samples), np.random.default_rng(seed)
    speed = np.concatenate([np.zeros(REST), task.run().output[0]])
    times = np.arange(-REST, n_samples) * task.manoeuvre.interval
    names = [f"lower_{i}.csv" if i else "lower.csv" for i in range(n_records)]
    noisy = [np.rad2deg(speed + rng.normal(0.0, NOISE, speed.size)) for _ in names]
    columns = {n: {"time_s": times, "angular_velocity_deg_s": v} for n, v in zip(names, noisy, strict=True)}
    text = HEAD + "".join(RECORD.replace("lower.csv", name) for name in names)
    return write_campaign(folder, text, columns)


def child_environment() -> dict[str, str]:
    """Return the environment of a child process that finds this very package, installed or not."""
    home = str(Path(__file__).resolve().parents[2])
    paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
