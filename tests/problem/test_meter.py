"""The meter alone, and the termination that looks at it."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest

from armid.problem.meter import Meter, MeterTermination


def simulate(meter, fitness, failed=None):
    """Record a population whose candidate number i is (i, f)."""
    meter.record([[i, f] for i, f in enumerate(fitness)], fitness, failed)


def test_grants_exactly_the_budget_and_the_log_holds_everything_in_order():
    meter = Meter(10)
    assert [meter.grant(n) for n in (3, 3, 20, 0, -1)] == [3, 3, 10, 0, 0]
    for asked, granted in ((4, 4), (4, 4), (4, 2), (4, 0)):
        assert meter.grant(asked) == granted
        simulate(meter, [1.0] * granted)
    assert (meter.used, meter.left, meter.exhausted) == (10, 0, True)
    with pytest.raises(ValueError, match="1 simulations were made, the budget allowed 0"):
        simulate(meter, [1.0])
    rng = np.random.default_rng(1)
    x, f, failed = rng.random((5000, 3)), rng.random(5000), rng.random(5000) < 0.1
    meter, start = Meter(5000), 0
    while meter.left:
        end = start + meter.grant(int(rng.integers(0, 700)))
        meter.record(x[start:end], f[start:end, np.newaxis], failed[start:end])
        start = end
    log = meter.log()
    np.testing.assert_array_equal(log.X, x)
    np.testing.assert_array_equal(log.F, f)
    np.testing.assert_array_equal(log.failed, failed)
    assert meter.best_f == f[~failed].min()
    with pytest.raises(ValueError, match="read-only"):
        log.F[0] = 0.0


def test_keeps_each_improvement_and_the_best_which_is_neither_nan_nor_failed():
    meter = Meter(100)
    assert (meter.best_x, meter.best_f) == (None, np.inf)
    simulate(meter, [5.0, 7.0, 5.0, 3.0])
    simulate(meter, [4.0, 3.0])
    simulate(meter, [9.0, 2.0, 1.0])
    evaluation, value = meter.trace()
    assert evaluation.tolist() == [1, 4, 8, 9]
    assert value.tolist() == [5.0, 3.0, 2.0, 1.0]
    assert meter.best_f == 1.0
    assert meter.best_x.tolist() == [2.0, 1.0]
    meter = Meter(100, target=0.5)
    simulate(meter, [np.nan, np.inf, 0.1], [False, False, True])
    assert (meter.best_x, meter.best_f, meter.reached, meter.n_failed) == (None, np.inf, False, 1)
    assert [len(a) for a in meter.trace()] == [0, 0]
    simulate(meter, [np.nan, 0.5, 0.2, np.nan], [True, False, True, False])
    assert (meter.best_f, meter.reached, meter.n_failed, meter.used) == (0.5, True, 3, 7)
    assert meter.trace().evaluation.tolist() == [5]


def test_refuses_what_does_not_match():
    for budget in (0, -1, 1.5, "12", True, None):
        with pytest.raises(ValueError, match="expected a whole number of simulations above 0"):
            Meter(budget)
    with pytest.raises(ValueError, match="expected at most 1,000,000,000,000,000 simulations"):
        Meter(10**16)
    meter = Meter(10)
    with pytest.raises(ValueError, match="target is NaN"):
        Meter(10, np.nan)
    for x, f, failed in (([[1.0]], [1.0, 2.0], None), ([1.0], [1.0], None), ([[1.0]], [1.0], [True, False])):
        with pytest.raises(ValueError, match="do not match"):
            meter.record(x, f, failed)
    meter.record([[1.0, 2.0]], [1.0])
    with pytest.raises(ValueError, match="candidates have 3 parameters, expected 2"):
        meter.record([[1.0, 2.0, 3.0]], [1.0])


def test_the_termination_follows_the_meter_its_target_and_its_generations_and_a_copy_does():
    meter = Meter(4, target=0.0)
    termination = MeterTermination(meter)
    for used in range(4):
        assert termination.update(SimpleNamespace(n_gen=10**6)) == used / 4
        assert not termination.has_terminated()
        simulate(meter, [1.0])
    termination.update(SimpleNamespace(n_gen=1))
    assert termination.has_terminated()
    meter = Meter(1000, target=0.5)
    termination = MeterTermination(meter, n_max_gen=4)
    assert [termination.update(SimpleNamespace(n_gen=n)) for n in (1, 3, 4)] == [0.25, 0.75, 1.0]
    simulate(meter, [0.5])
    assert termination.update(SimpleNamespace(n_gen=1)) == 1.0
    with pytest.raises(ValueError, match="n_max_gen is 0"):
        MeterTermination(meter, 0)
    termination = MeterTermination(Meter(10), 7)
    termination.terminate()
    twin = copy.deepcopy(termination)
    assert twin.meter is termination.meter
    assert (twin.n_max_gen, twin.force_termination) == (7, True)
