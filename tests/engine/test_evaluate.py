"""Quantities along a simulated motion are those of an independent evaluation of the same equations."""

import numpy as np
import pytest

from armid.contract.trials import PlainModel
from armid.engine import Schedule, along, simulate
from armid.errors import ArmidError
from armid.model import Manoeuvre

TRUTH = np.array([3.05e6, 1.0, 0.55, 1.4])


def test_quantities_and_latches_agree_with_one_moment_at_a_time(arm):
    manoeuvre = Manoeuvre(0.001, 800)
    names = ["demand", "voltage", "back_emf", "balance_torque", "torque", "total_inertia"]
    found = along(arm, manoeuvre, TRUTH, Schedule(4), [*names, *arm.states])
    run = simulate(arm, manoeuvre, TRUTH[np.newaxis], Schedule(4), states=True)
    closed = run.switch_times["closed"][0]
    assert np.array_equal(found["omega"], run.states["omega"][0])
    plain = PlainModel(arm, manoeuvre, TRUTH)
    for i in (0, 100, 500, 577, 579, 799):
        states = np.array([found[s][i] for s in arm.states])
        moment = plain.moment(0.001 * i, states, (float(0.001 * i >= closed),))
        assert np.allclose(plain.evaluate(names, moment), [found[n][i] for n in names], rtol=1e-12)
    assert 0.5 < closed < 0.7


def test_an_unknown_name_is_refused_with_the_nearest(arm):
    with pytest.raises(ArmidError, match=r"'curent' is not a name of plant 'shell_transfer_arm'.*current"):
        along(arm, Manoeuvre(0.001, 50), TRUTH, Schedule(), ["curent"])
