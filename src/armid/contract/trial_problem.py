"""A small problem on which identifiers are tried."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.problem import Meter, Metered

Array = NDArray[np.float64]


class Trial(Metered):
    """A bent valley in a box of very different units; with holes, simulations fail in a fifth of the box.

    10 (b - a^2)^2 + (a - 0.3)^2 + (c - 0.8)^2 in the unit cube, a sum of three squares. The failures are where a > 0.8.
    bare: failed simulations come out as NaN instead of the penalty that armid's problems give.
    watch: called with the candidates before they are evaluated, and may raise.
    """

    def __init__(
        self, meter: Meter, holes: bool = False, bare: bool = False, watch: Callable[[Array], None] | None = None
    ) -> None:
        low, high = np.array([2.0e6, 0.5, -1.0]), np.array([3.0e6, 1.5, 1.0])
        super().__init__(meter, n_var=3, n_obj=1, xl=low, xu=high)
        self.holes, self.bare, self.watch = holes, bare, watch
        self.outside = self.simulated = 0

    def evaluated(self, X: Array, residuals: bool) -> tuple[Array, Array | None]:
        """Return the height of the valley, (n_candidates,), and the three terms, (n_candidates, 3)."""
        if self.watch is not None:
            self.watch(X)
        z = (X - self.xl) / (self.xu - self.xl)
        self.outside += int(((z < 0.0) | (z > 1.0)).any(axis=1).sum())
        self.simulated += len(X)
        a, b, c = z.T
        terms = np.column_stack([np.sqrt(10.0) * (b - a**2), a - 0.3, c - 0.8])
        failed = (a > 0.8) & self.holes
        return np.where(failed, np.inf, (terms**2).sum(axis=1)), terms if residuals else None

    def _evaluate(self, X: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        super()._evaluate(X, out, *args, **kwargs)
        if self.bare:
            failed = self.holes & ((X[:, 0] - self.xl[0]) / (self.xu[0] - self.xl[0]) > 0.8)
            out["F"][failed] = np.nan

    def __deepcopy__(self, memo: dict[int, Any]) -> "Trial":
        return self
