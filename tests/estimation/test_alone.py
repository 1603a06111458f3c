"""A search run without pymoo's loop is the search that pymoo's loop runs: the same candidates, ends and errors."""

import numpy as np
import pytest
from pymoo.optimize import minimize
from pymoo.util.display.single import SingleObjectiveOutput

from armid.estimation.identify import search
from armid.identifiers import IDENTIFIERS, PaperPSO, SearchAlgorithm, identifier_of, run
from armid.problem.fitness import FITNESS
from armid.problem.meter import Meter, MeterTermination
from armid.problem.problem import IdentificationProblem

COMPOSED = ("pso+bobyqa", "cmaes+least_squares", "multistart:cobyla", "random+multistart:slsqp", "ga+cobyla+sbplx")
OWN = [n for n, i in IDENTIFIERS.items() if not i.package]
ALONE = [n for n in (*OWN, *COMPOSED) if isinstance(identifier_of(n, IDENTIFIERS).build(100), SearchAlgorithm)]
BUDGET = 150


@pytest.fixture
def posed(arm_space, lowering_replays):
    """Make the problem afresh: a meter and what it counts for."""

    def make(budget=BUDGET, target=None):
        meter = Meter(budget, target)
        return IdentificationProblem(arm_space, lowering_replays, FITNESS["rmse"], meter), meter

    return make


def by_pymoo(problem, meter, identifier, seed):
    """Run it as any user of pymoo would; return what was used after each generation."""
    used = []
    told = {"seed": seed, "callback": lambda _: used.append(meter.used), "copy_algorithm": False}
    minimize(problem, identifier.build(meter.budget), MeterTermination(meter), **told)
    return used


@pytest.mark.parametrize("name", [*OWN, *COMPOSED])
def test_the_log_is_that_of_minimize(posed, name):
    (problem, meter), (other, theirs), used = posed(), posed(), []
    identifier = identifier_of(name, IDENTIFIERS)
    search(problem, meter, identifier, 3, lambda m: used.append(m.used))
    generations = by_pymoo(other, theirs, identifier, 3)
    for ours, expected in zip(meter.log(), theirs.log(), strict=True):
        np.testing.assert_array_equal(ours, expected)
    assert used == generations


@pytest.mark.parametrize("name", ALONE)
def test_an_error_of_the_problem_comes_out(posed, monkeypatch, name):
    for error in (ZeroDivisionError("mine"), KeyboardInterrupt(), StopIteration()):
        problem, meter = posed()
        answered, left, after = problem.answered, [1 if name.startswith(("random", "sobol", "pso")) else 4], [0]

        def failing(X, residuals=False, *, error=error, answered=answered, left=left, after=after):
            left[0] -= 1
            if left[0] < 0:
                after[0] += 1
                raise error
            return answered(X, residuals)

        monkeypatch.setattr(problem, "answered", failing)
        with pytest.raises(type(error)) as came:
            run(identifier_of(name, IDENTIFIERS).build(BUDGET), problem, 1, lambda meter=meter: meter.exhausted)
        assert came.value is error
        assert after == [1]


def test_it_ends_at_the_target_where_minimize_does_and_shows_what_pymoo_does(posed):
    for identifier in (identifier_of(name, IDENTIFIERS) for name in ALONE):
        _, first = whole = posed()
        by_pymoo(*whole, identifier, 1)
        target = float(np.median(first.trace().value))
        (problem, meter), (other, theirs) = posed(target=target), posed(target=target)
        assert search(problem, meter, identifier, 1, None) == "target reached"
        by_pymoo(other, theirs, identifier, 1)
        assert 0 < meter.used == theirs.used <= first.used
        assert meter.best_f == theirs.best_f <= target
    (problem, meter), (other, theirs) = posed(), posed()
    shown = PaperPSO(n_particles=20, output=SingleObjectiveOutput(), verbose=True)
    run(shown, problem, 1, lambda: meter.used >= 60)
    run(PaperPSO(n_particles=20), other, 1, lambda: theirs.used >= 60)
    assert meter.used == theirs.used == 60
    np.testing.assert_array_equal(meter.log().X, theirs.log().X)
