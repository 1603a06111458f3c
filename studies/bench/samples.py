"""What is measured: the declared arm lowering its shell, random candidates in its bounds, and a small campaign."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import armid
from armid.engine import Schedule, Simulation, calibrate, probes, simulate
from armid.model import EFFECTS, PLANTS, Manoeuvre, Model
from armid.problem.space import space_of
from armid.record import write_campaign

Array = NDArray[np.float64]
PLANT, INTERVAL = "shell_transfer_arm", 1e-3
N_SAMPLES, N_CANDIDATES = 701, 80
# Cut this much finer the engine is exact to 1e-9 rad/s: the reference of every error here.
TIGHT = Schedule(16)
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


@dataclass(frozen=True, eq=False)
class Task:
    """Hold a population and how it is simulated: population (n_candidates, n_parameters), SI."""

    model: Model
    manoeuvre: Manoeuvre
    population: Array
    schedule: Schedule

    def run(self, threads: int = 1) -> Simulation:
        """Simulate the population on its calibrated schedule."""
        return simulate(self.model, self.manoeuvre, self.population, self.schedule, threads)

    def reference(self) -> Array:
        """Return the recorded signal of the population, integrated tightly [rad/s], (n_candidates, n_samples)."""
        return simulate(self.model, self.manoeuvre, self.population, TIGHT).output

    def error(self, output: Array, reference: Array) -> float:
        """Return the largest error of a signal [rad/s], on as many candidates as it has."""
        return float(np.max(np.abs(output - reference[: len(output)])))


def arm_task(
    n_candidates: int = N_CANDIDATES,
    n_samples: int = N_SAMPLES,
    effects: tuple[str, ...] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> Task:
    """Return the declared arm with effects, a random population and the engine's standard schedule.

    bounds: name -> bounds other than the declared ones, SI.
    """
    model = Model(PLANTS[PLANT], tuple(EFFECTS[name] for name in effects))
    manoeuvre = Manoeuvre(INTERVAL, n_samples)
    space = space_of(model, bounds=bounds)
    low, high = space.low[space.free], space.high[space.free]
    schedule = calibrate(model, manoeuvre, space.complete(probes(low, high))).schedule
    rng = np.random.default_rng(1)
    population = space.complete(low + (high - low) * rng.random((n_candidates, low.size)))
    return Task(model, manoeuvre, population, schedule)


def write_sample(folder: Path, n_samples: int = 701, n_records: int = 1) -> Path:
    """Write the campaign: 0.1 s of rest, then n_samples at 1 kHz, with white noise of 0.2 deg/s.

    n_records: of the same motion, each with noise of its own.
    """
    task, rng = arm_task(1, n_samples), np.random.default_rng(2)
    speed = np.concatenate([np.zeros(REST), task.run().output[0]])
    times = np.arange(-REST, n_samples) * task.manoeuvre.interval
    names = [f"lower_{i}.csv" if i else "lower.csv" for i in range(n_records)]
    noisy = [np.rad2deg(speed + rng.normal(0.0, NOISE, speed.size)) for _ in names]
    columns = {n: {"time_s": times, "angular_velocity_deg_s": v} for n, v in zip(names, noisy, strict=True)}
    text = HEAD + "".join(RECORD.replace("lower.csv", name) for name in names)
    return write_campaign(folder, text, columns)


def child_environment() -> dict[str, str]:
    """Return the environment of a child process that finds these files and this very armid, installed or not."""
    homes = [str(Path(file).resolve().parents[1]) for file in (__file__, str(armid.__file__))]
    paths = [*homes, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
