"""What one identification spends on simulation, on fitness, and on everything around them."""

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.soo.nonconvex.pso import PSO
from pymoo.optimize import minimize
from pymoo.problems.single.sphere import Sphere

from armid.engine import STANDARD
from armid.identifiers import IDENTIFIERS
from armid.model import PLANTS, Model
from armid.problem.fitness import FITNESS, Fitness
from armid.problem.meter import Meter, MeterTermination
from armid.problem.problem import IdentificationProblem, ReadyRecord, Replay, replays
from armid.problem.space import space_of
from armid.record import read_campaign
from bench.measure import CPU, Bound, Row
from bench.samples import PLANT, write_sample

N_PARTICLES, N_ITERATIONS = 80, 150
PARTS = ("simulation", "fitness", "framework")


@dataclass(frozen=True)
class Spent:
    """Hold where the time of one identification went [s], and how many simulations it made."""

    simulation: float
    fitness: float
    framework: float
    used: int

    @property
    def total(self) -> float:
        """The whole time [s]."""
        return sum(getattr(self, name) for name in PARTS)


class Watched:
    """Stand in for a record, a fitness or a function, and add the time of its work to what was spent on `name` [s]."""

    def __init__(self, thing: Any, spent: dict[str, float], name: str) -> None:
        self._thing, self._spent, self._name = thing, spent, name

    def __getattr__(self, name: str) -> Any:
        return getattr(self._thing, name)

    def runs(self, candidates: NDArray[np.float64], shares: Any = None) -> Any:
        return self._timed(self._thing.runs, candidates, shares)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self._timed(self._thing, *arguments, **named)

    def _timed(self, function: Any, *arguments: Any, **named: Any) -> Any:
        start = CPU()
        result = function(*arguments, **named)
        self._spent[self._name] += CPU() - start
        return result


def sample_replays(n_samples: int = 701) -> tuple[Replay, ...]:
    """Return the bench's small campaign, read back and ready to be simulated on the standard schedule."""
    with TemporaryDirectory(prefix="armid-bench-") as folder:
        campaign = read_campaign(write_sample(Path(folder) / "campaign", n_samples))
    model = Model(PLANTS[PLANT])
    return replays(campaign.train, model, space_of(model), STANDARD)


def identification(made_ready: tuple[Replay, ...], n_iterations: int) -> Spent:
    """Identify with the paper's swarm as `armid identify` does, and tell where the time went."""
    spent = defaultdict[str, float](float)
    watched = tuple(Replay(cast(ReadyRecord, Watched(r.ready, spent, "simulation"))) for r in made_ready)
    measure = cast(Fitness, Watched(FITNESS["similarity"], spent, "fitness"))
    meter = Meter(N_PARTICLES * n_iterations)
    start = CPU()
    problem = IdentificationProblem(space_of(made_ready[0].model), watched, measure, meter)
    algorithm = IDENTIFIERS["pso"].build(meter.budget)
    minimize(problem, algorithm, MeterTermination(meter), seed=1, copy_algorithm=False)
    framework = CPU() - start - sum(spent.values())
    return Spent(spent["simulation"], spent["fitness"], framework, meter.used)


def pymoo_framework(n_iterations: int) -> float:
    """Return what pymoo's own swarm spends on the sphere in 4-D at the same budget, outside the function [s]."""
    problem, spent = Sphere(4), defaultdict[str, float](float)
    problem._evaluate = Watched(problem._evaluate, spent, "sphere")
    start = CPU()
    algorithm = PSO(pop_size=N_PARTICLES)
    minimize(problem, algorithm, ("n_eval", N_PARTICLES * n_iterations), seed=1, copy_algorithm=False)
    return CPU() - start - sum(spent.values())


def framework_rows(rounds: int = 6, n_iterations: int = N_ITERATIONS, n_samples: int = 701) -> list[Row]:
    """Measure one identification and pymoo's swarm on the sphere in turn."""
    made_ready = sample_replays(n_samples)
    identification(made_ready, 2)
    pymoo_framework(2)
    pairs = [(identification(made_ready, n_iterations), pymoo_framework(n_iterations)) for _ in range(rounds)]
    ours, theirs = min(s.framework for s, _ in pairs), min(t for _, t in pairs)
    whole = min((s for s, _ in pairs), key=lambda s: s.total)
    shares = ", ".join(f"{name} {getattr(whole, name) / whole.total:.0%}" for name in PARTS)
    size = f"{N_PARTICLES} x {n_iterations}"
    return [
        Row(f"framework of one identification, {size}", ours * 1e3, "ms", "pymoo's PSO on the sphere",
            ours / theirs, Bound(0.5, at_least=False),
            note=f"all but simulation and fitness; pymoo's PSO spends {theirs * 1e3:.0f} ms"),
        Row(f"one identification, {size}", whole.total * 1e3, "ms",
            simulations_per_s=whole.used / whole.total, note=shares),
    ]  # fmt: skip
