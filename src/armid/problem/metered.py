"""A problem whose evaluations a meter counts, cuts off, and may answer from the log of an earlier run."""

from abc import abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.problem import Problem

from armid.problem.meter import Meter

Array = NDArray[np.float64]
# Finite, for identifiers that cannot live with infinity, and worse than any fitness (a sum of squares over the square
# of a tiny noise is large).
PENALTY = 1e100
# What an evaluator asks for by this name in `evaluate_values_of`: the weighted residual vector of each candidate.
RESIDUALS = "residuals"


class Metered(Problem):  # type: ignore[misc]
    """Minimise what `evaluated` returns, within the budget of a meter; without one there is no limit.

    A candidate that fails gets PENALTY and is counted; so does one asked for beyond the budget, but it is neither
    simulated nor counted. Candidates that the meter remembers from an earlier run are counted, not simulated.
    """

    def __init__(self, meter: Meter | None, **of_pymoo: Any) -> None:
        super().__init__(**of_pymoo)
        self.meter = meter

    @abstractmethod
    def evaluated(self, X: Array, residuals: bool) -> tuple[Array, Array | None]:
        """Return fitness, (n_candidates,), +inf where one failed, and if asked residuals, (n_candidates, n_total)."""

    def _evaluate(self, X: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        values, residuals = self.answered(X, RESIDUALS in out)
        if residuals is not None:
            out[RESIDUALS] = residuals
        out["F"] = values[:, np.newaxis]

    def answered(self, X: Array, residuals: bool = False) -> tuple[Array, Array | None]:
        """Return what pymoo is told of candidates: fitness, (n_candidates,), and residuals if asked and any is granted.

        Rows of residuals beyond the budget are NaN.
        """
        granted = len(X) if self.meter is None else self.meter.grant(len(X))
        if not granted:
            return np.full(len(X), PENALTY), None
        asked = X[:granted]
        values, vectors = self._remembered_or_evaluated(asked, residuals)
        failed = ~np.isfinite(values)
        if failed.any():
            values = np.where(failed, PENALTY, values)
        if self.meter is not None:
            self.meter.record(asked, values, failed)
        if granted == len(X):
            return values, vectors
        return padded(values, len(X), PENALTY), None if vectors is None else padded(vectors, len(X), np.nan)

    def _remembered_or_evaluated(self, X: Array, residuals: bool) -> tuple[Array, Array | None]:
        """Take what the meter remembers; residuals are in no log, so that candidates with them are simulated again."""
        if self.meter is None or residuals:
            return self.evaluated(X, residuals)
        known = self.meter.recall(X)
        if len(known) == len(X):
            return known, None
        found, _ = self.evaluated(X[len(known) :], residuals)
        return (np.concatenate([known, found]) if len(known) else found), None


def padded(values: Array, n: int, filler: float) -> Array:
    """Return rows with others behind them that hold the filler, n in all."""
    longer = np.full((n, *values.shape[1:]), filler)
    longer[: len(values)] = values
    return longer
