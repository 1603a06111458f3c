"""The paper's particle swarm (Eqs 8-9)."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from armid.identifiers.identifier import OF_PYMOO, RANGE, declared, option, population, refuse_unknown
from armid.identifiers.search import SearchAlgorithm, SearchOptions, SearchTask


@dataclass(frozen=True)
class Swarm(SearchOptions):
    """Search with a swarm whose inertia falls linearly.

    V(t+1) = sigma(t) V(t) + c1 r1 (P - X(t)) + c2 r2 (G - X(t)), clipped to the velocity limit (Eq 8);
    X(t+1) = X(t) + V(t+1), clipped to the box (Eq 9);
    sigma(t) = last + (first - last) (T - t) / T with T = n_iterations, then last; the first swarm is iteration t = 1.
    r1 and r2 are drawn per particle and parameter; P and G are the particle's and the swarm's best so far.
    Source: paper sections III.A and IV.B.
    """

    is_seeded = True

    n_particles: int | None = population(None, "particles of the swarm, at most 80 by default", tune=(5, 160))
    n_iterations: int | None = option(None, "iterations over which the inertia falls, by default budget / n_particles",
                                      least=1, most=10**15)  # fmt: skip
    c1: float = option(1.2, "pull towards a particle's own best", tune=(0.3, 2.5))
    c2: float = option(1.7, "pull towards the best of all", tune=(0.3, 2.5))
    first_inertia: float = option(0.9, "inertia of the first step", tune=(0.4, 1.0))
    last_inertia: float = option(0.4, "inertia of the last step", tune=(0.1, 0.7))
    velocity_limit: str | float = option(
        "literal", "largest step of a particle; literal: the paper's, the largest magnitude in the box", RANGE,
        least=np.finfo(np.float64).tiny, known=("literal",), expected="'literal' or a fraction of the range above 0",
        tune=(0.02, 1.0),
    )  # fmt: skip
    first_velocity: float = option(0.2, "largest of the first velocities, within the limit", RANGE)

    def search(self, task: SearchTask) -> None:
        """Move the swarm until the task drops it."""
        n = self.n_particles or min(80, task.budget)
        n_iterations, low, high = self.n_iterations or -(-task.budget // n), task.cube.low, task.cube.high
        shape, span, random, t = (n, low.size), high - low, task.random, 0
        limit = np.maximum(abs(low), abs(high))
        if not isinstance(self.velocity_limit, str):
            limit = self.velocity_limit * span
        x = low + span * random.random(shape)
        v = np.minimum(self.first_velocity * span, limit) * (2.0 * random.random(shape) - 1.0)
        best_x, best_f = x, np.full(n, np.inf)
        while True:
            x = np.minimum(np.maximum(x, low), high)
            f = task.ask(x).F
            t, better = t + 1, f < best_f
            best_x, best_f = np.where(better[:, np.newaxis] | (t == 1), x, best_x), np.where(better, f, best_f)
            left = (n_iterations - min(t, n_iterations)) / n_iterations
            inertia = self.last_inertia + (self.first_inertia - self.last_inertia) * left
            leader, r1, r2 = best_x[np.argmin(best_f)], random.random(shape), random.random(shape)
            v = inertia * v + self.c1 * r1 * (best_x - x) + self.c2 * r2 * (leader - x)
            v = np.minimum(np.maximum(v, -limit), limit)
            x = x + v


class PaperPSO(SearchAlgorithm):
    """Search with the paper's swarm where pymoo expects an algorithm.

    Parameters
    ----------
    n_particles : int
        Size of the swarm.
    n_iterations : int
        Iterations over which the inertia falls, and after which the run ends when no termination is given.
    **options
        Those of `Swarm` (c1, c2, first_inertia, last_inertia, velocity_limit, first_velocity), and those of pymoo's
        Algorithm, such as termination, callback, seed; verbose prints once output is given.

    Raises
    ------
    ArmidError
        For an unknown option or a value out of range, and in `setup` for a problem that has no finite box, has
        constraints or has several objectives.
    """

    def __init__(self, n_particles: int = 80, n_iterations: int = 150, **options: Any) -> None:
        names = [field.name for field in fields(Swarm)]
        refuse_unknown(options, names, "the swarm", OF_PYMOO)
        swarm = Swarm(n_particles, n_iterations, **{n: options.pop(n) for n in names if n in options})
        super().__init__(swarm.search, n_particles * n_iterations, Swarm.is_seeded, **options)


PSO = declared("pso", "the paper's particle swarm (Eqs 8-9)", Swarm, is_global=True)
