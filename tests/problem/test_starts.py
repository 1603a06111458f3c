"""The start of a record is a state that its outputs show: a sensor that is off shows another one."""

import numpy as np
import pytest

from armid import identify
from armid.inference.kinds.faults import Fault
from armid.model import EFFECTS, Model
from armid.record import read_campaign
from synthetic import write_records
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


def test_without_its_offset_a_record_starts_elsewhere(campaign):
    (record,) = campaign.train
    (sound,) = Fault("offset").undone(record, OFFSET, winch).pieces
    (halved,) = Fault("gain").undone(record, 1.0, winch).pieces
    assert record.pieces[0].shown_start["start_speed"] == pytest.approx(OFFSET, abs=0.1)
    assert sound.shown_start["start_speed"] == pytest.approx(0.0, abs=0.1)
    assert halved.shown_start["start_speed"] == pytest.approx(OFFSET / 2, abs=0.1)
