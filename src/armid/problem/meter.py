"""The meter: the budget of a run, cut off exactly, and the one log of its evaluations."""

from abc import abstractmethod
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pymoo.core.problem import Problem
from pymoo.core.termination import Termination

from armid.errors import ArmidError, quoted
from armid.model import Array

# Candidates that may be asked for after the budget at least: an algorithm ends with its generation.
LEAST_GRACE = 100
# What is asked for has to end within a lifetime.
LARGEST_BUDGET = 10**15
# Finite, for identifiers that cannot live with infinity, and worse than any fitness (a sum of squares over the square
# of a tiny noise is large).
PENALTY = 1e100
# What an evaluator asks for by this name in `evaluate_values_of`: the weighted residual vector of each candidate.
RESIDUALS = "residuals"


class BudgetIgnoredError(ArmidError):
    """Say that a search asked on after its budget was used; what it has found stands in the meter."""


class Log(NamedTuple):
    """Everything that was simulated, in order; read-only.

    X: candidates, (used, n_parameters); F: their fitness, (used,); failed: whether the simulation failed, (used,).
    """

    X: Array
    F: Array
    failed: NDArray[np.bool_]


class Trace(NamedTuple):
    """The improvements: evaluation counts from 1, (n_improvements,); value is the best fitness from there on."""

    evaluation: NDArray[np.int64]
    value: Array


class Meter:
    """Count the simulations of any search against a budget, and remember the best.

    budget: number of simulations; target: fitness at which a search may stop (None: it never may).
    A failed candidate counts, but neither it nor a NaN is ever the best.
    Raises ArmidError for a budget that is not a whole number above 0 and for a target that is NaN.
    """

    def __init__(self, budget: int, target: float | None = None) -> None:
        if isinstance(budget, bool) or not isinstance(budget, int | np.integer) or budget < 1:
            raise ArmidError(f"the budget is {budget!r}, expected a whole number of simulations above 0")
        if budget > LARGEST_BUDGET:
            # a whole number may have more digits than any float
            raise ArmidError(f"the budget is {quoted(budget)}, expected at most {LARGEST_BUDGET:,} simulations")
        if target is not None and not isinstance(target, int | float | np.number):
            raise ArmidError(f"the target is {target!r}, expected a fitness")
        if target is not None and np.isnan(target):
            raise ArmidError("the target is NaN, expected a fitness")
        self.budget = int(budget)
        self.target = target
        self.used = 0
        self.n_failed = 0
        self.best_x: Array | None = None
        self.best_f = float("inf")
        self._largest, self._refused = LEAST_GRACE, 0
        self._improvements: list[tuple[int, float]] = []
        self._n_parameters = 0
        # the log as bytes, which grow in place
        self._X, self._F, self._failed = bytearray(), bytearray(), bytearray()

    @property
    def left(self) -> int:
        """How many simulations the budget still allows."""
        return self.budget - self.used

    @property
    def exhausted(self) -> bool:
        """Whether the budget is used up."""
        return self.used >= self.budget

    @property
    def reached(self) -> bool:
        """Whether the best fitness is at the target or below."""
        return self.target is not None and self.best_x is not None and self.best_f <= self.target

    def grant(self, n: int) -> int:
        """Return how many of n candidates may still be simulated."""
        self._largest = max(self._largest, int(n)) if self.left else self._largest
        return max(0, min(int(n), self.left))

    def refuse(self, n: int) -> None:
        """Count the candidates that an optimiser requests after the budget is used.

        Raises BudgetIgnoredError when they exceed the largest earlier request (a generation), and at least 100.
        """
        self._refused += n
        if self._refused > self._largest:
            raise BudgetIgnoredError(f"the search goes on after its budget of {self.budget} simulations: it is stopped")

    def record(self, X: ArrayLike, F: ArrayLike, failed: ArrayLike | None = None) -> None:
        """Append evaluations to the log.

        X: candidates, (n, n_parameters); F: fitness, (n,) or (n, 1); failed: which of them failed, (n,), None: none.
        Raises ArmidError for shapes that do not match and for more than the budget allows.
        """
        x, f = np.asarray(X, dtype=np.float64), np.asarray(F, dtype=np.float64).ravel()
        lost = np.zeros(f.shape, np.bool_) if failed is None else np.asarray(failed, dtype=np.bool_)
        if x.size == f.size == lost.size == 0:
            return
        if x.ndim != 2 or x.shape[0] != f.size or lost.shape != f.shape:
            raise ArmidError(f"candidates {x.shape}, fitness {f.shape} and failures {lost.shape} do not match")
        if self.used and x.shape[1] != self._n_parameters:
            raise ArmidError(f"candidates have {x.shape[1]} parameters, expected {self._n_parameters} as before")
        if f.size > self.left:
            raise ArmidError(f"{f.size} simulations were made, the budget allowed {self.left}")
        self._n_parameters = x.shape[1]
        for log, values in ((self._X, x), (self._F, f), (self._failed, lost)):
            log.extend(values.tobytes())
        self._improve(x, np.where(lost | np.isnan(f), np.inf, f))
        self.used += f.size
        self.n_failed += int(np.count_nonzero(lost))

    def log(self) -> Log:
        """Return everything recorded."""
        X, F = np.frombuffer(bytes(self._X)), np.frombuffer(bytes(self._F))
        return Log(X.reshape(self.used, self._n_parameters), F, np.frombuffer(bytes(self._failed), np.bool_))

    def trace(self) -> Trace:
        """Return the improvements."""
        evaluations, values = zip(*self._improvements, strict=True) if self._improvements else ((), ())
        return Trace(np.array(evaluations, np.int64), np.array(values, np.float64))

    def _improve(self, x: Array, f: Array) -> None:
        if not f.min() < self.best_f:
            return
        before = np.minimum.accumulate(np.concatenate(([self.best_f], f)))[:-1]
        better = np.flatnonzero(f < before)
        self._improvements += [(self.used + int(i) + 1, float(f[i])) for i in better]
        if better.size:
            self.best_x, self.best_f = x[better[-1]].copy(), float(f[better[-1]])


class MeterTermination(Termination):  # type: ignore[misc]
    """End when the meter's budget is used up or its target is reached; never earlier.

    meter: the one that the problem counts with. It is shared, not copied, when pymoo copies the termination.
    n_max_gen: end after so many generations as well (None: as many as the budget allows).
    Raises ArmidError for n_max_gen below 1.
    """

    def __init__(self, meter: Meter, n_max_gen: int | None = None) -> None:
        super().__init__()
        if n_max_gen is not None and n_max_gen < 1:
            raise ArmidError(f"n_max_gen is {n_max_gen}, expected a whole number above 0")
        self.meter = meter
        self.n_max_gen = n_max_gen

    def _update(self, algorithm: Any) -> float:
        """Return the share of the budget, or of the generations, that is used; 1 ends the search."""
        if self.meter.reached:
            return 1.0
        generations = algorithm.n_gen / self.n_max_gen if self.n_max_gen is not None else 0.0
        return float(max(self.meter.used / self.meter.budget, generations))

    def __deepcopy__(self, memo: dict[int, Any]) -> "MeterTermination":
        """Copy all but the meter: `minimize` copies its termination, and a copied meter would stand still."""
        twin = MeterTermination(self.meter, self.n_max_gen)
        twin.force_termination, twin.perc = self.force_termination, self.perc
        return twin


class Metered(Problem):  # type: ignore[misc]
    """Minimise what `evaluated` returns, within the budget of a meter; without one there is no limit.

    A candidate that fails gets PENALTY and is counted; so does one asked for beyond the budget, but it is neither
    simulated nor counted, and after a generation of these a search is stopped.
    """

    def __init__(self, meter: Meter | None, **of_pymoo: Any) -> None:
        super().__init__(**of_pymoo)
        self.meter = meter

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Share the problem and its meter: pymoo copies its problem, what is counted is one."""
        return self

    @abstractmethod
    def evaluated(self, X: Array, residuals: bool) -> tuple[Array, Array | None]:
        """Return fitness, (n_candidates,), +inf where one failed, and if asked residuals, (n_candidates, n_total)."""

    def _evaluate(self, X: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        values, residuals = self.answered(X, RESIDUALS in out)
        if residuals is not None:
            out[RESIDUALS] = residuals
        out["F"] = values[:, np.newaxis]

    def answered(self, X: Array, residuals: bool = False) -> tuple[Array, Array | None]:
        """Return what pymoo gets: fitness, (n_candidates,), and residuals if asked; NaN beyond the budget."""
        granted = len(X) if self.meter is None else self.meter.grant(len(X))
        if not granted:
            if self.meter is not None:
                self.meter.refuse(len(X))
            return np.full(len(X), PENALTY), None
        asked = X[:granted]
        values, vectors = self.evaluated(asked, residuals)
        failed = ~np.isfinite(values)
        if failed.any():
            values = np.where(failed, PENALTY, values)
        if self.meter is not None:
            self.meter.record(asked, values, failed)
        beyond = len(X) - granted
        if beyond:
            values = np.pad(values, (0, beyond), constant_values=PENALTY)
            vectors = None if vectors is None else np.pad(vectors, ((0, beyond), (0, 0)), constant_values=np.nan)
        return values, vectors
