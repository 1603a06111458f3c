"""The meter: the budget of a run, cut off exactly, and the one log of its evaluations."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armid.model.errors import ArmidError

Array = NDArray[np.float64]

FIRST_CHUNK = 1024
# What is asked for has to end within a lifetime.
LARGEST_BUDGET = 10**15


class Log(NamedTuple):
    """Everything that was simulated, in order; read-only views.

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
    """Count simulations against a budget, whoever searches, and remember the best.

    budget: number of simulations; target: fitness at which a search may stop (None: it never may).
    resume_from: log of an earlier run with the same settings and seed, whole or cut off anywhere. A problem answers
    from it while the candidates agree with it bit for bit; at the first that differs the rest of it is dropped.
    `recalled` says how many were answered.
    A failed candidate counts, but neither it nor a NaN is ever the best.
    Raises ArmidError for a budget that is no whole number above 0 and for a target that is NaN.
    """

    def __init__(self, budget: int, target: float | None = None, resume_from: Log | None = None) -> None:
        if isinstance(budget, bool) or not isinstance(budget, int | np.integer) or budget < 1:
            raise ArmidError(f"the budget is {budget!r}, expected a whole number of simulations above 0")
        if budget > LARGEST_BUDGET:
            raise ArmidError(f"the budget is {budget:.6g}, expected at most {LARGEST_BUDGET:,} simulations")
        if target is not None and np.isnan(target):
            raise ArmidError("the target is NaN, expected a fitness")
        self.budget = int(budget)
        self.target = target
        self.used = 0
        self.n_failed = 0
        self.best_x: Array | None = None
        self.best_f = float("inf")
        self.recalled = 0
        self._earlier = resume_from
        self._improvements: list[tuple[int, float]] = []
        self._X = np.empty((0, 0))
        self._F = np.empty(0)
        self._failed = np.empty(0, np.bool_)

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
        return max(0, min(int(n), self.left))

    def recall(self, X: Array) -> Array:
        """Return the fitness of the leading candidates that stand next in the log resumed from, (n_known,).

        X: the next candidates, (n, n_parameters). A failed one has +inf.
        """
        if self._earlier is None:
            return np.empty(0)
        known, values, failed = (part[self.used : self.used + len(X)] for part in self._earlier)
        agree = (known == X[: len(known)]).all(axis=1) if known.shape[1:] == X.shape[1:] else np.zeros(1, np.bool_)
        n = len(agree) if agree.all() else int(np.argmin(agree))
        if n < len(X):
            self._earlier = None
        self.recalled += n
        return np.where(failed[:n], np.inf, values[:n])

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
        if self.used and x.shape[1] != self._X.shape[1]:
            raise ArmidError(f"candidates have {x.shape[1]} parameters, expected {self._X.shape[1]} as before")
        if f.size > self.left:
            raise ArmidError(f"{f.size} simulations were made, the budget allowed {self.left}")
        self._append(x, f, lost)
        self._improve(x, np.where(lost | np.isnan(f), np.inf, f))
        self.used += f.size
        self.n_failed += int(np.count_nonzero(lost))

    def log(self) -> Log:
        """Return everything recorded."""
        views = self._X[: self.used], self._F[: self.used], self._failed[: self.used]
        for view in views:
            view.flags.writeable = False
        return Log(*views)

    def trace(self) -> Trace:
        """Return the improvements."""
        evaluations, values = zip(*self._improvements, strict=True) if self._improvements else ((), ())
        return Trace(np.array(evaluations, np.int64), np.array(values, np.float64))

    def _append(self, x: Array, f: Array, failed: NDArray[np.bool_]) -> None:
        end = self.used + f.size
        if end > self._F.size:
            room = min(self.budget, max(FIRST_CHUNK, 2 * end))
            self._X = _grown(self._X[: self.used].reshape(self.used, x.shape[1]), room)
            self._F, self._failed = _grown(self._F[: self.used], room), _grown(self._failed[: self.used], room)
        self._X[self.used : end], self._F[self.used : end], self._failed[self.used : end] = x, f, failed

    def _improve(self, x: Array, f: Array) -> None:
        if not f.min() < self.best_f:
            return
        before = np.minimum.accumulate(np.concatenate(([self.best_f], f)))[:-1]
        better = np.flatnonzero(f < before)
        self._improvements += [(self.used + int(i) + 1, float(f[i])) for i in better]
        if better.size:
            self.best_x, self.best_f = x[better[-1]].copy(), float(f[better[-1]])


def _grown(array: NDArray[Any], room: int) -> NDArray[Any]:
    """Return a longer array that starts with the given one."""
    longer = np.empty((room, *array.shape[1:]), array.dtype)
    longer[: len(array)] = array
    return longer
