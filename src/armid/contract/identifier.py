"""The contract of an identifier."""

import random
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from pymoo.optimize import minimize

from armid.contract.finding import Finding
from armid.contract.trial_problem import Trial
from armid.identifiers import Identifier
from armid.problem import PENALTY, Meter, MeterTermination

BUDGET = 403


def check_identifier(identifier: Identifier) -> list[Finding]:
    """Try an identifier on a trial problem, with and without failing simulations."""
    (meter, problem), (again, _), (holed, _) = (run(identifier, 1, holes, noise)
                                                for holes, noise in ((False, 1), (False, 2), (True, 1)))  # fmt: skip
    log = meter.log()
    best = f"the best of the log is {np.min(log.F):.3g}, the best that is kept {meter.best_f:.3g}"
    failures = f"{holed.n_failed} of {holed.used} failed, best {holed.best_f:.3g}"
    return [
        Finding("exact budget", 0 < meter.used <= BUDGET, f"{meter.used} of {BUDGET} simulations used"),
        Finding("inside the box", problem.outside == 0, f"{problem.outside} candidates outside the bounds"),
        Finding("best never lost", meter.best_f == float(np.min(log.F)), best),
        Finding("improves", meter.best_f < float(np.median(log.F[:20])), "better than the median of its first 20"),
        Finding("reproducible", same(meter, again), "the same seed asks for the same candidates, bit for bit"),
        seeded(identifier, meter),
        Finding("survives failures", bool(holed.best_f < PENALTY), failures),
    ]


def seeded(identifier: Identifier, meter: Meter) -> Finding:
    """Tell whether another seed changes what is asked for, as it is declared."""
    alike = same(meter, run(identifier, 2, False, 1)[0])
    says = "stochastic" if identifier.is_stochastic else "not stochastic"
    text = f"declared {says}, and another seed asks for {'the same' if alike else 'other'} candidates"
    return Finding("seed", alike != identifier.is_stochastic, text)


def run(identifier: Identifier, seed: int, holes: bool, noise: int) -> tuple[Meter, Trial]:
    """Run an identifier on the trial problem; noise: state of the global generators, which must not matter."""
    meter = Meter(BUDGET)
    problem = Trial(meter, holes)
    with disturbed(noise):
        minimize(problem, identifier.build(BUDGET), MeterTermination(meter), seed=seed, copy_algorithm=False)
    return meter, problem


@contextmanager
def disturbed(noise: int) -> Iterator[None]:
    """Put the global random generators into some state for a while."""
    kept, kept_by_numpy = random.getstate(), np.random.get_state()
    random.seed(noise)
    np.random.seed(noise)
    try:
        yield
    finally:
        random.setstate(kept)
        np.random.set_state(kept_by_numpy)


def same(one: Meter, other: Meter) -> bool:
    """Tell whether two runs asked for the same and were told the same."""
    a, b = one.log(), other.log()
    return a.X.shape == b.X.shape and bool(np.array_equal(a.X, b.X) and np.array_equal(a.F, b.F))
