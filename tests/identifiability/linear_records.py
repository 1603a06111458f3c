"""A least-squares problem whose answers stand in textbooks: signals linear in the parameters."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from armid.estimation.least_squares import WeightedRecords
from armid.problem.space import Space


@dataclass(frozen=True, eq=False)
class LinearRecords(WeightedRecords):
    """Signals design @ z, with noise of 1; z: shares of the range. Beyond `lost` the first share diverges."""

    design: np.ndarray = field(kw_only=True)
    seen: np.ndarray = field(kw_only=True)
    lost: float = np.inf

    @cached_property
    def measured(self):
        return self.seen

    def signals(self, Z):
        whole = self.space.complete(self.values(Z))
        Z = (whole - self.space.low) / (self.space.high - self.space.low)
        return np.where((Z[:, :1] > self.lost), np.nan, Z @ self.design.T)


def linear_records(design, seen, lost=np.inf):
    """Return the problem; parameters a, b, c ... between 10 and 20."""
    n = design.shape[1]
    low = np.full(n, 10.0)
    space = Space(tuple("abcdefgh"[:n]), ("1",) * n, low, low + 10.0, np.full(n, np.nan))
    return LinearRecords((), space, (), design=design, seen=seen, lost=lost)
