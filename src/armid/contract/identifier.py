"""The contract of an identifier."""

import random
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from pymoo.optimize import minimize

from armid.contract.trials import ContractPoint
from armid.identifiers import Identifier
from armid.model import Array
from armid.problem.meter import BudgetIgnoredError, Meter, Metered, MeterTermination


class Trial(Metered):
    """A bent valley in a box of very different units; with holes, simulations fail in a fifth of the box.

    10 (b - a^2)^2 + (a - 0.3)^2 + (c - 0.8)^2 in the unit cube; the failures are where a > 0.8. bare: they come out as
    NaN instead of the penalty that armid's problems give. watch: called with the candidates before they are evaluated.
    """

    def __init__(
        self, meter: Meter, holes: bool = False, bare: bool = False, watch: Callable[[Array], None] | None = None
    ) -> None:
        low, high = np.array([2.0e6, 0.5, -1.0]), np.array([3.0e6, 1.5, 1.0])
        super().__init__(meter, n_var=3, n_obj=1, xl=low, xu=high)
        self.holes, self.bare, self.watch = holes, bare, watch
        self.outside = 0

    def evaluated(self, X: Array, residuals: bool) -> tuple[Array, Array | None]:
        """Return the height of the valley, (n_candidates,), and the three terms whose squares it sums."""
        if self.watch is not None:
            self.watch(X)
        z = (X - self.xl) / (self.xu - self.xl)
        self.outside += int(((z < 0.0) | (z > 1.0)).any(axis=1).sum())
        a, b, c = z.T
        terms = np.column_stack([np.sqrt(10.0) * (b - a**2), a - 0.3, c - 0.8])
        failed = (a > 0.8) & self.holes
        return np.where(failed, np.inf, (terms**2).sum(axis=1)), terms if residuals else None

    def _evaluate(self, X: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        super()._evaluate(X, out, *args, **kwargs)
        if self.bare:
            failed = self.holes & ((X[:, 0] - self.xl[0]) / (self.xu[0] - self.xl[0]) > 0.8)
            out["F"][failed] = np.nan


BUDGET = 403
# Where the trial's simulations begin to raise: inside a generation.
RAISES_AT = 50


def check_identifier(identifier: Identifier) -> Iterator[ContractPoint]:
    """Try an identifier on a trial problem: as it is, with failing simulations, and with an error."""
    try:
        meter, problem = run(identifier, 1)
    except BudgetIgnoredError as error:
        yield ContractPoint("exact budget", False, str(error))
        return
    log = meter.log()
    best = f"the best of the log is {np.min(log.F):.3g}, the best that is kept {meter.best_f:.3g}"
    yield ContractPoint("exact budget", 0 < meter.used <= BUDGET, f"{meter.used} of {BUDGET} simulations used")
    yield ContractPoint("inside the box", problem.outside == 0, f"{problem.outside} candidates outside the bounds")
    yield ContractPoint("best never lost", meter.best_f == float(np.min(log.F)), best)
    early = float(np.median(log.F[:20]))
    yield ContractPoint("improves", meter.best_f < early, f"from {early:.3g}, the median of its first 20, to "
                        f"{meter.best_f:.3g}")  # fmt: skip
    again = difference(meter, run(identifier, 1, noise=2)[0])
    text = "the same seed asks for the same candidates, bit for bit"
    yield ContractPoint("reproducible", not again, f"the same seed again {again}" if again else text)
    other = difference(meter, run(identifier, 2)[0])
    says = "stochastic" if identifier.is_stochastic else "not stochastic"
    text = f"declared {says}, and another seed {other or 'asks for the same candidates'}"
    yield ContractPoint("seed", bool(other) == identifier.is_stochastic, text)
    yield failing(identifier, meter, "survives failures", bare=False)
    yield failing(identifier, meter, "survives NaN", bare=True)
    yield raising(identifier)


def failing(identifier: Identifier, undisturbed: Meter, name: str, bare: bool) -> ContractPoint:
    """Tell whether it searches on and improves where a fifth of the box fails; bare: with NaN instead of a penalty.

    One that ends before a third of the undisturbed run has been stopped by a failure.
    """
    meter, problem = run(identifier, 1, Trial(Meter(BUDGET), holes=True, bare=bare))
    log = meter.log()
    first = log.F[~log.failed][:20]
    improves = first.size > 0 and meter.best_f < float(np.median(first))
    value = "NaN" if bare else "a penalty"
    text = f"{meter.n_failed} of {meter.used} failed and gave {value}, best {meter.best_f:.3g}"
    return ContractPoint(name, improves and problem.outside == 0 and 3 * meter.used >= undisturbed.used, text)


class BrokenError(Exception):
    """Stand for whatever a user's model may raise."""


def raising(identifier: Identifier) -> ContractPoint:
    before = set(threading.enumerate())
    seen = 0

    def watch(X: Array) -> None:
        nonlocal seen
        seen += len(X)
        if seen > RAISES_AT:
            raise BrokenError

    came = "nothing"
    try:
        run(identifier, 1, Trial(Meter(BUDGET), watch=watch))
    except Exception as error:
        came = type(error).__name__
    ended_before = came == "nothing" and seen <= RAISES_AT
    left = [t.name for t in threading.enumerate() if t not in before]
    text = f"a problem that raises BrokenError: {came} came out, {len(left)} threads are left"
    return ContractPoint("errors come out", (came == BrokenError.__name__ or ended_before) and not left, text)


def run(identifier: Identifier, seed: int, problem: Trial | None = None, noise: int = 1) -> tuple[Meter, Trial]:
    """Run an identifier on a trial problem; noise: state of the global generators, which must not matter."""
    trial = Trial(Meter(BUDGET)) if problem is None else problem
    assert trial.meter is not None
    with disturbed(noise):
        minimize(trial, identifier.build(BUDGET), MeterTermination(trial.meter), seed=seed, copy_algorithm=False)
    return trial.meter, trial


@contextmanager
def disturbed(noise: int) -> Iterator[None]:
    kept, kept_by_numpy = random.getstate(), np.random.get_state()
    random.seed(noise)
    np.random.seed(noise)
    try:
        yield
    finally:
        random.setstate(kept)
        np.random.set_state(kept_by_numpy)


def difference(one: Meter, other: Meter) -> str:
    """Return from which candidate on two runs differ, in words, "" where requests and answers were the same."""
    a, b = one.log(), other.log()
    n = min(len(a.F), len(b.F))
    alike = (a.X[:n] == b.X[:n]).all(axis=1) & (a.F[:n] == b.F[:n]) if n else np.ones(0, np.bool_)
    if alike.all() and len(a.F) == len(b.F):
        return ""
    return f"differs from candidate {(n if alike.all() else int(np.argmin(alike))) + 1} on"
