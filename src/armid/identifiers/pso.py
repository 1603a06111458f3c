"""The paper's particle swarm (Eqs 8-9) as a pymoo algorithm that keeps arrays."""

from typing import Any

import numpy as np
from pymoo.core.algorithm import Algorithm
from pymoo.core.population import Population
from pymoo.core.problem import Problem

from armid.errors import ArmidError
from armid.identifiers.identifier import OF_PYMOO, OF_SETUP, checked, checked_count, checked_population, refuse_unknown
from armid.identifiers.search import SwarmEvaluator, as_population, bounds_of
from armid.model import Array

OWN = (
    "n_particles", "n_iterations", "c1", "c2", "first_inertia", "last_inertia", "velocity_limit", "first_velocity",
)  # fmt: skip


class PaperPSO(Algorithm):  # type: ignore[misc]
    """Search with a swarm whose inertia falls linearly.

    V(t+1) = sigma(t) V(t) + c1 r1 (P - X(t)) + c2 r2 (G - X(t)), clipped to the velocity limit (Eq 8);
    X(t+1) = X(t) + V(t+1), clipped to the box (Eq 9);
    sigma(t) = last + (first - last) (T - t) / T with T = n_iterations; the first swarm is iteration t = 1.
    r1 and r2 are drawn per particle and parameter; P and G are the particle's and the swarm's best so far.

    n_particles: size of the swarm; n_iterations: T, and where the run ends when no termination is given.
    c1, c2, first_inertia, last_inertia: [1].
    velocity_limit: "literal", the paper's [-X_max, X_max] with X_max the largest magnitude in the box (|upper bound|
        for a positive parameter); or a fraction of each parameter's range.
    first_velocity: first velocities are uniform within this fraction of the range, or within the limit if that is less.
    of_pymoo: options of pymoo's Algorithm, such as termination, callback, seed; verbose prints once output is given.
    Raises ArmidError for an unknown option, for a value out of range, and in `setup` for a problem that has no finite
    box, has constraints or has several objectives. Source: paper sections III.A and IV.B.
    """

    def __init__(
        self,
        n_particles: int = 80,
        n_iterations: int = 150,
        c1: float = 1.2,
        c2: float = 1.7,
        first_inertia: float = 0.9,
        last_inertia: float = 0.4,
        velocity_limit: str | float = "literal",
        first_velocity: float = 0.2,
        **of_pymoo: Any,
    ) -> None:
        refuse_unknown(of_pymoo, OWN, "the swarm", OF_PYMOO)
        super().__init__(**({"evaluator": SwarmEvaluator()} | of_pymoo))
        self.n_particles = checked_population("n_particles", n_particles)
        self.n_iterations = checked_count("n_iterations", n_iterations)
        self.c1, self.c2 = checked("c1", c1), checked("c2", c2)
        self.first_inertia = checked("first_inertia", first_inertia)
        self.last_inertia = checked("last_inertia", last_inertia)
        self.first_velocity = checked("first_velocity", first_velocity)
        fraction = (np.finfo(np.float64).tiny, "'literal' or a fraction of the range above 0")
        literal = isinstance(velocity_limit, str) and velocity_limit == "literal"
        self.velocity_limit = None if literal else checked("velocity_limit", velocity_limit, *fraction)

    def setup(self, problem: Problem, **options: Any) -> Algorithm:
        """Make ready for a problem; options are pymoo's, and the unknown ones that pymoo would swallow are refused."""
        refuse_unknown(options, OF_SETUP, "the swarm")
        if options.get("termination", self.termination) is None:
            options["termination"] = ("n_gen", self.n_iterations)
        return super().setup(problem, **options)

    def inertia(self, t: int) -> float:
        """Return sigma(t), the inertia of the step from iteration t to t + 1; after T it stays as it was at T."""
        last = self.n_iterations
        return self.last_inertia + (self.first_inertia - self.last_inertia) * (last - min(t, last)) / last

    def _setup(self, problem: Problem, **_: Any) -> None:
        self._low, self._high = bounds_of(problem)
        if self.velocity_limit is None:
            self._limit = np.maximum(abs(self._low), abs(self._high))
        else:
            self._limit = self.velocity_limit * (self._high - self._low)

    def infill(self) -> Population:
        """Propose the next swarm: pymoo's method, without its passes over all individuals."""
        if self.problem is None:
            raise ArmidError("the swarm has no problem yet, expected a call of setup(problem) first")
        if self.is_initialized:
            return self._infill()
        self._initialize()
        return self._initialize_infill()

    def _initialize_infill(self) -> Population:
        shape = (self.n_particles, self._low.size)
        span = self._high - self._low
        x = self._low + span * self.random_state.random(shape)
        self._next_V = np.minimum(self.first_velocity * span, self._limit) * (
            2.0 * self.random_state.random(shape) - 1.0
        )
        return self._inside(x)

    def _initialize_advance(self, infills: Population, **_: Any) -> None:
        self._X, f = self._told(infills)
        self._V = self._next_V
        self._best_X, self._best_F = self._X.copy(), f
        self.pop = infills.copy()

    def _infill(self) -> Population:
        x, leader = self._X, self._best_X[np.argmin(self._best_F)]
        r1, r2 = self.random_state.random(x.shape), self.random_state.random(x.shape)
        v = self.inertia(self.n_iter - 1) * self._V + self.c1 * r1 * (self._best_X - x) + self.c2 * r2 * (leader - x)
        self._next_V = np.minimum(np.maximum(v, -self._limit), self._limit)
        return self._inside(x + self._next_V)

    def _advance(self, infills: Population, **_: Any) -> None:
        self._X, f = self._told(infills)
        self._V = self._next_V
        better = f < self._best_F
        self._best_X[better], self._best_F[better] = self._X[better], f[better]
        # a new array, as a callback may have kept the old one
        self.pop = self.pop.copy()
        self.pop[better] = infills[better]

    def _set_optimum(self) -> None:
        leader = int(np.argmin(self._best_F))
        found = self._best_F[leader] < np.inf
        self.opt = self.pop[leader : leader + 1] if found else Population.empty()

    def _inside(self, x: Array) -> Population:
        return as_population(np.minimum(np.maximum(x, self._low), self._high), self.n_iter)

    def _told(self, infills: Population | None) -> tuple[Array, Array]:
        """Read what was evaluated; a NaN becomes +inf, which is never an improvement."""
        if infills is None or len(infills) != self.n_particles:
            n = 0 if infills is None else len(infills)
            raise ArmidError(f"{n} candidates were told to the swarm, expected its {self.n_particles} particles")
        f = np.array([individual.F[0] for individual in infills], dtype=np.float64)
        return np.array([individual.X for individual in infills]), np.where(np.isnan(f), np.inf, f)
