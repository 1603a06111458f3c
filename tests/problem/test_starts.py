"""The start of a record is a state that its outputs show: a sensor that is off shows another one."""

import numpy as np
import pytest

from armid import identify
from armid.inference.kinds.faults import Fault
from armid.model import EFFECTS, Model
from armid.problem.problem import replays, signals_of
from armid.problem.space import space_of
from armid.problem.starts import with_starts
from armid.record import read_campaign
from synthetic import moved, write_records
from winch import DRUM, FRICTION, INTERVAL, exact_speed, held_voltage, winch

NOISE, OFFSET = 0.12, 4.0


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Two records of a winch that begin at rest, one held out; the sensor shows a speed at rest."""
    rng, tables = np.random.default_rng(3), {}
    for name, seed in (("a.csv", 2), ("b.csv", 5)):
        u = held_voltage(np.random.default_rng(seed))
        speed = exact_speed(u, 0.0) + OFFSET + NOISE * rng.standard_normal(len(u))
        times = np.round(INTERVAL * np.arange(len(u)), 9)
        tables[name] = {"time_s": times, "angular_velocity_rad_s": speed, "volts_V": u}
    folder = tmp_path_factory.mktemp("off") / "campaign"
    return read_campaign(
        write_records(folder, 'name = "winch"\nplant = "winch"\n', tables, holdout=1), {"winch": winch}
    )


def test_a_sensor_that_is_off_starts_no_record_in_motion(campaign):
    model = Model(winch) + EFFECTS["viscous"] + EFFECTS["gyro_bias"]
    found = identify(campaign, model=model, identifier="least_squares", fitness="rmse")
    starts = [r.pieces[0].manoeuvre.constants["start_speed"] for r in found.replays]
    assert np.abs(starts).max() < 0.2
    assert found.holdout.rmse < 1.05 * NOISE
    for name, truth in (("drum", DRUM), ("viscous.slope", FRICTION), ("gyro_bias.bias", OFFSET)):
        assert found.parameters[name].low < truth < found.parameters[name].high


def test_a_candidate_whose_sensor_is_off_starts_where_that_sensor_shows_it(campaign):
    """The starts are those of a candidate without an offset, and far from the noise hold every other one there."""
    model = Model(winch) + EFFECTS["viscous"] + EFFECTS["gyro_bias"]
    values = {"drum": 0.8 * DRUM, "viscous.slope": FRICTION, "gyro_bias.bias": 0.0}
    wrong = np.array([values[name] for name in model.parameters])
    right = np.array([(values | {"drum": DRUM, "gyro_bias.bias": OFFSET})[name] for name in model.parameters])
    (replay,) = with_starts(replays(campaign.train, model, space_of(model)), wrong)
    (signal,) = signals_of([replay], right[np.newaxis])
    assert np.sqrt(np.mean((replay.measured - signal) ** 2)) < 1.3 * NOISE


def test_without_its_offset_a_record_starts_elsewhere(campaign):
    (record,) = campaign.train
    (sound,) = Fault("offset").undone(record, OFFSET, winch).pieces
    (halved,) = Fault("gain").undone(record, 1.0, winch).pieces
    assert record.pieces[0].shown_start["start_speed"] == pytest.approx(OFFSET, abs=0.1)
    assert sound.shown_start["start_speed"] == pytest.approx(0.0, abs=0.1)
    assert halved.shown_start["start_speed"] == pytest.approx(OFFSET / 2, abs=0.1)


def test_a_record_that_is_held_out_starts_where_its_first_samples_and_the_model_say(tmp_path):
    """A swinging arm that speeds up from its first sample on: a curve through its samples takes another speed."""
    rng, step, tables, begin = np.random.default_rng(9), 0.01, {}, (0.5, 0.3)
    times = step * np.arange(600)
    for name in ("a.csv", "b.csv"):
        drive = 0.3 * np.sin(4.0 * times + rng.uniform(0.0, 6.0)) + 0.4
        way = moved(lambda x, u: np.array([x[1], (u - 0.6 * np.sin(x[0]) - 0.08 * x[1]) / 0.05]), drive, step, begin,
                    "zero", 4)  # fmt: skip
        tables[name] = {"time_s": times, "drive_N_m": drive, "angle_rad": np.round(way[:, 0] / 0.01) * 0.01}
    head = 'name = "arm"\nplant = "rotary_arm"\nhold = "zero"\n'
    read = read_campaign(write_records(tmp_path / "arm", head, tables, holdout=1))
    (held,) = read.holdout
    model = read.model()
    (started,) = with_starts(replays([held], model, space_of(model)), np.array([0.05, 0.6, 0.08, 1.0]))
    (before,), (after,) = held.pieces, started.pieces
    speeds = [piece.manoeuvre.constants["start_speed"] for piece in (before, after)]
    deviations = [piece.start_deviation["start_speed"] for piece in (before, after)]
    assert abs(speeds[1] - begin[1]) < min(0.3 * abs(speeds[0] - begin[1]), 3.0 * deviations[1])
    # the zero of the encoder is in doubt, too
    assert abs(after.manoeuvre.constants["start_angle"] - begin[0]) < 3.0 * after.start_deviation["start_angle"]
