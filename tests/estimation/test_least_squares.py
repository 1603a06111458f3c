"""Least squares in the box against textbook problems and scipy's, and on the arm."""

import threading
from dataclasses import dataclass, field

import numpy as np
import pytest
from linear_records import linear_records
from scipy.optimize import lsq_linear

from armid.errors import ArmidError
from armid.estimation.least_squares import (
    LEAST_DAMPING,
    LeastSquaresProblem,
    descend,
    estimate,
    fit,
    promised_fall,
    refine,
    side_by_side,
    step_in_box,
)  # fmt: skip
from armid.problem.space import Space
from changed_records import noisy

TRUTH = np.array([3.05e6, 1.0, 0.55, 1.4])


@dataclass(frozen=True, eq=False)
class Analytic(LeastSquaresProblem):
    """Signals that are given by a function of the shares."""

    function: object
    measured: np.ndarray
    calls: list = field(default_factory=list)

    def signals(self, Z):
        self.calls.append(len(Z))
        return np.array([self.function(z) for z in Z])


def analytic(function, measured, n=3):
    box = Space(tuple("abcdefgh"[:n]), ("1",) * n, np.zeros(n), np.ones(n), np.full(n, np.nan))
    return Analytic((), box, function, measured)


def exponential(z):
    """Two decays, the first amplitude NaN where it is above 0.9."""
    t = np.linspace(0.0, 3.0, 200)
    with np.errstate(invalid="ignore"):
        return (z[0] + 0.0 * np.sqrt(0.9 - z[0])) * np.exp(-5.0 * z[1] * t) + z[2] * np.exp(-0.5 * t)


def random_problem(seed, n_free=3, n_samples=40):
    """Return a collinear linear problem whose minimum often lies outside the box."""
    rng = np.random.default_rng(seed)
    design = rng.normal(size=(n_samples, n_free))
    design[:, 0] += 3.0 * design[:, -1]
    design *= 10.0
    return linear_records(design, design @ rng.uniform(-0.3, 1.3, n_free) + rng.normal(size=n_samples)), rng


def test_it_is_the_bounded_linear_solution_and_ends_on_the_box():
    on_the_box = []
    for seed in range(8):
        records, rng = random_problem(seed)
        expected = lsq_linear(records.design, records.measured, bounds=(0.0, 1.0), tol=1e-14).x
        for found in (fit(records, rng.uniform(0.0, 1.0, 3)), descend(records, [np.full(3, 0.5)], 1e-12)):
            np.testing.assert_allclose(found, expected, atol=2e-6)
            # where lsq_linear keeps a hair inside, ours ends on the box
            assert ((found == np.clip(expected, 0.0, 1.0).round()) | (np.abs(expected - 0.5) < 0.49999)).all()
        on_the_box.append(bool(((found == 0.0) | (found == 1.0)).any()))
    assert 3 <= sum(on_the_box) < 8


@pytest.mark.parametrize("central", [False, True])
def test_it_finds_the_truth_from_several_starts_in_few_calls(central):
    truth = np.array([0.6, 0.4, 0.3])
    problem = analytic(exponential, exponential(truth))
    starts = [np.array([0.3, 0.1, 0.8]), np.array([0.8, 0.9, 0.1])]
    np.testing.assert_allclose(descend(problem, starts, 1e-10, central), truth, atol=1e-5)
    assert len(problem.calls) < 40


def test_a_region_that_diverges_is_kept_out_of():
    found = descend(analytic(exponential, exponential(np.array([0.899, 0.4, 0.3]))), [np.full(3, 0.5)], 1e-10)
    assert np.isfinite(exponential(found)).all()
    np.testing.assert_allclose(found, [0.899, 0.4, 0.3], atol=1e-3)
    design = np.eye(2) * 50.0
    records = linear_records(design, design @ [0.9, 0.3], lost=0.6)
    found = fit(records, np.array([0.1, 0.9]))
    assert 0.5 < found[0] <= 0.6
    assert records.chi2(found)[0] < records.chi2([0.1, 0.9])[0]
    with pytest.raises(ArmidError, match="cannot start where the simulation diverges"):
        fit(records, np.array([0.7, 0.5]))


def test_a_slope_beside_a_region_that_diverges_is_one_sided_and_what_has_no_influence_stays():
    records = linear_records(np.diag([2.0, 5.0]), np.zeros(2), lost=0.50005)
    residual, slopes = records.residual_and_slopes(np.array([0.5, 0.5]))
    np.testing.assert_allclose(slopes, np.diag([2.0, 5.0]), rtol=1e-9)
    # measured minus simulated
    np.testing.assert_allclose(residual, [-1.0, -2.5])
    problem = analytic(lambda z: np.arange(5.0) * z[0], 0.25 * np.arange(5.0), 2)
    for central in (False, True):
        np.testing.assert_allclose(descend(problem, [np.array([0.9, 0.7])], 1e-10, central), [0.25, 0.7], atol=1e-8)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_slope_next_to_a_jump_is_that_of_its_own_side(side):
    def signal(z):
        return np.array([3.0, 4.0]) * z[0] + 9.0 * (side * (z[0] - 0.5) > 5e-7)

    problem = analytic(signal, np.array([1.4, 2.1]), 1)
    _, slopes = problem.residual_and_slopes(np.array([0.5]))
    np.testing.assert_allclose(slopes, [[3.0], [4.0]], rtol=1e-8)


def test_a_fixed_parameter_stays_and_weights_count(lowering_replays, arm_space):
    (good,) = (noisy(r, rms=0.0).measuring(r.signal(TRUTH[np.newaxis])[0]) for r in lowering_replays)
    np.testing.assert_allclose(estimate((good,), arm_space), TRUTH, rtol=1e-5)
    bad = good.measuring(1.02 * good.measured)
    space = arm_space.with_fixed("n", 1.4)
    heavy = refine((good, bad), space, TRUTH[:3], weights=(1000.0, 1.0))
    even = refine((good, bad), space, TRUTH[:3])
    np.testing.assert_allclose(heavy, TRUTH[:3], rtol=1e-5)
    assert np.abs(even / TRUTH[:3] - 1.0).max() > 1e-3


def test_work_is_shared_among_threads_and_comes_in_order():
    for threads in (1, 2, 5):
        assert side_by_side(lambda x: x * x, range(20), threads) == [x * x for x in range(20)]
        assert side_by_side(lambda x: x, [], threads) == []
    both = threading.Barrier(2, timeout=30.0)
    assert side_by_side(lambda _: both.wait() >= 0, range(2), 2) == [True, True]
    with pytest.raises(ZeroDivisionError):
        side_by_side(lambda x: 1 / x, [1, 0], 2)


def test_a_step_in_the_box_leads_down_however_much_of_it_lies_outside():
    """Where the unknowns nearly make up for each other, the whole step leads far out of the box."""
    rng, box, reached = np.random.default_rng(5), (np.zeros(5), np.ones(5)), []
    for _ in range(200):
        slopes = rng.normal(size=(30, 5)) @ np.diag(10.0 ** rng.uniform(-6.0, 0.0, 5)) @ rng.normal(size=(5, 5))
        residual, z = rng.normal(size=30), rng.uniform(size=5) * (rng.uniform(size=5) > 0.3)
        square, slope = slopes.T @ slopes, slopes.T @ residual
        step = step_in_box(square, slope, z, LEAST_DAMPING, box) - z
        assert np.all((z + step >= 0.0) & (z + step <= 1.0))
        best = lsq_linear(slopes, residual, (-z, 1.0 - z + 1e-12)).x
        most = residual @ residual - np.sum((residual - slopes @ best) ** 2)
        falls = promised_fall(square, slope, z, box)
        assert falls >= -1e-9
        reached.append(falls / max(most, 1e-12))
    assert np.median(reached) > 0.99
    assert np.min(reached) > 0.9
