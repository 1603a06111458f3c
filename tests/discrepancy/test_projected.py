"""What stands behind a score: geometry that the score itself does not use."""

import numpy as np
import pytest

from armid.loop import close_loop
from armid.loop.score_test import projected, rest_of
from armid.model import EFFECTS, Model
from armid.record import read_campaign

NAMES = ("coulomb", "quadratic_drag", "viscous")


@pytest.fixture(scope="module")
def closed(write_axis, tmp_path_factory):
    """An axis whose viscous friction is not declared, told with a little noise."""
    times = np.arange(401) / 200.0
    noise = 1e-3 * np.random.default_rng(1).standard_normal(401)
    speed = 8.0 / 5.0 * (1.0 - np.exp(-5.0 * times / 2.0)) + noise
    bounds = "[parameters.mass]\nlow = 1\nhigh = 4\n"
    campaign = read_campaign(write_axis(tmp_path_factory.mktemp("axis"), speed, bounds))
    return close_loop(Model(campaign.plant), campaign, {n: EFFECTS[n] for n in NAMES})


@pytest.mark.parametrize("name", NAMES)
def test_the_drop_is_what_the_change_takes_off_the_residual(closed, name):
    current, rest = closed.before.fit, rest_of(closed.before.fit)
    behind = projected(current, name, closed.library)
    score = next(s for s in closed.search.trace(current) if s.name == name)
    assert rest @ rest - np.sum((rest - behind.change) ** 2) == pytest.approx(score.drop, rel=1e-9)
    assert score.drop <= behind.alignment**2 * (rest @ rest) * (1.0 + 1e-9)
    assert 0.0 < behind.share <= 1.0


@pytest.mark.parametrize("name", NAMES)
def test_the_change_is_none_that_the_parameters_could_make(closed, name):
    current = closed.before.fit
    change = projected(current, name, closed.library).change
    slopes = current.jacobian / np.linalg.norm(current.jacobian, axis=0)
    assert np.max(np.abs(slopes.T @ change)) < 1e-6 * np.linalg.norm(change)
