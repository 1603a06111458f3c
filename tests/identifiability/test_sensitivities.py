"""Sensitivities against closed forms and against differences of another step."""

import numpy as np
import pytest

from armid.estimation.information import sensitivities
from armid.problem.replay import replays
from armid.problem.space import space_of
from armid.record import read_campaign

TRUTH = np.array([3.05e6, 1.0, 0.55, 1.4])


@pytest.fixture(scope="module")
def axis(write_axis, axis_model, tmp_path_factory):
    campaign = read_campaign(write_axis(tmp_path_factory.mktemp("sensitivity")))
    space = space_of(axis_model, bounds={"mass": (1.0, 4.0), "viscous.slope": (1.0, 10.0)})
    return replays(campaign.train, axis_model, space, "fine")[0], space


def closed_form(replay, mass, slope, drive=8.0):
    """Return d v/d mass and d v/d slope of v = F/c + (v0 - F/c) exp(-c t/m), (n_samples, 2)."""
    t, v0 = replay.times, replay.pieces[0].manoeuvre.constants["start_speed"]
    decay, away = np.exp(-slope * t / mass), v0 - drive / slope
    by_mass = away * decay * slope * t / mass**2
    by_slope = -drive / slope**2 * (1.0 - decay) - away * decay * t / mass
    return np.column_stack([by_mass, by_slope])


@pytest.mark.parametrize(("mass", "slope"), [(2.0, 5.0), (1.3, 9.0), (3.7, 1.5)])
def test_agree_with_the_closed_form_of_an_axis(axis, mass, slope):
    replay, space = axis
    expected = closed_form(replay, mass, slope) * (space.high - space.low)[space.free]
    found = sensitivities(replay, space, np.array([mass, slope]))
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.max(np.abs(expected)))


def test_at_a_bound_the_step_stays_inside(axis):
    replay, space = axis
    on_the_corner = sensitivities(replay, space, np.array([1.0, 10.0]))
    expected = closed_form(replay, 1.0, 10.0) * (space.high - space.low)[space.free]
    np.testing.assert_allclose(on_the_corner, expected, atol=2e-3 * np.max(np.abs(expected)))


@pytest.mark.parametrize("step", [1e-5, 1e-3])
def test_agree_with_differences_of_another_step(paper_arm, arm, arm_space, step):
    for replay in replays(paper_arm.train[2:], arm, arm_space):
        found = sensitivities(replay, arm_space, TRUTH)
        moves = np.diag(step * (arm_space.high - arm_space.low))
        signal = replay.signal(np.concatenate([TRUTH + moves, TRUTH - moves]))
        other = (signal[:4] - signal[4:]).T / (2.0 * step)
        # around the switch E the curvature of a step of 1e-3 shows
        np.testing.assert_allclose(found, other, atol=(2e-3 if step < 1e-4 else 2e-2) * np.max(np.abs(other)))


def test_a_fixed_parameter_has_no_column(lowering_replays, arm_space):
    some = sensitivities(lowering_replays[0], arm_space.with_fixed("eta3", 0.55), TRUTH[[0, 1, 3]])
    whole = sensitivities(lowering_replays[0], arm_space, TRUTH)
    np.testing.assert_allclose(some, whole[:, [0, 1, 3]], rtol=1e-9, atol=1e-12)
