"""What the reader owes a plant that someone else wrote, and what it does not assume in silence."""

from dataclasses import replace

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.model import Constant, Input
from armid.model.plants.driven_axis import driven_axis
from armid.record import read_campaign

SERVO = replace(
    driven_axis, name="servo", variants=(), scales_from_records=False,
    constants=(Constant("gain", 1.0, "N/V"), Constant("kp", 5.0, "V/m"), Constant("start_position", 0.0, "m"),
               Constant("start_speed", 0.0, "m/s")),
    quantities={**driven_axis.quantities, "gravity_effort": lambda q, kp: -kp * q},
    inputs=(Input("u", "V", ("drive_V",)), Input("fan", "1", ("fan",), required=False, default=1.0, hold="zero")),
)  # fmt: skip
TOML = 'name = "a"\nplant = "servo"\n[[records]]\nfile = "move.csv"\nrole = "train"\n'


def read(folder):
    return read_campaign(folder, plants={"servo": SERVO})


def test_its_scales_stay(write, axis_columns):
    assert read(write(TOML, move=axis_columns)).plant.scales == SERVO.scales


def test_an_optional_input_has_its_default(write, axis_columns):
    manoeuvre = read(write(TOML, move=axis_columns)).records[0].manoeuvre
    np.testing.assert_array_equal(manoeuvre.inputs["fan"], 1.0)
    off = {**axis_columns, "fan": np.zeros(5501)}
    np.testing.assert_array_equal(read(write(TOML, move=off)).records[0].manoeuvre.inputs["fan"], 0.0)


def test_constants_of_a_record(write, axis_columns):
    toml = TOML + '[records.constants]\nkp = 7.0\n[[records]]\nfile = "again.csv"\nrole = "holdout"\n'
    records = read(write(toml, move=axis_columns, again=axis_columns)).records
    assert [r.constants.get("kp") for r in records] == [7.0, None]
    assert records[0].pieces[0].manoeuvre.constants["kp"] == 7.0


def test_a_start_position_needs_a_column(write, axis_columns):
    columns = {name: values for name, values in axis_columns.items() if name != "position_m"}
    with pytest.raises(ArmidError, match=r"campaign/move\.csv, line 1: .*'servo' declares it: a column position_m"):
        read(write(TOML, move=columns))


def test_irregular_times_keep_switch_and_force_apart(write, axis_columns):
    rng = np.random.default_rng(5)
    times = axis_columns["time_s"] + np.append(0.0, rng.uniform(-2e-4, 2e-4, 5500))
    fan = np.where(np.arange(5501) < 3000, 1.0, 0.0)
    with pytest.warns(match="campaign/move.csv: irregular sampling"):
        record = read(write(TOML, move={**axis_columns, "time_s": times, "fan": fan})).records[0]
    held, drive = (record.manoeuvre.inputs[name] for name in ("fan", "u"))
    assert np.sum((held > 0) & (held < 1)) <= 1
    # the file pairs the drive of the even time with the uneven one
    np.testing.assert_allclose(drive, np.interp(record.times, times, axis_columns["drive_V"]), atol=1e-12)


@pytest.mark.parametrize("noise", [1e-3, 0.05])
def test_noise_of_irregular_samples(write, axis_columns, noise):
    """What moves between uneven samples is no noise."""
    rng = np.random.default_rng(6)
    times = 0.005 * np.arange(1000) + np.append(0.0, rng.uniform(-1e-3, 1e-3, 999))
    speed = 3.0 * np.sin(9.0 * times) + rng.normal(0.0, noise, 1000)
    columns = {"time_s": times, "velocity_m_s": speed, "drive_V": speed, "position_m": times}
    with pytest.warns(match="irregular sampling"):
        record = read(write(TOML, move=columns)).records[0]
    assert record.noise.rms == pytest.approx(noise, rel=0.15)
