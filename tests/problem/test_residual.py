"""The residual vector: a sum of squares that is the fitness, counted as any evaluation."""

import numpy as np
import pytest
from pymoo.core.evaluator import Evaluator
from pymoo.core.population import Population

from armid.errors import ArmidError
from armid.problem.fitness import FITNESS
from armid.problem.meter import RESIDUALS, Meter
from armid.problem.problem import IdentificationProblem, replays, residuals

ASKED = ["F", "G", "H", RESIDUALS]


@pytest.fixture(scope="module")
def several(paper_arm, arm, arm_space):
    records = [paper_arm.with_window(0.0, end).train[i] for i, end in ((0, 0.3), (3, 0.5))]
    return replays(records, arm, arm_space)


@pytest.fixture(scope="module", name="X")
def candidates(arm_space):
    return np.random.default_rng(1).uniform(arm_space.low, arm_space.high, (5, 4))


def test_is_the_weighted_difference_end_to_end(several, arm_space, X):
    vectors = residuals(several, arm_space, X, [2.0, 0.5])
    assert vectors.shape == (5, 301 + 501)
    np.testing.assert_array_equal(vectors[:, :301], 2.0 * (several[0].signal(X) - several[0].measured))
    np.testing.assert_array_equal(vectors[:, 301:], 0.5 * (several[1].signal(X) - several[1].measured))
    np.testing.assert_array_equal(residuals(several, arm_space, X[0], [2.0, 0.5]), vectors[:1])
    fixed = arm_space.with_fixed("k", X[0, 1])
    np.testing.assert_array_equal(residuals(several, fixed, X[0, [0, 2, 3]], [2.0, 0.5]), vectors[:1])


@pytest.mark.parametrize("name", FITNESS)
def test_its_sum_of_squares_is_the_fitness(several, arm_space, X, name):
    fitness = FITNESS[name]
    problem = IdentificationProblem(arm_space, several, fitness)
    if fitness.weigh is None:
        with pytest.raises(ArmidError, match=f"'{name}' is not a sum of squares, least squares expects rmse or like"):
            problem.evaluated(X, True)
        return
    values, vectors = problem.evaluated(X, True)
    total = (vectors**2).sum(axis=1)
    expected = {"rmse": np.sqrt(total / vectors.shape[1]), "likelihood": total}[name]
    np.testing.assert_allclose(values, expected, rtol=1e-12)
    np.testing.assert_array_equal(values, problem.value(X))


def test_pymoo_s_evaluator_gets_it_when_it_asks(several, arm_space, X):
    meter = Meter(3)
    problem = IdentificationProblem(arm_space, several, FITNESS["rmse"], meter)
    pop = Evaluator(evaluate_values_of=ASKED).eval(problem, Population.new(X=X))
    vectors = pop.get(RESIDUALS)
    assert meter.used == 3
    np.testing.assert_array_equal(vectors[:3], residuals(several, arm_space, X[:3], [1.0, 1.0]))
    assert np.isnan(vectors[3:].astype(float)).all()
    plain = Evaluator().eval(IdentificationProblem(arm_space, several, FITNESS["rmse"]), Population.new(X=X))
    assert RESIDUALS not in plain[0].data
    np.testing.assert_array_equal(plain.get("F")[:3], pop.get("F")[:3])
