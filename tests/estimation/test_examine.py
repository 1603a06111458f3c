"""Groups of parameters that move together, and a whole examination in numbers, words and figures."""

import json
from dataclasses import replace
from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np
import pytest

from armid.errors import ArmidError
from armid.estimation.examine import collinearity_index, examine, groups
from armid.estimation.identifiability_document import (
    answer_and_remarks,
    draw_profile,
    interval_text,
    offer_text,
    profile_text,
    remarks,
    result_of,
    smooth,
)
from armid.estimation.information import PROFILE_RISE, information_at
from armid.model import EFFECTS
from armid.problem.space import space_of
from changed_records import with_noise

TRUTH = np.array([3.05e6, 1.0, 0.55, 1.4])


@pytest.fixture(scope="module")
def one_stroke(lowering, arm, arm_space):
    """The lowering, cut at 0.7 s."""
    return examine(lowering, arm, arm_space)


def sentence(found, *words):
    """Return the one remark that holds all of some words."""
    told = [r for r in remarks(found) if all(w in r for w in words)]
    assert len(told) == 1, remarks(found)
    return told[0]


def test_at_the_estimate_it_is_the_information_there_and_what_moves_together_is_said(one_stroke, arm_space):
    expected = information_at(one_stroke.replays, arm_space, one_stroke.minimum)
    np.testing.assert_allclose(one_stroke.information.deviation, expected.deviation, rtol=1e-6)
    np.testing.assert_array_equal(one_stroke.x, one_stroke.minimum)
    assert np.abs(expected.step).max() < 0.05
    assert [p.name for p in one_stroke.profiles] == ["p0", "k", "eta3", "n"]
    assert not one_stroke.at_bound.any()
    remark = sentence(one_stroke, "p0, eta3 and n move together")
    assert "+0.42 % of n together with" in remark
    # p0 less and n more balance the arm alike
    assert "-0.14 % of p0" in remark


@pytest.mark.slow
def test_an_effect_that_is_not_there_is_below_a_bound_and_its_profile_is_drawn(lowering, arm):
    model = arm + EFFECTS["coulomb"]
    with_friction = examine(lowering, model, space_of(model))
    profile = with_friction.profiles[4]
    remark = sentence(with_friction, "coulomb.level may be null")
    assert "it is below" in remark
    profile = with_friction.profiles[4]
    assert profile.bounded == (False, True)
    assert profile_text(result_of(with_friction)["parameters"]["coulomb.level"]["profile"], 1.0).startswith("box 0")
    assert with_friction.at_bound[4]
    # the bound holds the friction, so that the parabola, which knows no bound, promises too little
    assert "believe the profile" in sentence(with_friction, "p0: the profile says")

    figure, axis = plt.subplots()
    draw_profile(axis, profile)
    drawn = {line.get_label(): line for line in axis.lines}
    assert set(drawn) == {"by curvature", "profile", "fitted again", "95 % threshold", "bound of the box", "estimate"}
    assert drawn["95 % threshold"].get_ydata()[0] == PROFILE_RISE
    parabola = drawn["by curvature"]
    expected = ((parabola.get_xdata() - profile.estimate) / profile.deviation) ** 2
    np.testing.assert_allclose(parabola.get_ydata(), expected)
    left, right = axis.get_xlim()
    assert left <= profile.low < profile.high <= right
    plt.close(figure)
    values, rise = smooth(profile, 1e-6)
    np.testing.assert_allclose(np.interp(1e-6 * profile.values, values, rise), profile.rise, atol=0.02)
    assert interval_text(1.39814, 1.40181) == "1.39814 to 1.40181"
    assert interval_text(100.0, 4000.0) == "100 to 4000"


def test_a_point_that_is_given_and_a_holdout_that_has_no_say(lowering, arm, arm_space, one_stroke):
    point = TRUTH * [1.0, 0.98, 1.0, 1.0]
    found = examine(lowering, arm, arm_space, point)
    np.testing.assert_array_equal(found.x, point)
    np.testing.assert_allclose(found.minimum, one_stroke.minimum, rtol=1e-5)
    assert "k is" in sentence(found, "The point that was given is not the least-squares minimum")
    near = examine(lowering, arm, arm_space, one_stroke.minimum)
    assert not [r for r in remarks(near) if "point that was given" in r]
    with pytest.raises(ArmidError, match=r"k is 2, a value from 0\.6 to 1\.1 is expected"):
        examine(lowering, arm, arm_space, np.array([3.05e6, 2.0, 0.55, 1.4]))
    train, holdout = lowering.records
    garbage = holdout.with_measured({holdout.output: -7.0 * holdout.measured})
    again = examine(replace(lowering, records=(train, garbage)), arm, arm_space)
    assert json.dumps(result_of(again)) == json.dumps(result_of(one_stroke))


def test_what_the_records_hold_beyond_noise_leads_the_answer(one_stroke):
    level = one_stroke.information.levels[0]
    more = replace(level, rms=6.0 * one_stroke.replays[0].record.noise.rms, from_residual=True)
    information = replace(one_stroke.information, levels=(more,))
    lacking = replace(one_stroke, information=information, wider=2.0 * information.deviation)
    answer, _ = answer_and_remarks(result_of(lacking))
    assert answer[0].startswith("The model lacks something or a constant is off: the residual is 6 times the noise in ")
    assert answer[1].startswith("Bounded on both sides, with the standard deviation: p0 (")
    assert answer[1].count(" with the tolerances") == 4
    assert not any("lacks something" in text for text in answer_and_remarks(result_of(one_stroke))[0])


@pytest.mark.parametrize(("told", "said"), [
    ({"by": "volumes"}, "ranked by 'volumes': did you mean 'volume'"), ({"noise": 0.0}, "the noise is 0: a finite"),
    ({"noise": np.nan}, "the noise is nan"),
    ({"x": np.array([1.0, 2.0])}, r"the point has the shape \(2,\): one value for each of p0, k"),
])  # fmt: skip
def test_what_cannot_be_examined_is_one_sentence(lowering, arm, arm_space, told, said):
    with pytest.raises(ArmidError, match=said):
        examine(lowering, arm, arm_space, **told)
    with pytest.raises(ArmidError, match="no parameter is free"):
        examine(lowering, arm, space_of(arm, fixed=dict(zip(arm_space.names, TRUTH, strict=True))))


def test_without_noise_one_is_assumed_and_said(one_stroke, lowering, arm, arm_space):
    (clean,) = (r.signal(TRUTH[np.newaxis])[0] for r in one_stroke.replays)

    (train,) = lowering.train
    other = with_noise(train, rms=0.0).with_measured({train.output: np.append(clean, train.measured[clean.size :])})
    silent = replace(lowering, records=(other,))
    found = examine(silent, arm, arm_space)
    (level,) = found.information.levels
    assert level.assumed
    assert level.rms == pytest.approx(1e-3 * np.sqrt(np.mean(clean**2)), rel=1e-6)
    assert "ASSUMED" in sentence(found, "lower.csv")
    np.testing.assert_allclose(found.x, TRUTH, rtol=1e-5)
    assert all(p.bounded == (True, True) for p in found.profiles)
    # groups do not depend on the noise; intervals are in proportion to it
    assert [g.names for g in found.groups] == [g.names for g in one_stroke.groups]
    louder = examine(silent, arm, arm_space, noise=10.0 * level.rms)
    np.testing.assert_allclose(louder.information.deviation, 10.0 * found.information.deviation, rtol=1e-4)


def test_what_is_not_seen_is_said(paper_arm, arm, arm_space):
    found = examine(replace(paper_arm, records=paper_arm.train[:1]).with_window(0.0, 0.3), arm, arm_space)
    assert sentence(found, "k is not seen at all")
    assert sentence(found, "k is bounded on neither side")
    assert found.offers[0].best == 1
    assert ": k from not determined to" in offer_text(found, found.offers[0])
    assert np.isinf(found.offers[0].before[1])
    json.dumps(result_of(found), allow_nan=False)


def fisher_of(*columns):
    design = np.column_stack(columns)
    return design.T @ design


def test_groups_and_their_index_of_two_of_three_of_two_groups_and_of_nothing():
    a, b, c, d, e, f = np.linalg.qr(np.random.default_rng(1).normal(size=(40, 6)))[0].T
    assert collinearity_index(fisher_of(a, b)) == pytest.approx(1.0)
    for cosine in (0.5, 0.99, -0.999):
        tilted = 7.0 * (cosine * a + np.sqrt(1 - cosine**2) * b)
        assert collinearity_index(fisher_of(a, tilted)) == pytest.approx(1 / np.sqrt(1 - abs(cosine)), rel=1e-6)
    fisher = fisher_of(a, 3.0 * d, b, 5.0 * (a + b) + 0.05 * c)
    (group,) = groups(fisher, ("p", "q", "r", "s"))
    assert group.names == ("p", "r", "s")
    # s = 5 p + 5 r, so that moving s by -1/5 undoes a move of p and r
    np.testing.assert_allclose(group.direction / group.direction[0], [1.0, 1.0, -0.2], rtol=1e-3)
    assert all(collinearity_index(fisher[np.ix_(p, p)]) < 10.0 for p in combinations(range(4), 2))
    fisher = fisher_of(a, b, a + 0.02 * c, d, b + 0.05 * e, f)
    found = groups(fisher, tuple("uvwxyz"))
    assert [g.names for g in found] == [("u", "w"), ("v", "y")]
    assert found[0].index > found[1].index > 10.0
    assert groups(fisher_of(a, b), ("p", "q")) == ()
    assert groups(fisher_of(a), ("p",)) == ()
    assert groups(np.zeros((2, 2)), ("p", "q")) == ()
    assert groups(fisher_of(a, 0.0 * b, a + 0.01 * b), ("p", "q", "r"))[0].names == ("p", "r")
