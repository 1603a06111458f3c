"""A fast axis with few samples a second and no rest: differences of its motion tell of the motion, not of the noise."""

import numpy as np
import pytest

from armid.estimation.information import start_changes
from armid.inference import prepared
from armid.inference.checks import holdout_residuals
from armid.inference.model import unless_diverged
from armid.inference.whitening import WhiteRecords, whitened
from armid.model import EFFECTS, Model
from armid.problem.problem import replays
from armid.problem.space import space_of
from armid.record import read_campaign, write_campaign

pytestmark = pytest.mark.slow
MASS, NOISE, STEP_S, N = 2.0, 0.02, 0.05, 200
RECORD = '[[records]]\nfile = "{file}"\nrole = "{role}"\n'


@pytest.fixture(scope="module")
def fast(tmp_path_factory):
    """A campaign of three records whose force changes with each sample, so that the speed is known in closed form."""
    rng, tables = np.random.default_rng(4), {}
    for file in ("a.csv", "b.csv", "c.csv"):
        force = rng.normal(0.0, 20.0, N)
        speed = np.append(0.0, np.cumsum(force[:-1]) * STEP_S / MASS)
        tables[file] = {"time_s": STEP_S * np.arange(N), "velocity_m_s": speed + NOISE * rng.standard_normal(N),
                        "drive_N": force}  # fmt: skip
    entries = [RECORD.format(file=f, role="holdout" if f == "c.csv" else "train") for f in tables]
    text = 'name = "fast"\nplant = "driven_axis"\nhold = "zero"\n' + "".join(entries)
    return read_campaign(write_campaign(tmp_path_factory.mktemp("fast"), text, tables))


@pytest.fixture(scope="module")
def fitted(fast):
    return prepared(Model(fast.plant), fast, {"viscous": EFFECTS["viscous"]})


def test_noise_without_a_rest_is_that_of_what_the_declared_model_leaves(fast, fitted):
    library, declared = fitted
    assert min(r.noise.rms for r in fast.train) > 5.0 * NOISE
    assert [level.known for level in library.data.levels] == [False, False]
    for level in library.data.levels:
        assert level.rms == pytest.approx(NOISE, rel=0.2)
    assert declared.chi2 / len(declared.residual) == pytest.approx(1.0, abs=0.3)
    assert declared.values["mass"] == pytest.approx(MASS, rel=0.01)
    unseen = holdout_residuals(declared, fast.holdout, library)
    assert [level.rms for level in unseen.data.levels] == [library.data.levels[0].rms]


def test_an_estimate_does_not_count_where_every_candidate_near_it_diverges(fitted):
    _, declared = fitted
    assert unless_diverged(lambda: declared) is declared
    alone = type(declared)(declared.active, declared.records, declared.z, declared.residual)
    alone.__dict__["jacobian"] = np.zeros_like(declared.jacobian)
    assert unless_diverged(lambda: alone) is None


@pytest.mark.parametrize(("start", "least", "most"), [(np.pi, 0.2, 2.0), (0.0, 0.0, 0.01)])
def test_the_doubt_of_a_start_bends_where_the_motion_does(tmp_path, start, least, most):
    """Near its upper rest a pendulum falls to either side; where it hangs it swings in proportion."""
    times, rng = 0.01 * np.arange(100), np.random.default_rng(2)
    table = {"time_s": times, "angle_rad": start + 0.01 * rng.standard_normal(100), "drive_N_m": 0.0 * times,
             "angular_velocity_rad_s": 0.1 + 0.2 * rng.standard_normal(100)}  # fmt: skip
    text = 'name = "p"\nplant = "driven_axis"\n[constants]\ngain = 1.0\ngravity_moment = 0.5\n'
    text += "".join(RECORD.format(file=f, role=role) for f, role in (("p.csv", "train"), ("q.csv", "holdout")))
    campaign = read_campaign(write_campaign(tmp_path / "p", text, {"p.csv": table, "q.csv": table}))
    model = Model(campaign.plant)
    space = space_of(model, {}, {"inertia": (0.01, 0.03)})
    records = WhiteRecords(replays(campaign.holdout, model, space), space, whitened(campaign.holdout, campaign.plant))
    slope, bend = np.array(list(start_changes(records, np.array([0.5]), bent=True)))[:2]
    assert next(start_changes(records, np.array([0.5]))) == pytest.approx(slope)
    assert least <= np.linalg.norm(bend) / np.linalg.norm(slope) <= most
