"""Parameters from records of several outputs, one of them without the first output and in motion at its start."""

import numpy as np
import pytest
from two_inertias import NOISE_ANGLE, NOISE_SPEED, TRUTH, two_inertias, write_drive

from armid.errors import ArmidError
from armid.estimation.corrections import corrections
from armid.estimation.examine import examine
from armid.estimation.identify import identify
from armid.estimation.identify_document import details_of, result_of
from armid.identifiers import IDENTIFIERS
from armid.model import Model
from armid.problem.fitness import FITNESS, fitness_of_name
from armid.problem.problem import IdentificationProblem, replays, signals_of
from armid.problem.space import space_of
from armid.problem.starts import with_starts
from armid.record import read_campaign, write_table
from armid.record.table import read_table

WHOLE = np.array(list(TRUTH.values()))


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return read_campaign(write_drive(tmp_path_factory.mktemp("drive") / "c"), {"two_inertias": two_inertias})


@pytest.fixture(scope="module")
def ready(campaign):
    model = Model(campaign.plant)
    return replays(campaign.train, model, space_of(model))


def test_the_start_is_fitted_and_leaves_noise(ready):
    """Also the motor's state, which no output of the second record shows; outputs of a file share their simulation."""
    assert [r.name for r in ready] == ["a.csv, motor_speed", "a.csv, load_angle", "a.csv, deflection",
                                       "b.csv, load_angle"]  # fmt: skip
    assert ready[0].ready is ready[1].ready is ready[2].ready is not ready[3].ready
    for replay, signal in zip(ready, signals_of(ready, WHOLE[np.newaxis]), strict=True):
        np.testing.assert_array_equal(signal, replay.signal(WHOLE[np.newaxis]))
    started = with_starts(ready, WHOLE)
    for replay, noise in zip(started, (NOISE_SPEED, NOISE_ANGLE, NOISE_ANGLE, NOISE_ANGLE), strict=True):
        residual = replay.measured - replay.signal(WHOLE[np.newaxis])[0]
        assert np.sqrt(np.mean(residual**2)) == pytest.approx(noise, rel=0.1)
    found = started[3].pieces[0].manoeuvre.constants
    for name, truth in (("start_motor", 0.3), ("start_motor_speed", 2.0), ("start_load", 0.25)):
        assert found[name] == pytest.approx(truth, abs=0.03 if name != "start_motor_speed" else 0.3)
    runaway = WHOLE * [1.0, 1.0, -60.0, 1.0]
    assert not np.isfinite(ready[0].signal(runaway[np.newaxis])).all()
    for before, after in zip(ready, with_starts(ready, runaway), strict=True):
        assert after.pieces[0].correction is None
        assert after.pieces[0].manoeuvre.constants == before.pieces[0].manoeuvre.constants
    # about there another candidate gets a start of its own: as good as if it were fitted about that one
    other = WHOLE * [1.01, 0.995, 1.005, 1.05]
    near = started[3].measured - started[3].signal(other[np.newaxis])[0]
    own = with_starts(started, other)[3]
    assert np.linalg.norm(near) == pytest.approx(
        np.linalg.norm(own.measured - own.signal(other[np.newaxis])[0]), rel=0.01
    )


def test_samples_that_are_no_data_tell_nothing_of_the_start(tmp_path):
    folder = write_drive(tmp_path / "c")
    columns = dict(read_table(folder / "b.csv", "b.csv").columns)
    columns["load_angle_deg"][60:260] = columns["load_angle_deg"][60]
    write_table(folder / "b.csv", columns)
    toml = folder / "campaign.toml"
    toml.write_text(f"most_lost = 0.5\n{toml.read_text()}")
    read = read_campaign(folder, {"two_inertias": two_inertias})
    model = Model(read.plant)
    found = with_starts(replays(read.train, model, space_of(model)), WHOLE)[3]
    assert found.pieces[0].manoeuvre.constants["start_load"] == pytest.approx(0.25, abs=0.03)
    assert len(found.measured) == len(columns["load_angle_deg"]) - 200
    residual = (found.measured - found.signal(WHOLE[np.newaxis])[0])[60:]
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(NOISE_ANGLE, rel=0.1)


@pytest.mark.parametrize("fitness", ["rmse", "likelihood", "rmse:load_angle"])
def test_least_squares_finds_the_truth(campaign, fitness):
    model = Model(campaign.plant)
    identifier = IDENTIFIERS["least_squares"]
    found = identify(campaign, model, space_of(model), fitness_of_name(fitness, FITNESS), identifier, 3000)
    for name, half, value in zip(found.information.names, found.information.half_width, found.candidate, strict=True):
        assert abs(value - TRUTH[name]) < 2.0 * half < 0.4 * TRUTH[name] + 0.2 * (name == "damping")
    assert found.train.outputs["load_angle"].rmse == pytest.approx(NOISE_ANGLE, rel=0.1)
    result = result_of(found)
    assert result["unit"] == "rad/s"
    assert list(result["outputs"]) == ["motor_speed", "load_angle", "deflection"]
    error = result["error"]["holdout"]
    assert error["rmse"] == error["outputs"]["motor_speed"]["rmse"] > 0.0
    shares = [e["rmse"] / e["span"] for e in error["outputs"].values()]
    assert error["joint_nrmse"] == pytest.approx(np.sqrt(np.mean(np.square(shares))))
    assert list(result["error_by_record"]["b.csv"]["outputs"]) == ["load_angle"]
    assert result["error_by_record"]["b.csv"]["rmse"] is None
    assert len(details_of(found)["records"]) == 7


def test_a_fitness_names_an_output(ready):
    space = space_of(ready[0].model)
    alone = IdentificationProblem(space, ready, fitness_of_name("rmse:motor_speed", FITNESS))
    assert [r.name for r in alone.replays] == ["a.csv, motor_speed"]
    residual = ready[0].measured - ready[0].signal(WHOLE[np.newaxis])[0]
    assert alone.value(WHOLE)[0] == pytest.approx(np.sqrt(np.mean(residual**2)))
    # of several outputs each counts in units of its noise
    both = IdentificationProblem(space, ready[:2], FITNESS["rmse"])
    signals = [(r.measured - r.signal(WHOLE[np.newaxis])[0]) / r.record.noise.rms for r in ready[:2]]
    assert both.value(WHOLE)[0] == pytest.approx(np.sqrt(np.mean(np.square(signals))), rel=1e-6)
    with pytest.raises(ArmidError, match=r"no record holds the output 'load', .*load_angle"):
        IdentificationProblem(space, ready, fitness_of_name("rmse:load", FITNESS))
    with pytest.raises(ArmidError, match="fitness 'rms' is not known"):
        fitness_of_name("rms:load_angle", FITNESS)


def test_an_examination_holds_the_truth_and_what_two_signals_of_one_unit_may_be_mistaken_for(campaign):
    model = Model(campaign.plant)
    found = examine(campaign, model, space_of(model))
    inside = [p.low <= TRUTH[p.name] <= p.high for p in found.profiles]
    assert sum(inside) >= 3
    assert found.offers[0].gain > 1.0
    told = {c.kind: c.words for c in corrections(campaign.plant, campaign.train[0], 10)}
    assert "load_angle and deflection look exchanged" in told["exchanged"]
    assert "deflection looks counted from the ground" in told["absolute"]
