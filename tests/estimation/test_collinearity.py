"""Groups of parameters that move together, from matrices whose answer is known."""

from itertools import combinations

import numpy as np
import pytest

from armid.estimation.examine import collinearity_index, groups
from armid.estimation.information import information_at
from armid.estimation.least_squares import estimate
from armid.problem.problem import replays


def fisher_of(*columns):
    design = np.column_stack(columns)
    return design.T @ design


@pytest.fixture
def basis():
    """Six orthonormal columns."""
    return np.linalg.qr(np.random.default_rng(1).normal(size=(40, 6)))[0].T


def test_the_index_of_two_is_that_of_their_angle(basis):
    a, b, *_ = basis
    assert collinearity_index(fisher_of(a, b)) == pytest.approx(1.0)
    for cosine in (0.5, 0.99, -0.999):
        tilted = 7.0 * (cosine * a + np.sqrt(1 - cosine**2) * b)
        assert collinearity_index(fisher_of(a, tilted)) == pytest.approx(1 / np.sqrt(1 - abs(cosine)), rel=1e-6)


def test_a_change_of_one_is_made_up_for_to_within_one_over_the_index(basis):
    """What the index says, done: of a direction of length 1, at least 1/index is left whatever the others do."""
    a, b, c, d, *_ = basis
    columns = np.column_stack([a, b, (a + b + 0.05 * c) / np.sqrt(2.0025), d])
    index = collinearity_index(columns.T @ columns)
    _, vectors = np.linalg.eigh(columns.T @ columns)
    assert np.linalg.norm(columns @ vectors[:, 0]) == pytest.approx(1 / index)
    assert index > 10.0


def test_three_that_only_together_are_collinear(basis):
    a, b, c, d, *_ = basis
    fisher = fisher_of(a, 3.0 * d, b, 5.0 * (a + b) + 0.05 * c)
    (group,) = groups(fisher, ("p", "q", "r", "s"))
    assert group.names == ("p", "r", "s")
    # s = 5 p + 5 r, so that moving s by -1/5 undoes a move of p and r
    np.testing.assert_allclose(group.direction / group.direction[0], [1.0, 1.0, -0.2], rtol=1e-3)
    assert all(collinearity_index(fisher[np.ix_(p, p)]) < 10.0 for p in combinations(range(4), 2))


def test_two_groups_and_what_is_alone(basis):
    a, b, c, d, e, f = basis
    fisher = fisher_of(a, b, a + 0.02 * c, d, b + 0.05 * e, f)
    found = groups(fisher, tuple("uvwxyz"))
    assert [g.names for g in found] == [("u", "w"), ("v", "y")]
    assert found[0].index > found[1].index > 10.0


def test_nothing_to_tell(basis):
    a, b, *_ = basis
    assert groups(fisher_of(a, b), ("p", "q")) == ()
    assert groups(fisher_of(a), ("p",)) == ()
    assert groups(np.zeros((2, 2)), ("p", "q")) == ()
    assert groups(fisher_of(a, 0.0 * b, a + 0.01 * b), ("p", "q", "r"))[0].names == ("p", "r")


def test_one_stroke_of_the_arm(lowering_replays, arm_space):
    x = estimate(lowering_replays, arm_space)
    (group,) = groups(information_at(lowering_replays, arm_space, x).fisher, arm_space.free_names)
    assert group.names == ("p0", "eta3", "n")


def test_several_manoeuvres_tell_them_apart(paper_arm, arm, arm_space):
    several = replays(paper_arm.train, arm, arm_space)
    x = estimate(several, arm_space)
    assert groups(information_at(several, arm_space, x).fisher, arm_space.free_names) == ()
