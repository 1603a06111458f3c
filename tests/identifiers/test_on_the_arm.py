"""Identifiers on the arm: records of an independent integrator, without noise, and where they cannot work."""

import sys
from pathlib import Path

import numpy as np
import pytest
from pymoo.optimize import minimize
from searches import identifier

from armid.errors import ArmidError
from armid.estimation.identify import identify
from armid.model import Model
from armid.problem.fitness import FITNESS
from armid.problem.meter import Meter, MeterTermination
from armid.problem.problem import IdentificationProblem, replays
from armid.problem.space import space_of
from armid.record import Campaign, read_campaign, write_table
from input_texts import LOWERING

# The paper's Table I.
ROWS = {
    "row 1": (3.2e6, 1.0, 0.62, 1.0), "row 2": (3.1e6, 0.95, 0.60, 1.1), "row 3": (3.0e6, 0.90, 0.58, 1.2),
    "row 4": (2.9e6, 0.85, 0.55, 1.3), "row 5": (2.8e6, 0.80, 0.50, 1.4),
}  # fmt: skip
TOML = f'name = "row"\nplant = "shell_transfer_arm"\n{LOWERING}'


@pytest.fixture
def of_row(tmp_path: Path, root: Path, monkeypatch: pytest.MonkeyPatch):
    """Return a function that makes a campaign of one noise-free lowering of 0.7 s with the test stand's integrator."""
    monkeypatch.syspath_prepend(str(root / "studies"))
    known = set(sys.modules)

    def campaign(truth: tuple[float, ...]) -> Campaign:
        from stand.arm import KNOWN, Arm
        from stand.motion import Motion, simulate

        moved = simulate(Motion(Arm(*truth), KNOWN["lower"]), 0.7)
        (tmp_path / "campaign.toml").write_text(TOML)
        speed = np.rad2deg(moved.gyro)
        write_table(tmp_path / "lower.csv", {"time_s": moved.time_s, "angular_velocity_deg_s": speed})
        return read_campaign(tmp_path)

    yield campaign
    for name in set(sys.modules) - known:
        if name.split(".")[0] == "stand":
            del sys.modules[name]


@pytest.mark.slow
@pytest.mark.parametrize("truth", ROWS.values(), ids=ROWS)
@pytest.mark.parametrize("name", ["least_squares", "pso+least_squares"])
def test_all_four_within_a_millionth_of_the_truth(of_row, arm: Model, truth: tuple[float, ...], name: str) -> None:
    campaign = of_row(truth)
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


def test_what_cannot_work_is_refused_before_anything_is_simulated(lowering: Campaign, arm: Model, arm_space) -> None:
    for name, options, fitness, sentence in (
        ("least_squares", {}, "similarity", "'least_squares' needs residual vectors, fitness 'similarity' has none"),
        ("pso+least_squares", {}, "nrmse", "'pso.least_squares' needs residual vectors"),
        ("bobyqa", {"tol": 1}, "rmse", "'bobyqa' has no option 'tol'"),
    ):
        with pytest.raises(ArmidError, match=sentence):
            identify(lowering, arm, arm_space, FITNESS[fitness], identifier(name, **options), 100)
