"""Which parameters are searched, between which bounds."""

import numpy as np

from armid.model import EFFECTS
from armid.problem.space import space_of
from armid.record import Override


def test_a_fixed_parameter_of_an_effect_stays_unless_bounds_free_it(arm):
    model = arm + EFFECTS["coulomb"]
    assert space_of(model).free_names == ("p0", "k", "eta3", "n", "coulomb.level")
    freed = space_of(model, bounds={"coulomb.width": (0.001, 0.1)})
    assert freed.free_names == ("p0", "k", "eta3", "n", "coulomb.level", "coulomb.width")
    assert freed.units[-2:] == ("N m", "rad/s")


def test_what_the_caller_says_wins_over_the_campaign_and_that_over_the_declaration(arm):
    overrides = {"p0": Override(low=2.8e6), "k": Override(fixed=0.9), "n": Override(fixed=1.2, low=1.0, high=1.3),
                 "coulomb.level": Override(fixed=3.0)}  # fmt: skip
    space = space_of(arm, overrides, bounds={"k": (0.5, 0.7)}, fixed={"eta3": 0.6})
    assert space.free_names == ("p0", "k")
    np.testing.assert_array_equal(space.low[:2], [2.8e6, 0.5])
    np.testing.assert_array_equal(space.high[:2], [3.5e6, 0.7])
    np.testing.assert_array_equal(space.fixed, [np.nan, np.nan, 0.6, 1.2])


def test_bounds_and_fixed_values_by_name_leave_the_space_itself_alone(arm_space):
    changed = arm_space.with_bounds("n", 1.0, 1.2).with_fixed("p0", 3e6)
    assert changed.free_names == ("k", "eta3", "n")
    assert changed.with_bounds("p0", 2e6, 3e6).free_names == arm_space.names
    assert arm_space.high[3] == 1.5
    assert arm_space.free.all()


def test_complete_puts_the_fixed_values_in(arm_space):
    space = arm_space.with_fixed("k", 1.0)
    whole = space.complete(np.array([[3e6, 0.5, 1.4], [2.7e6, 0.6, 1.1]]))
    np.testing.assert_array_equal(whole, [[3e6, 1.0, 0.5, 1.4], [2.7e6, 1.0, 0.6, 1.1]])
