"""The least squares of the loop, against scipy's on problems with a known answer."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from armid.loop.diagnose import square_along
from armid.loop.fit import decomposed, descend, step_in_box


class Analytic:
    """Pose signals that are given by a function of the shares, as `WeightedRecords` poses simulated ones."""

    def __init__(self, function, measured):
        self.function, self.measured = function, measured
        self.calls = 0

    def signals(self, Z):
        self.calls += 1
        return np.array([self.function(z) for z in Z])


def exponential(z):
    """Two decays, the first amplitude NaN where it is above 0.9."""
    t = np.linspace(0.0, 3.0, 200)
    with np.errstate(invalid="ignore"):
        return (z[0] + 0.0 * np.sqrt(0.9 - z[0])) * np.exp(-5.0 * z[1] * t) + z[2] * np.exp(-0.5 * t)


def test_it_finds_the_truth_from_several_starts_in_few_calls():
    truth = np.array([0.6, 0.4, 0.3])
    problem = Analytic(exponential, exponential(truth))
    found = descend(problem, [np.array([0.3, 0.1, 0.8]), np.array([0.8, 0.9, 0.1])], 1e-10)
    np.testing.assert_allclose(found, truth, atol=1e-5)
    assert problem.calls < 40


def test_it_ends_on_the_box_where_the_box_holds_it():
    rng = np.random.default_rng(5)
    matrix, target = rng.standard_normal((50, 4)), 3.0 * rng.standard_normal(50)
    problem = Analytic(lambda z: matrix @ z, target)
    found = descend(problem, [np.full(4, 0.5)], 1e-12)
    expected = lsq_linear(matrix, target, bounds=(0.0, 1.0), tol=1e-12).x
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert {0.0, 1.0} & set(found)


def test_a_region_that_diverges_is_kept_out_of():
    problem = Analytic(exponential, exponential(np.array([0.899, 0.4, 0.3])))
    found = descend(problem, [np.array([0.5, 0.5, 0.5])], 1e-10)
    assert np.isfinite(exponential(found)).all()
    np.testing.assert_allclose(found, [0.899, 0.4, 0.3], atol=1e-3)


def test_a_parameter_without_influence_stays_where_it_is():
    problem = Analytic(lambda z: np.outer(np.arange(5.0), [z[0]])[:, 0], 0.25 * np.arange(5.0))
    np.testing.assert_allclose(descend(problem, [np.array([0.9, 0.7])], 1e-10), [0.25, 0.7], atol=1e-8)


@pytest.mark.parametrize("seed", range(8))
def test_a_step_in_the_box_is_the_bounded_least_squares_step(seed):
    rng = np.random.default_rng(seed)
    matrix, residual, z = rng.standard_normal((30, 3)), 4.0 * rng.standard_normal(30), rng.uniform(size=3)
    found = step_in_box(matrix.T @ matrix, matrix.T @ residual, z, 0.0)
    best = lsq_linear(matrix, -residual, bounds=(-z, 1.0 - z), tol=1e-12)
    cost = 0.5 * np.sum((matrix @ (found - z) + residual) ** 2)
    # one pass over the box can miss the best of its faces, never the box
    assert ((found >= 0.0) & (found <= 1.0)).all()
    assert cost <= 1.1 * best.cost + 1e-9


@pytest.mark.parametrize("rank", [1, 3, 5])
def test_the_part_along_columns_is_that_of_a_decomposition_whatever_their_rank(rank):
    rng = np.random.default_rng(rank)
    columns = rng.standard_normal((300, rank)) @ rng.standard_normal((rank, 5)) * np.logspace(-3, 3, 5)
    values = rng.standard_normal(300)
    basis, inverse = decomposed(columns)
    square, found = square_along(columns, values)
    assert found == rank == basis.shape[1]
    assert square == pytest.approx(float(np.sum((basis.T @ values) ** 2)), rel=1e-9)
    np.testing.assert_allclose(columns @ (inverse @ values), basis @ (basis.T @ values), atol=1e-8)
