"""A search run without pymoo's loop is the search that pymoo's loop runs: the same candidates, ends and errors."""

import threading
from typing import Any

import numpy as np
import pytest
from pymoo.core.callback import Callback
from pymoo.optimize import minimize

from armid.estimation.identify import search
from armid.identifiers import IDENTIFIERS, Identifier, SearchAlgorithm, can_run_directly, identifier_of, run_directly
from armid.problem.fitness import FITNESS
from armid.problem.meter import Meter, MeterTermination
from armid.problem.problem import IdentificationProblem

COMPOSED = ("pso+bobyqa", "cmaes+least_squares", "multistart:cobyla", "random+multistart:slsqp", "ga+cobyla+sbplx")
OWN = [n for n, i in IDENTIFIERS.items() if not i.package]
ALONE = [n for n in (*OWN, *COMPOSED) if can_run_directly(identifier_of(n, IDENTIFIERS).build(100))]
BUDGET = 150


@pytest.fixture
def posed(arm_space, lowering_replays) -> Any:
    """Make the problem afresh: a meter and what it counts for."""

    def make(budget: int = BUDGET, target: float | None = None) -> tuple[IdentificationProblem, Meter]:
        meter = Meter(budget, target)
        return IdentificationProblem(arm_space, lowering_replays, FITNESS["rmse"], meter), meter

    return make


def by_pymoo(problem: IdentificationProblem, meter: Meter, identifier: Identifier, seed: int) -> list[int]:
    """Run it as any user of pymoo would; return what was used after each generation."""
    used: list[int] = []
    told = {"seed": seed, "callback": lambda _: used.append(meter.used), "copy_algorithm": False}
    minimize(problem, identifier.build(meter.budget), MeterTermination(meter), **told)
    return used


def test_the_searches_of_ours_run_directly_and_pymoo_s_own_do_not() -> None:
    assert set(OWN) - set(ALONE) == {"pso", "pymoo_pso", "ga", "de"}
    assert set(COMPOSED) < set(ALONE)


@pytest.mark.parametrize("seed", [0, 3])
def test_the_log_is_that_of_minimize(posed, seed) -> None:
    for name in (*OWN, *COMPOSED):
        check_log(posed, name, seed)


def check_log(posed, name, seed) -> None:
    (problem, meter), (other, theirs), used = posed(), posed(), []
    identifier = identifier_of(name, IDENTIFIERS)
    search(problem, meter, identifier, seed, lambda m: used.append(m.used))
    generations = by_pymoo(other, theirs, identifier, seed)
    for ours, expected in zip(meter.log(), theirs.log(), strict=True):
        np.testing.assert_array_equal(ours, expected)
    assert used == generations
    assert not [t for t in threading.enumerate() if t.name == "armid search"]


def test_it_ends_at_the_target_where_minimize_does(posed) -> None:
    for identifier in (identifier_of(name, IDENTIFIERS) for name in ALONE):
        _, first = whole = posed()
        by_pymoo(*whole, identifier, 1)
        target = float(np.median(first.trace().value))
        (problem, meter), (other, theirs) = posed(target=target), posed(target=target)
        assert search(problem, meter, identifier, 1, None) == "target reached"
        by_pymoo(other, theirs, identifier, 1)
        assert 0 < meter.used == theirs.used <= first.used
        assert meter.best_f == theirs.best_f <= target


@pytest.mark.parametrize("error", [ZeroDivisionError("mine"), KeyboardInterrupt(), StopIteration()], ids=repr)
def test_an_error_of_the_problem_comes_out(posed, monkeypatch, error) -> None:
    for name in ALONE:
        check_error(posed, monkeypatch, name, error)


def check_error(posed, monkeypatch, name, error) -> None:
    problem, meter = posed()
    answered, left, after = problem.answered, [4], [0]

    def failing(X: Any, residuals: bool = False) -> Any:
        left[0] -= 1
        if left[0] < 0:
            after[0] += 1
            raise error
        return answered(X, residuals)

    monkeypatch.setattr(problem, "answered", failing)
    if name in ("random", "sobol"):
        left[0] = 1
    with pytest.raises((type(error), RuntimeError)) as came:
        run_directly(identifier_of(name, IDENTIFIERS).build(BUDGET), problem, 1, lambda: meter.exhausted)
    # a StopIteration that passes a generator becomes a RuntimeError, Python says
    assert error in (came.value, came.value.__cause__)
    assert after == [1]


def test_what_pymoo_s_loop_has_to_see_to_leaves_it_to_pymoo(posed) -> None:
    class Told(Callback):  # type: ignore[misc]
        calls = 0

        def notify(self, algorithm: Any) -> None:
            Told.calls += 1

    class Mine(SearchAlgorithm):
        pass

    method = IDENTIFIERS["random"].build(100).method
    assert can_run_directly(SearchAlgorithm(method, 100))
    assert not can_run_directly(Mine(method, 100))
    assert not can_run_directly(SearchAlgorithm(method, 100, callback=Told()))
    assert not can_run_directly(SearchAlgorithm(method, 100, archive=None))
