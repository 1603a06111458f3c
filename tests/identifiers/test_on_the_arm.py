"""Identifiers on the arm: records of an independent integrator, without noise."""

import numpy as np
import pytest
from pymoo.optimize import minimize
from searches import identifier

from armid.estimation.identify import identify
from armid.model import Model
from armid.problem.fitness import FITNESS
from armid.problem.meter import Meter, MeterTermination
from armid.problem.problem import IdentificationProblem, replays
from armid.problem.space import space_of
from armid.record import Campaign, read_campaign

# The paper's Table I.
ROWS = {
    "row 1": (3.2e6, 1.0, 0.62, 1.0), "row 2": (3.1e6, 0.95, 0.60, 1.1), "row 3": (3.0e6, 0.90, 0.58, 1.2),
    "row 4": (2.9e6, 0.85, 0.55, 1.3), "row 5": (2.8e6, 0.80, 0.50, 1.4),
}  # fmt: skip
CLEAN = ("--noise-deg-s", "0", "--quantisation-deg-s", "0", "--repeats", "1", "--manoeuvres", "lower", "--holdout", "",
         "--duration", "0.7")  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("truth", ROWS.values(), ids=ROWS)
@pytest.mark.parametrize("name", ["least_squares", "pso+least_squares"])
def test_all_four_within_a_millionth_of_the_truth(stand, arm: Model, truth: tuple[float, ...], name: str) -> None:
    told = [word for name, value in zip(("p0", "k", "eta3", "n"), truth) for word in (f"--{name}", repr(value))]
    campaign = read_campaign(stand(*CLEAN, *told))
    space = space_of(arm)
    ready = replays(campaign.train, arm, space)
    for seed in range(1, 11):
        meter = Meter(3000)
        problem = IdentificationProblem(space, ready, FITNESS["rmse"], meter)
        minimize(problem, identifier(name).build(3000), MeterTermination(meter), seed=seed, copy_algorithm=False)
        assert np.abs(meter.best_x / truth - 1.0).max() < 1e-6
        assert meter.used < 3000


def test_one_run_from_a_chain(lowering: Campaign, arm: Model, arm_space) -> None:
    found = identify(lowering, arm, arm_space, FITNESS["likelihood"], identifier("pso+least_squares"), 400, seed=3)
    assert found.identifier == "pso+least_squares"
    assert 200 < found.used < 400
    assert found.stopped == "pso+least_squares stopped by itself"
    alone = identify(lowering, arm, arm_space, FITNESS["likelihood"], identifier("least_squares"), 400, seed=4)
    assert alone.used < 100
    assert found.value == pytest.approx(alone.value, rel=1e-9)
    np.testing.assert_allclose(found.candidate, alone.candidate, rtol=1e-5)
