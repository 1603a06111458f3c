"""The engine's part of the benchmark, at tiny sizes: right numbers, no claims about time."""

import numpy as np
import pytest

from armid.bench.engine import ALLOWED, effects_row, engine_rows, loosest_tolerance, scipy_outputs, threads_row
from armid.bench.fitness import fitness_rows
from armid.bench.plain import plain_loop, solve_with_scipy
from armid.bench.row import Row
from armid.bench.task import arm_task


def assert_measured(row: Row) -> None:
    numbers = [row.measured, row.ratio, row.simulations_per_s]
    assert all(n is None or (np.isfinite(n) and n > 0) for n in numbers)
    assert row.measured is not None
    assert (row.ratio is None) == (row.wanted is None) == (row.met is None)


def test_engine_scipy_and_plain_loop_are_measured_with_their_errors() -> None:
    engine, scipy, plain = rows = engine_rows(rounds=1, n_candidates=16, n_scipy=2)
    for row in rows:
        assert_measured(row)
        assert row.simulations_per_s == pytest.approx(1e6 / row.measured)
        assert row.error is not None
    assert engine.ratio is None
    assert max(engine.error, scipy.error) <= ALLOWED
    assert plain.error <= 2e-3
    assert [r.wanted.number for r in (scipy, plain)] == [2000, 12]


def test_effects_are_measured_on_candidates_that_reach_their_switch() -> None:
    row = effects_row(rounds=1, n_candidates=16)
    assert_measured(row)
    assert row.error <= ALLOWED
    assert "16 of 16 candidates reach their switch" in row.note


def test_threads_give_the_same_bits() -> None:
    row = threads_row(rounds=1, n_candidates=32, attempts=1)
    assert_measured(row)
    assert row.error <= ALLOWED
    assert "the same bits" in row.note


def test_fitness_is_measured() -> None:
    for row in fitness_rows(rounds=1, n_candidates=4):
        assert_measured(row)


def test_reference_scipy_and_plain_loop_solve_the_same_equations() -> None:
    task = arm_task(2)
    reference, plain = task.reference(), np.empty((2, 701))
    plain_loop(task.population, plain, task.manoeuvre.interval)
    assert task.error(scipy_outputs(task, 2, 1e-11), reference) < 1e-9
    assert task.error(plain, reference) < 2e-3
    found = loosest_tolerance(task, reference, 2)
    assert found.error <= ALLOWED
    assert found.tolerance > 1e-8


def test_plain_baselines_agree_while_the_switch_is_never_reached() -> None:
    task = arm_task(1, 50)
    plain = np.empty((1, 50))
    plain_loop(task.population, plain, task.manoeuvre.interval)
    solved = solve_with_scipy(task.population[0], task.manoeuvre.times(), 1e-10)
    np.testing.assert_allclose(solved, plain[0], rtol=0, atol=1e-3)
