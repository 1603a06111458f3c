"""Individuals of pymoo made, read and evaluated in a fraction of its time."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.evaluator import Evaluator
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.core.problem import Problem

from armid.model.errors import ArmidError
from armid.problem import PENALTY

Array = NDArray[np.float64]


class SwarmEvaluator(Evaluator):  # type: ignore[misc]
    """Evaluate as pymoo's Evaluator does, with one pass over the individuals instead of one for each attribute.

    finite: give PENALTY instead of a fitness that is no finite number, for algorithms that a NaN would poison.
    """

    def __init__(self, finite: bool = False, **of_pymoo: Any) -> None:
        super().__init__(**of_pymoo)
        self.finite = finite

    def eval(self, problem: Problem, pop: Population, *args: Any, **kwargs: Any) -> Population:
        """Set F of individuals that nobody evaluated before; leave every other case to pymoo."""
        plain = not args and kwargs.keys() <= {"algorithm"} and {"F", "G", "H"} <= set(self.evaluate_values_of)
        fresh = isinstance(pop, Population) and not any(individual.evaluated for individual in pop)
        if not (plain and fresh) or problem.has_constraints():
            return self._finite(super().eval(problem, pop, *args, **kwargs))
        x = np.array([individual.X for individual in pop])
        values = [name for name in self.evaluate_values_of if name not in "GH"]
        out = problem.evaluate(x, return_values_of=values, return_as_dictionary=True, **kwargs)
        for individual, value in zip(pop, out.pop("F"), strict=True):
            individual.F = value
            individual.evaluated = {"F", "G", "H", *out}
        for name, column in out.items():
            pop.set(name, column)
        self.n_eval += len(pop)
        if self.callback:
            self.callback(pop)
        return self._finite(pop)

    def _finite(self, evaluated: Any) -> Any:
        if self.finite:
            for individual in [evaluated] if isinstance(evaluated, Individual) else evaluated:
                if not np.isfinite(individual.F).all():
                    individual.F = np.where(np.isfinite(individual.F), individual.F, PENALTY)
        return evaluated


@cache
def blank() -> dict[str, Any]:
    """Return the attributes of an individual of which nothing is known."""
    return dict(vars(Individual()))


def as_population(x: Array, n_iter: int | None) -> Population:
    """Return individuals at the candidates x, (n, n_parameters), as Population.new does, in a fraction of its time."""
    attributes = blank()
    pop = np.empty(len(x), dtype=object).view(Population)
    for i in range(len(x)):
        pop[i] = individual = Individual.__new__(Individual)
        own = {"_X": x[i], "data": {"n_gen": n_iter, "n_iter": n_iter}, "evaluated": set()}
        individual.__dict__ = attributes | own
    return pop


def box(problem: Problem) -> tuple[Array, Array]:
    """Return the bounds of a problem; refuse with ArmidError one that our algorithms cannot search."""
    if problem.n_obj != 1 or problem.has_constraints():
        raise ArmidError(
            f"the problem has {problem.n_obj} objectives and {problem.n_constr} constraints, expected 1 and 0"
        )
    if not problem.has_bounds() or not np.isfinite([problem.xl, problem.xu]).all() or (problem.xl > problem.xu).any():
        raise ArmidError(f"the problem's bounds are {problem.xl} and {problem.xu}, expected a finite box")
    return problem.xl, problem.xu
