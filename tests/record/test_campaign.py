"""What a campaign that can be used reads as, and how one is written."""

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.model import EFFECTS, PLANTS, Effect, Parameter
from armid.problem.space import space_of
from armid.record import Override, read_campaign, write_campaign
from armid.record.table import read_table
from synthetic import write_records

DEGREE = np.pi / 180
ARM = """\
name = "c00"
plant = "shell_transfer_arm"
effects = ["coulomb"]
gyro_range_deg_s = 200
{top}
[constants]
K_p = 250.0
R = 0.5

[[records]]
file = "lower.csv"
role = "train"
start_angle_deg = -48.0
target_angle_deg = 22.0
shell = true
supply_V = 28.0
{lower}

[[records]]
file = "empty.csv"
role = "holdout"
start_angle_deg = -40
target_angle_deg = 18
shell = false
supply_V = 25
repeat_of = "lower.csv"
{empty}
"""


def arm(top="", lower="", empty=""):
    return ARM.format(top=top, lower=lower, empty=empty)


@pytest.fixture
def write_two(write, arm_columns):
    """Return a function that writes a campaign of two arm records."""
    return lambda **parts: write(arm(**parts), lower=arm_columns, empty=arm_columns)


def test_folder_and_file_read_alike_and_samples_before_zero_are_rest(write_two, arm_columns):
    folder = write_two()
    by_folder, by_file = read_campaign(folder), read_campaign(str(folder / "campaign.toml"))
    assert by_folder.name == by_file.name == "c00"
    assert by_folder.folder == by_file.folder == folder
    assert by_folder.plant is PLANTS["shell_transfer_arm"]
    assert by_folder.effects == ("coulomb",)
    assert by_folder.unit == "rad/s"
    assert by_folder.gyro_range == pytest.approx(200 * DEGREE)
    assert [r.file for r in by_folder.train] == ["lower.csv"]
    assert [r.file for r in by_folder.holdout] == ["empty.csv"]
    assert by_folder.holdout[0].repeat_of == "lower.csv"
    record = read_campaign(write_two()).train[0]
    speed = arm_columns["angular_velocity_deg_s"] * DEGREE
    np.testing.assert_array_equal(record.rest, speed[:100])
    np.testing.assert_array_equal(record.measured, speed[100:])
    assert record.manoeuvre.start_time == 0.0
    assert record.manoeuvre.interval == 0.001
    assert record.manoeuvre.n_samples == record.n_samples == 1201
    assert record.duration == pytest.approx(1.2)
    np.testing.assert_allclose(record.times, arm_columns["time_s"][100:], atol=1e-15)
    assert record.noise.source == "rest"
    assert record.noise.n_samples == 100
    assert record.noise.rms == pytest.approx(0.3 * DEGREE, rel=0.3)
    assert record.noise.mean == pytest.approx(np.mean(speed[:100]))
    assert len(record.pieces) == 1
    assert record.pieces[0].window == slice(0, 1201)


def test_constants_are_laid_over_each_other(write_two):
    campaign = read_campaign(write_two(empty="[records.constants]\nR = 0.6\nU = 24.0"))
    first, second = campaign.records
    assert first.constants["K_p"] == second.constants["K_p"] == 250.0
    assert (first.constants["R"], second.constants["R"]) == (0.5, 0.6)
    assert (first.constants["U"], second.constants["U"]) == (28.0, 24.0)
    assert (first.constants["shell"], second.constants["shell"]) == (1.0, 0.0)
    assert second.constants["theta_C"] == pytest.approx(-40 * DEGREE)
    assert first.pieces[0].manoeuvre.constants == first.constants
    hum = Effect("hum", (Parameter("size", "effort", 0.0, 0.1, null=0.0),), {"torque": lambda size: size})
    folder = write_two(top="[parameters.hum.size]\nhigh = 4.0")
    with pytest.raises(ArmidError, match=r"hum\.size"):
        read_campaign(folder)
    assert read_campaign(folder, effects={**EFFECTS, "hum": hum}).parameters["hum.size"].high == 4.0
    with pytest.raises(ArmidError, match="shell_transfer_arm"):
        read_campaign(folder, plants={"driven_axis": PLANTS["driven_axis"]})


@pytest.mark.parametrize("text", [
    "[parameters.p0]\nlow = 2.9e6\nhigh = 3.2e6\n[parameters.'coulomb.width']\nfixed = 0.01",
    "[parameters]\np0 = {low = 2.9e6, high = 3.2e6}\n[parameters.coulomb.width]\nfixed = 0.01",
    "[parameters.p0]\nlow = 2.9e6\nhigh = 3.2e6\n[parameters.coulomb]\nwidth = {fixed = 0.01}",
])  # fmt: skip
def test_parameters_by_either_spelling(write_two, text):
    campaign = read_campaign(write_two(top=text))
    assert campaign.parameters == {"p0": Override(low=2.9e6, high=3.2e6), "coulomb.width": Override(fixed=0.01)}


@pytest.mark.parametrize("encode", [
    lambda text: text.replace(b"\n", b"\n\n"),
    lambda text: text.replace(b"time_s,angular_velocity_deg_s", b'"time_s", "angular_velocity_deg_s"'),
    lambda text: text.replace(b",", b" , ")[:-1],
])  # fmt: skip
def test_spellings_of_csv(write, encode):
    folder = write()
    plain = read_campaign(folder).records[0].measured
    file = folder / "lower.csv"
    file.write_bytes(encode(file.read_bytes()))
    np.testing.assert_array_equal(read_campaign(folder).records[0].measured, plain)


TABLES = {"a.csv": {"time_s": np.arange(5) / 3, "velocity_m_s": np.array([0.1, 1e-300, -7.0, 1 / 3, 1e20])}}


def test_nothing_is_overwritten_or_half_written_and_numbers_read_back_to_the_bit(tmp_path):
    (tmp_path / "empty").mkdir()
    folder = write_campaign(tmp_path / "empty", "", TABLES)
    for there in (folder, folder / "a.csv"):
        with pytest.raises(ArmidError, match="exists already"):
            write_campaign(there, "", TABLES)
    with pytest.raises(ArmidError, match="cannot be written"):
        write_campaign(folder / "a.csv" / "below", "", TABLES)
    uneven = {"a.csv": {"time_s": np.arange(5), "velocity_m_s": np.arange(4)}}
    with pytest.raises(ValueError, match="shorter"):
        write_campaign(tmp_path / "out", "", uneven)
    assert list(tmp_path.iterdir()) == [folder]
    folder = write_campaign(tmp_path / "deep" / "out", "name = 'x'\n", TABLES)
    assert (folder / "campaign.toml").read_text() == "name = 'x'\n"
    columns = read_table(folder / "a.csv", "a.csv").columns
    assert list(columns) == ["time_s", "velocity_m_s"]
    for name, values in TABLES["a.csv"].items():
        np.testing.assert_array_equal(columns[name], values)
    assert [p.name for p in folder.parent.iterdir()] == ["out"]


def test_a_prior_frees_a_parameter_that_the_plant_fixes(tmp_path):
    times = np.arange(200) / 100.0
    table = {"time_s": times, "drive_N_m": np.sin(times), "angle_rad": 1.0 - np.cos(times)}
    tables = {"a.csv": table, "b.csv": table}
    toml = 'name = "x"\nplant = "rotary_arm"\n{}'
    read = read_campaign(write_records(tmp_path / "a", toml.format("[priors]\ngain = { mean = 0.4, sd = 0.02 }\n"),
                                       tables))  # fmt: skip
    assert "gain" in space_of(read.model(), read.parameters).free_names
    assert read.known["gain"].mean == 0.4
    fixed = "[parameters.gain]\nfixed = 0.4\n"
    known = read_campaign(write_records(tmp_path / "b", toml.format(fixed), tables))
    assert known.fixed_as_exact == ("gain",)
    exact = read_campaign(write_records(tmp_path / "c", toml.format(f"{fixed}[tolerances]\ngain = 0.0\n"), tables))
    assert exact.parameters["gain"].fixed == 0.4
    for more, said in (("[priors]\ngain = { mean = 0.4, sd = 0.02 }\n", "stands in priors and is fixed"),
                       ("[tolerances]\ngain = 0.05\n", "in place of 'fixed' is expected")):  # fmt: skip
        with pytest.raises(ArmidError, match=said):
            read_campaign(write_records(tmp_path / said[:5], toml.format(fixed + more), tables))
