"""A least-squares problem whose answers stand in textbooks: signals linear in the parameters."""

from dataclasses import dataclass

import numpy as np

from armid.estimation.least_squares import LeastSquaresProblem
from armid.problem.space import Space


@dataclass(frozen=True, eq=False)
class LinearRecords(LeastSquaresProblem):
    """Signals design @ z, with noise of 1; z: shares of the range. Beyond `lost` the first share diverges."""

    design: np.ndarray
    measured: np.ndarray
    lost: float = np.inf

    def signals(self, Z):
        whole = self.space.complete(self.values(Z))
        Z = (whole - self.space.low) / (self.space.high - self.space.low)
        return np.where((Z[:, :1] > self.lost), np.nan, Z @ self.design.T)


def linear_records(design, measured, lost=np.inf):
    """Return the problem; parameters a, b, c ... between 10 and 20."""
    n = design.shape[1]
    low = np.full(n, 10.0)
    space = Space(tuple("abcdefgh"[:n]), ("1",) * n, low, low + 10.0, np.full(n, np.nan))
    return LinearRecords((), space, design, measured, lost)
