"""A small problem on which identifiers are tried."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.problem import Problem

from armid.problem import PENALTY, Meter

Array = NDArray[np.float64]


class Trial(Problem):  # type: ignore[misc]
    """A bent valley in a box of very different units; with holes, simulations fail in a fifth of the box."""

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
