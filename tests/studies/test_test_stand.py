"""The campaigns of the test stand: format, reproducibility, independence and refusals."""

import shlex
import tomllib
from pathlib import Path

import numpy as np
import pytest

from commands import python
from stand import RefusalError
from stand.command import main
from stand.effects import read_effects

ROOT = Path(__file__).parents[2]
STAND = ROOT / "studies"
CAMPAIGNS = STAND / "campaigns"
QUICK = ["--manoeuvres", "short,empty", "--repeats", "2", "--duration", "0.2"]


def told(folder):
    return tomllib.loads((folder / "campaign.toml").read_text())


def speeds(file):
    return np.loadtxt(file, delimiter=",", skiprows=1)


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stand") / "quick"
    assert main([str(folder), *QUICK, "--seed", "3", "--window-s", "0", "0.15", "--effect", "coulomb=30"]) == 0
    return folder


def test_plotting_is_imported_only_to_plot():
    code = "import sys, stand.command; sys.exit('matplotlib' in sys.modules or 'armid' in sys.modules)"
    assert python("-c", code, cwd=STAND).returncode == 0


def test_a_campaign_is_written_in_the_fixed_format(quick):
    assert {each.name for each in quick.iterdir()} == {
        "campaign.toml", "README.md", "short.csv", "short_2.csv", "empty.csv"
    }  # fmt: skip
    manoeuvre = {"start_angle_deg": -48.0, "shell": True, "supply_V": 28.0, "window_s": [0.0, 0.15]}
    first = {"file": "short.csv", "role": "train", "target_angle_deg": -8.0, **manoeuvre}
    last = {"file": "empty.csv", "role": "holdout", **manoeuvre, "target_angle_deg": 22.0, "shell": False}
    again = first | {"file": "short_2.csv", "repeat_of": "short.csv"}
    heading = {"name": "quick", "plant": "shell_transfer_arm", "gyro_range_deg_s": 200}
    known = {"truth": {"p0": 3.05e6, "k": 1.0, "eta3": 0.55, "n": 1.4}, "tolerances": {"default": 0.0}}
    assert told(quick) == {**heading, **known, "records": [first, again, last]}
    assert (quick / "short.csv").read_text().startswith("time_s,angular_velocity_deg_s\n-0.100,")
    assert speeds(quick / "short.csv").shape == (301, 2)


def test_a_campaign_says_synthetic_and_the_command_that_makes_it_again(quick, tmp_path, monkeypatch):
    heading = (quick / "campaign.toml").read_text().split("\nname")[0]
    for words in ("SYNTHETIC", "p0 = 3050000 Pa", "coulomb = 30", "0.25 deg/s rms, white", "default_rng: 3"):
        assert words in heading
        assert words in (quick / "README.md").read_text()
    assert str(quick.parent) not in heading
    monkeypatch.chdir(tmp_path)
    line = (quick / "campaign.toml").read_text().splitlines()[1].removeprefix("# Made by: ")
    assert main(shlex.split(line)[2:]) == 0
    for file in quick.iterdir():
        assert (tmp_path / "quick" / file.name).read_text() == file.read_text()


def test_a_manoeuvre_can_be_written_out(tmp_path):
    options = ["--repeats", "1", "--duration", "0.05", "--holdout", "short"]
    assert main([str(tmp_path / "c"), "--manoeuvres", "up=20:-30.5:empty:24,short", *options]) == 0
    record = told(tmp_path / "c")["records"][0]
    assert (record["start_angle_deg"], record["target_angle_deg"], record["supply_V"]) == (20.0, -30.5, 24.0)
    assert (record["file"], record["role"], record["shell"]) == ("up.csv", "train", False)


REFUSED = [
    ([], "required: OUT_FOLDER"),
    (["out", "--p0", "much"], "invalid float"),
    (["out", "--eta3", "1.2"], "cannot exceed 1"),
    (["out", "--p0", "9e6"], "leave the travel"),
    (["out", "--manoeuvres", "jump"], "no manoeuvre 'jump'"),
    (["out", "--manoeuvres", "a=1:2"], "must read NAME="),
    (["out", "--manoeuvres", "a=1:80:shell:28"], "outside the travel"),
    (["out", "--manoeuvres", "a/b=1:2:shell:28"], "must be letters"),
    (["out", "--manoeuvres", "lower,lower"], "each of them once"),
    (["out", "--holdout", "lower,raise,short,empty"], "nothing to train on"),
    (["out", "--window-s", "0.5", "0.2"], "window must rise"),
    (["out", "--figure", "sub/a.png"], "mere file name"),
    (["out", "--name", "a b"], "--name"),
    (["file"], "is a file"),
    (["file/out"], "cannot be"),
    (["full"], "not empty"),
    (["full", "--force"], "holds no campaign.toml"),
]
EFFECTS_REFUSED = [
    (["cool=1"], "no effect 'cool'"),
    (["coulomb=40", "coulomb=30"], "twice"),
    (["viscous=nan"], "finite"),
    (["rocking_damping=0.1"], "nothing without rocking_hz"),
]


def test_refuses_with_one_sentence_and_writes_nothing_also_effects_that_mean_nothing(refuses):
    for words, sentence in REFUSED:
        refuses(main, words, sentence)
    for words, sentence in EFFECTS_REFUSED:
        with pytest.raises(RefusalError, match=sentence):
            read_effects(words)


def test_force_replaces_a_campaign_whole(tmp_path):
    folder = tmp_path / "c"
    assert main([str(folder), *QUICK]) == 0
    assert main([str(folder), *QUICK]) == 2
    assert main([str(folder), "--manoeuvres", "raise", "--repeats", "1", "--duration", "0.05", "--force"]) == 0
    assert {each.name for each in folder.iterdir()} == {"campaign.toml", "README.md", "raise.csv"}
    assert [each.name for each in tmp_path.iterdir()] == ["c"]


# By how much a value may differ: one step of the gyro, or the solver's last digits.
STORIES = {"paper_arm": 0.1 + 1e-9, "one_stroke": 2e-4, "four_strokes": 2e-4, "rocking_shell": 2e-4}


@pytest.mark.parametrize("name", [n if n == "paper_arm" else pytest.param(n, marks=pytest.mark.slow) for n in STORIES])
def test_a_committed_campaign_can_be_made_again(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    there, again = CAMPAIGNS / name, tmp_path / "studies" / "campaigns" / name
    line = next(line for line in (there / "README.md").read_text().splitlines() if line.startswith("python "))
    assert main(shlex.split(line)[2:-1]) == 0
    assert {file.name for file in again.iterdir()} == {file.name for file in there.iterdir()}
    for file in there.iterdir():
        if file.suffix == ".csv":
            assert np.abs(speeds(again / file.name) - speeds(file)).max() < STORIES[name]
        elif file.suffix == ".png":
            assert (again / file.name).read_bytes().startswith(b"\x89PNG")
        else:
            assert (again / file.name).read_text() == file.read_text()


def test_committed_campaigns_are_small_and_share_a_record():
    for name in STORIES:
        assert sum(file.stat().st_size for file in (CAMPAIGNS / name).iterdir()) < 500_000
    one, four = ((CAMPAIGNS / name / "lower.csv").read_bytes() for name in ("one_stroke", "four_strokes"))
    assert one == four
