"""What is benchmarked: the declared arm lowering its shell, and random candidates in its box."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armid.engine import Schedule, Simulation, calibrate, probes, simulate
from armid.model import EFFECTS, PLANTS, Manoeuvre, Model
from armid.problem.space import Space, space_of

Array = NDArray[np.float64]
PLANT, INTERVAL = "shell_transfer_arm", 1e-3
N_SAMPLES, N_CANDIDATES = 701, 80
# Cut this much finer the engine is exact to 1e-9 rad/s: the reference of every error here.
TIGHT = Schedule(16)


@dataclass(frozen=True, eq=False)
class Task:
    """Hold a population and how it is simulated: population (n_candidates, n_parameters), SI."""

    model: Model
    manoeuvre: Manoeuvre
    space: Space
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
    seed: int = 1,
) -> Task:
    """Return the declared arm with effects, a random population and the engine's standard schedule.

    bounds: name -> bounds other than the declared ones, SI.
    """
    model = Model(PLANTS[PLANT], tuple(EFFECTS[name] for name in effects))
    manoeuvre = Manoeuvre(INTERVAL, n_samples)
    space = space_of(model, bounds=bounds)
    low, high = space.low[space.free], space.high[space.free]
    schedule = calibrate(model, manoeuvre, space.complete(probes(low, high))).schedule
    rng = np.random.default_rng(seed)
    population = space.complete(low + (high - low) * rng.random((n_candidates, low.size)))
    return Task(model, manoeuvre, space, population, schedule)
