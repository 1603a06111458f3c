"""What `simulate` takes, refuses and returns."""

import numpy as np
import pytest
from arm_cases import drawn

from armid.engine import Schedule, simulate
from armid.errors import ArmidError
from armid.model import PLANTS, Manoeuvre, Model


def test_shapes(arm: Model) -> None:
    found = simulate(arm, Manoeuvre(0.001, 60), drawn(arm, 11, 1), states=True)
    assert found.output.shape == (11, 60)
    assert found.failed.shape == found.switch_times["closed"].shape == (11,)
    assert {s.shape for s in found.states.values()} == {(11, 60)}


def test_states_come_only_when_asked_for(arm: Model) -> None:
    assert simulate(arm, Manoeuvre(0.001, 60), drawn(arm, 1, 1)).states == {}


def test_the_recorded_signal_is_a_state_here(arm: Model) -> None:
    found = simulate(arm, Manoeuvre(0.001, 60), drawn(arm, 9, 1), states=True)
    assert np.array_equal(found.output, found.states["omega"])


def test_one_candidate_may_come_as_a_vector(arm: Model) -> None:
    candidate = drawn(arm, 1, 2)
    one, row = (simulate(arm, Manoeuvre(0.001, 60), c).output for c in (candidate[0], candidate))
    assert np.array_equal(one, row)


def test_no_candidates_give_no_rows(arm: Model) -> None:
    found = simulate(arm, Manoeuvre(0.001, 60), np.empty((0, 4)))
    assert found.output.shape == (0, 60)
    assert found.failed.shape == (0,)


def test_a_single_sample_is_the_start(arm: Model) -> None:
    found = simulate(arm, Manoeuvre(0.001, 1), drawn(arm, 3, 1))
    assert np.array_equal(found.output, np.zeros((3, 1)))


def test_more_samples_do_not_change_the_first(arm: Model) -> None:
    population = drawn(arm, 5, 3)
    short, long = (simulate(arm, Manoeuvre(0.001, n), population).output for n in (300, 900))
    assert np.array_equal(short, long[:, :300])


def test_a_plan_of_another_length_is_cut(arm: Model) -> None:
    population, plan = drawn(arm, 5, 3), np.full(899, 4)
    short, long = (simulate(arm, Manoeuvre(0.001, n), population, Schedule(plan=plan)).output for n in (301, 900))
    assert np.array_equal(short, long[:, :301])


def test_the_arm_parks_when_the_switch_is_never_reached(arm: Model) -> None:
    """A supply too weak to lift: no switch, and no time of one."""
    weak = Manoeuvre(0.001, 200, {"U": 1.0, "theta_C": 0.3, "theta_D": -0.8})
    assert np.isnan(simulate(arm, weak, drawn(arm, 3, 1)).switch_times["closed"]).all()


def test_a_population_of_another_width_is_refused(arm: Model) -> None:
    with pytest.raises(ArmidError, match=r"shape \(2, 3\) was given: \(n_candidates, 4\) is expected for p0, k, eta3"):
        simulate(arm, Manoeuvre(0.001, 60), np.ones((2, 3)))


def test_an_unknown_constant_is_refused(arm: Model) -> None:
    with pytest.raises(ArmidError, match="constant 'theta_E' is not one of plant 'shell_transfer_arm': did you mean"):
        simulate(arm, Manoeuvre(0.001, 60, {"theta_E": 0.1}), drawn(arm, 1, 1))


def test_a_missing_input_is_refused() -> None:
    with pytest.raises(ArmidError, match="the manoeuvre lacks the input 'u' of plant 'driven_axis'"):
        simulate(Model(PLANTS["driven_axis"]), Manoeuvre(0.001, 60), [[1.0]])


def test_an_input_of_another_length_is_refused() -> None:
    with pytest.raises(ArmidError, match=r"input 'u' has shape \(59,\): \(60,\) is expected"):
        simulate(Model(PLANTS["driven_axis"]), Manoeuvre(0.001, 60, inputs={"u": np.ones(59)}), [[1.0]])
