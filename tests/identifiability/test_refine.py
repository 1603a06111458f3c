"""Local least squares against textbook problems, and on the arm."""

from dataclasses import replace

import numpy as np
import pytest
from linear_records import linear_records
from scipy.optimize import lsq_linear

from armid.errors import ArmidError
from armid.estimation.least_squares import estimate, fit, refine

TRUTH = np.array([3.05e6, 1.0, 0.55, 1.4])


def random_problem(seed, n_free=3, n_samples=40):
    """Return a collinear linear problem whose minimum often lies outside the box."""
    rng = np.random.default_rng(seed)
    design = rng.normal(size=(n_samples, n_free))
    design[:, 0] += 3.0 * design[:, -1]
    design *= 10.0
    return linear_records(design, design @ rng.uniform(-0.3, 1.3, n_free) + rng.normal(size=n_samples)), rng


@pytest.mark.parametrize("seed", range(12))
def test_it_is_the_bounded_linear_solution(seed):
    records, rng = random_problem(seed)
    expected = lsq_linear(records.design, records.seen, bounds=(0.0, 1.0), tol=1e-14)
    found = fit(records, rng.uniform(0.0, 1.0, 3))
    # where lsq_linear keeps a hair inside, ours ends on the box
    np.testing.assert_allclose(found, expected.x, atol=2e-6)
    assert ((found == np.clip(expected.x, 0.0, 1.0).round()) | (np.abs(expected.x - 0.5) < 0.49999)).all()


def test_some_of_these_end_on_the_box():
    ends = [fit(records, np.full(3, 0.5)) for records, _ in map(random_problem, range(12))]
    on_the_box = [bool(((z == 0.0) | (z == 1.0)).any()) for z in ends]
    assert 3 <= sum(on_the_box) < 12


def test_it_ends_before_a_region_that_diverges():
    design = np.eye(2) * 50.0
    records = linear_records(design, design @ [0.9, 0.3], lost=0.6)
    found = fit(records, np.array([0.1, 0.9]))
    assert found[0] <= 0.6
    assert found[0] > 0.5
    assert records.chi2(found)[0] < records.chi2([0.1, 0.9])[0]
    with pytest.raises(ArmidError, match="cannot start where the simulation diverges"):
        fit(records, np.array([0.7, 0.5]))


def test_a_slope_beside_a_region_that_diverges_is_one_sided():
    records = linear_records(np.diag([2.0, 5.0]), np.zeros(2), lost=0.50005)
    _, slopes = records.residual_and_slopes(np.array([0.5, 0.5]))
    np.testing.assert_allclose(slopes, np.diag([2.0, 5.0]), rtol=1e-9)


def clean(replays):
    """Return replays that measured the truth without noise."""
    told = []
    for r in replays:
        (piece,) = r.pieces
        signal = r.signal(TRUTH[np.newaxis])[0]
        noise = replace(r.record.noise, rms=0.0)
        told.append(replace(r, pieces=(replace(piece, measured=signal),), record=replace(r.record, noise=noise)))
    return tuple(told)


def test_the_arm_is_found_from_any_corner(lowering_replays, arm_space):
    told = clean(lowering_replays)
    for corner in (arm_space.low, arm_space.high, np.array([3.5e6, 0.6, 0.70, 0.9])):
        np.testing.assert_allclose(refine(told, arm_space, corner), TRUTH, rtol=1e-5)
    np.testing.assert_allclose(estimate(told, arm_space), TRUTH, rtol=1e-5)


def test_a_fixed_parameter_stays_and_weights_count(lowering_replays, arm_space):
    (good,) = clean(lowering_replays)
    (piece,) = good.pieces
    bad = replace(good, pieces=(replace(piece, measured=1.02 * piece.measured),))
    space = arm_space.with_fixed("n", 1.4)
    heavy = refine((good, bad), space, TRUTH[:3], weights=(1000.0, 1.0))
    even = refine((good, bad), space, TRUTH[:3])
    np.testing.assert_allclose(heavy, TRUTH[:3], rtol=1e-5)
    assert np.abs(even / TRUTH[:3] - 1.0).max() > 1e-3


def test_nothing_free_is_nothing_to_find(lowering_replays, arm_space):
    space = arm_space
    for name, value in zip(arm_space.names, TRUTH, strict=True):
        space = space.with_fixed(name, value)
    assert refine(lowering_replays, space, np.empty(0)).shape == (0,)
    assert estimate(lowering_replays, space).shape == (0,)
