"""Profile likelihood against parabolas, bounded linear least squares, and the arm."""

import numpy as np
import pytest
from linear_records import linear_records
from scipy.optimize import lsq_linear
from scipy.stats import chi2

from armid.estimation.information import PROFILE_RISE, profiles
from armid.estimation.least_squares import fit


def seen_by(design, z, rng):
    return design @ z + rng.normal(size=len(design))


def test_of_a_linear_model_it_is_the_parabola():
    assert pytest.approx(chi2.ppf(0.95, 1)) == PROFILE_RISE
    rng = np.random.default_rng(3)
    design = 60.0 * rng.normal(size=(50, 3))
    design[:, 1] += 2.0 * design[:, 0]
    records = linear_records(design, seen_by(design, np.array([0.4, 0.5, 0.6]), rng))
    best, found = profiles(records, np.full(3, 0.5))
    deviation = 10.0 * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    np.testing.assert_allclose(best, np.linalg.lstsq(design, records.measured)[0], atol=1e-7)
    for p, d in zip(found, deviation, strict=True):
        assert p.bounded == (True, True)
        assert p.agrees
        np.testing.assert_allclose(p.deviation, d, rtol=1e-6)
        np.testing.assert_allclose([p.low, p.high], p.estimate + np.array([-1, 1]) * 1.95996 * d, atol=2e-3 * d)
        np.testing.assert_allclose(p.rise, ((p.values - p.estimate) / d) ** 2, atol=1e-5)
        assert (np.diff(p.values) >= 0.0).all()
        assert p.rise[[0, -1]].min() > PROFILE_RISE


@pytest.mark.parametrize("seed", range(3))
def test_with_bounds_it_is_the_bounded_solution(seed):
    """Hold a parameter, solve for the others in the box with another program: the same rise at every point."""
    rng = np.random.default_rng(seed)
    design = 10.0 * rng.normal(size=(30, 3))
    design[:, 0] = design[:, 1] - design[:, 2] + 0.5 * rng.normal(size=30)
    records = linear_records(design, seen_by(design, np.array([0.02, 0.5, 0.97]), rng))
    _, found = profiles(records, np.full(3, 0.5))
    least = 2.0 * lsq_linear(design, records.measured, bounds=(0.0, 1.0), tol=1e-14).cost
    for i, p in enumerate(found):
        others = [j for j in range(3) if j != i]
        for value, rise in zip(p.values, p.rise, strict=True):
            rest = records.measured - design[:, i] * (value - 10.0) / 10.0
            told = 2.0 * lsq_linear(design[:, others], rest, bounds=(0.0, 1.0), tol=1e-14).cost
            assert rise == pytest.approx(told - least, abs=1e-3)
        assert p.low == 10.0 or p.bounded[0]
        assert p.high == 20.0 or p.bounded[1]
        assert p.low <= p.estimate <= p.high
    assert any(not p.agrees for p in found)


def test_what_is_not_seen_is_open_on_both_sides():
    design = np.column_stack([40.0 * np.linspace(0.5, 1.0, 20), np.zeros(20)])
    _, (seen, unseen) = profiles(linear_records(design, design @ [0.5, 0.5]), np.array([0.4, 0.4]))
    assert seen.bounded == (True, True)
    assert unseen.bounded == (False, False)
    assert (unseen.low, unseen.high) == (10.0, 20.0)
    assert np.isinf(unseen.deviation)
    assert unseen.agrees
    np.testing.assert_allclose(unseen.rise, 0.0, atol=1e-9)


def test_an_estimate_on_its_bound_is_open_there():
    design = 30.0 * np.eye(2)
    _, (held, _) = profiles(linear_records(design, design @ [-0.05, 0.5]), np.array([0.5, 0.5]))
    assert held.bounded == (False, True)
    assert held.estimate == held.low == 10.0
    # (30 z + 1.5)^2 - 1.5^2 = 3.84
    assert held.high == pytest.approx(10.0 + 10.0 * (np.sqrt(PROFILE_RISE + 2.25) - 1.5) / 30.0, abs=2e-3)
    assert len(held.values) > 5


def test_a_region_that_diverges_bounds():
    design = 5.0 * np.eye(2)
    _, (p, _) = profiles(linear_records(design, design @ [0.5, 0.5], lost=0.6), np.array([0.4, 0.4]))
    assert p.bounded[1]
    assert p.high == pytest.approx(16.0, abs=0.05)
    assert np.isfinite(p.rise).all()


class TwoValleys(type(linear_records(np.eye(1), np.zeros(1)))):
    """Signals whose sum of squares has a second, deeper valley."""

    def signals(self, Z):
        z = np.atleast_2d(Z)[:, :1]
        return np.concatenate([20.0 * (z - 0.2) * (z - 0.8), 2.0 * (z - 0.8)], axis=1)


def test_a_profile_that_finds_a_deeper_valley_starts_again_there():
    plain = linear_records(np.ones((2, 1)), np.zeros(2))
    records = TwoValleys((), plain.space, plain.design, np.zeros(2))
    assert fit(records, np.array([0.1]))[0] < 0.3
    best, (p,) = profiles(records, np.array([0.1]))
    assert best[0] == pytest.approx(0.8, abs=1e-6)
    assert p.rise.min() >= 0.0
