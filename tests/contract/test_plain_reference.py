"""The slow integrator by which contracts judge the engine is right itself."""

import numpy as np
import pytest

from arm_cases import REFERENCE, candidate_of, index_rows, manoeuvre_of
from armid.contract.trials import simulate_plainly
from armid.model import PLANTS, Effect, Guard, Manoeuvre, Model, Parameter, State

TIMES = 0.01 * np.arange(151)


@pytest.mark.parametrize("number", [0, 1, 6])
def test_agrees_with_reference_trajectories(number: int) -> None:
    row = index_rows()[number]
    expected = np.loadtxt(REFERENCE / row["file"], delimiter=",", skiprows=1)[:801:4, 2]
    found = simulate_plainly(Model(PLANTS["shell_transfer_arm"]), manoeuvre_of(row, 0.004, 201), candidate_of(row))[0]
    assert np.abs(found - expected).max() <= 2e-8


COASTING = Manoeuvre(0.01, 151, {"start_speed": 0.9}, {"u": np.zeros(151)})


def still(time):
    return 0.503 - time


def brake(on, level):
    return -level * on


def corner(v, level):
    return -level * np.maximum(v - 0.7, 0.0)


def at_corner(v):
    return v - 0.7


def nothing():
    return 0.0


def pace(v):
    return v


def test_switches_once_and_between_samples() -> None:
    late = Effect("late", (Parameter("level", "effort", 0, 9, null=0.0),), {"torque": brake},
                  guards=(Guard("on", still, latch=True),))  # fmt: skip
    found = simulate_plainly(Model(PLANTS["driven_axis"]) + late, COASTING, np.array([3.0, 6.0]))[0]
    np.testing.assert_allclose(found, 0.9 - 2.0 * np.maximum(TIMES - 0.503, 0.0), atol=1e-9)


def test_lands_on_kinks_and_carries_added_states() -> None:
    """Above 0.7 the speed falls exponentially to it and never arrives."""
    bent = Effect("bent", (Parameter("level", "effort", 0, 9, null=0.0),), {"torque": corner},
                  (State("way", "m", pace, nothing),), (Guard("edge", at_corner),))  # fmt: skip
    found = simulate_plainly(Model(PLANTS["driven_axis"]) + bent, COASTING, np.array([3.0, 6.0]))[0]
    np.testing.assert_allclose(found, 0.7 + 0.2 * np.exp(-2.0 * TIMES), atol=1e-9)
