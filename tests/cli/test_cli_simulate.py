"""`armid simulate`."""

import re
import shutil
import warnings

import numpy as np
import pytest

from arm_cases import REFERENCE, index_rows
from armid.record import read_campaign

RECORD = """\
name = "reference"
plant = "shell_transfer_arm"
[[records]]
file = "{file}"
role = "train"
start_angle_deg = {start_angle_deg}
target_angle_deg = {target_angle_deg}
shell = {shell}
supply_V = {supply_V}
"""
HEADER = "time_s,angle_rad,angular_velocity_rad_s,current_A"
# Its own file is off by 6.8e-7 rad/s: three independent integrations agree with each other and not with it.
FINE = {"trajectory_05.csv": 1e-6}


def table(path):
    return path.read_text().split("\n", 1)[0], np.genfromtxt(path, delimiter=",", skip_header=1, unpack=True)


@pytest.mark.parametrize("row", index_rows(), ids=lambda row: row["file"])
def test_agrees_with_the_reference_trajectories(run, tmp_path, row):
    folder, file = tmp_path / "reference", row["file"]
    folder.mkdir()
    shutil.copy(REFERENCE / file, folder)
    toml = RECORD.format_map({**row, "shell": str(row["shell"] == "1").lower()})
    (folder / "campaign.toml").write_text(toml)
    values = {"p0": float(row["p0_MPa"]) * 1e6, **{name: row[name] for name in ("k", "eta3", "n")}}
    settings = [word for name, value in values.items() for word in ("--set", f"{name}={value}")]
    _, reference = table(folder / file)
    for accuracy, allowed in (("standard", 1e-5), ("auto", 2e-7)):
        ran = run("simulate", folder, *settings, "--accuracy", accuracy, "--out", tmp_path)
        assert (ran.code, ran.err) == (0, "")
        header, simulated = table(tmp_path / file)
        assert header == HEADER
        np.testing.assert_allclose(simulated[0], reference[0], atol=1e-12)
        near = max(allowed, FINE.get(file, 0.0))
        assert np.max(np.abs(simulated[1:3] - reference[1:3])) <= near
        assert np.max(np.abs(simulated[3] - reference[3])) <= 500.0 * near


def test_one_file_for_each_record_and_the_values_taken_or_missing(
    run, paper_arm, paper_arm_folder, tmp_path, refused, write_axis
):
    ran = run("simulate", paper_arm_folder / "campaign.toml", "--set", "n=1.3", "--out", tmp_path / "new" / "folder")
    assert ran.code == 0
    files = sorted(p.name for p in (tmp_path / "new" / "folder").iterdir())
    assert files == sorted(r.file for r in paper_arm.records)
    assert "p0 = 3050000 Pa\nk = 1\neta3 = 0.55\nn = 1.3\nwrote 7 files to" in ran.out
    _, (times, *_, current) = table(tmp_path / "new" / "folder" / "raise.csv")
    np.testing.assert_allclose(times, np.arange(1201) / 1000, atol=1e-12)
    assert current[0] == 0.0
    sentence = refused("simulate", write_axis(tmp_path / "axis"), "--out", tmp_path / "out")
    assert "parameter 'mass' has no nominal value: a value is expected (kg)" in sentence


def test_what_a_campaign_fixes_is_taken_unless_it_is_set_and_steps_that_are_too_long_are_told(
    run, paper_arm_folder, tmp_path
):
    folder = tmp_path / "campaign"
    shutil.copytree(paper_arm_folder, folder)
    with (folder / "campaign.toml").open("a") as toml:
        toml.write("[parameters.n]\nfixed = 1.2\n[parameters.k]\nfixed = 0.9\n")
    assert "k = 0.8\neta3 = 0.55\nn = 1.2\n" in run("simulate", folder, "--set", "k=0.8", "--out", tmp_path).out
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        ran = run("simulate", paper_arm_folder, "--set", "p0=1e12", "--out", tmp_path / "out")
    assert re.match(r"armid: warning: lower\.csv: the engine is off by up to \S+ rad/s even at its finest ", ran.err)
    assert "armid: warning: p0 = 1e+12 is far outside the declared range, 2.6e+06 to 3.5e+06 Pa" in ran.err


def test_an_axis_from_its_first_sample_shown_from_zero_on(run, write_axis, axis_speed, tmp_path):
    folder = write_axis(tmp_path / "axis", more="[parameters.mass]\nfixed = 2.0\n")
    early = folder / "move.csv"
    rows = early.read_text().split()
    shifted = [f"{float(row.split(',')[0]) - 0.5!r},{row.split(',', 1)[1]}" for row in rows[1:]]
    early.write_text("\n".join([rows[0], *shifted]) + "\n")
    ran = run("simulate", folder, "--effects", "viscous", "--set", "viscous.slope=5", "--out", tmp_path)
    assert ran.code == 0
    assert "viscous.slope = 5 N s/m\n" in ran.out
    header, (times, position, speed) = table(tmp_path / "move.csv")
    assert header == "time_s,position_m,velocity_m_s"
    np.testing.assert_allclose(times, np.arange(301) / 200, atol=1e-12)
    np.testing.assert_allclose(speed, axis_speed(times + 0.5), atol=3e-4)
    assert (np.diff(position) > 0).all()


def test_what_it_writes_is_a_campaign_s_record_and_it_overwrites_nothing(run, paper_arm_folder, tmp_path, refused):
    folder = tmp_path / "campaign"
    shutil.copytree(paper_arm_folder, folder)
    run("simulate", folder, "--out", tmp_path / "simulated")
    shutil.copytree(tmp_path / "simulated", folder, dirs_exist_ok=True)
    record = read_campaign(folder).records[0]
    assert record.is_noise_free
    assert list(record.columns) == ["angle_rad", "current_A"]
    before = (folder / "lower.csv").read_bytes()
    assert "is the folder of the campaign" in refused("simulate", folder, "--out", f"{folder}/../campaign")
    assert (folder / "lower.csv").read_bytes() == before
    (tmp_path / "out" / "lower.csv").mkdir(parents=True)
    assert "holds a folder lower.csv" in refused("simulate", paper_arm_folder, "--out", tmp_path / "out")
