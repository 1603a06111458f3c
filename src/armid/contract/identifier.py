"""The contract of an identifier."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.problem import Problem
from pymoo.optimize import minimize

from armid.contract.finding import Finding
from armid.identifiers import Identifier
from armid.problem import PENALTY, Meter, MeterTermination

Array = NDArray[np.float64]
BUDGET = 403


class Trial(Problem):  # type: ignore[misc]
    """A bent valley in a box of two very different units, with a corner in which simulations fail."""

    def __init__(self, meter: Meter, holes: bool) -> None:
        super().__init__(n_var=3, n_obj=1, xl=np.array([2.0e6, 0.5, -1.0]), xu=np.array([3.0e6, 1.5, 1.0]))
        self.meter, self.holes, self.outside = meter, holes, 0

    def _evaluate(self, X: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        n = self.meter.grant(len(X))
        z = (X - self.xl) / (self.xu - self.xl)
        values = 10.0 * (z[:, 1] - z[:, 0] ** 2) ** 2 + (z[:, 0] - 0.3) ** 2 + (z[:, 2] - 0.8) ** 2
        failed = (z[:, 0] > 0.8) & self.holes
        values = np.where(failed, PENALTY, values)
        self.outside += int(((z < 0.0) | (z > 1.0)).any(axis=1)[:n].sum())
        self.meter.record(X[:n], values[:n], failed[:n])
        out["F"] = np.where(np.arange(len(X)) < n, values, PENALTY)[:, np.newaxis]

    def __deepcopy__(self, memo: dict[int, Any]) -> "Trial":
        return self


def run(identifier: Identifier, seed: int, holes: bool) -> tuple[Meter, Trial]:
    """Run an identifier on the trial problem."""
    meter = Meter(BUDGET)
    problem = Trial(meter, holes)
    minimize(problem, identifier.build(BUDGET), MeterTermination(meter), seed=seed, copy_algorithm=False)
    return meter, problem


def check_identifier(identifier: Identifier) -> list[Finding]:
    """Try an identifier on a trial problem, with and without failing simulations."""
    meter, problem = run(identifier, 1, False)
    again, holed = run(identifier, 1, False)[0], run(identifier, 1, True)[0]
    log, repeat = meter.log(), again.log()
    same = log.X.shape == repeat.X.shape and bool(np.array_equal(log.X, repeat.X) and np.array_equal(log.F, repeat.F))
    return [
        Finding("exact budget", meter.used <= BUDGET, f"{meter.used} of {BUDGET} simulations used"),
        Finding("inside the box", problem.outside == 0, f"{problem.outside} candidates outside the bounds"),
        Finding("best never lost", meter.best_f == float(np.min(log.F)), f"best {meter.best_f:.3g}"),
        Finding("improves", meter.best_f < float(np.median(log.F[:20])), "better than the median of its first 20"),
        Finding("reproducible", same, "the same seed asks for the same candidates, bit for bit"),
        Finding("survives failures", bool(holed.best_f < PENALTY), f"{holed.n_failed} of {holed.used} failed, best "
                f"{holed.best_f:.3g}"),
    ]  # fmt: skip
