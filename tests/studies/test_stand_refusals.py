"""What the test stand refuses, and that a refusal leaves the disk as it was."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from stand.command import main
from stand.effects import read_effects
from stand.refusal import RefusalError

PROGRAM = Path(__file__).parents[2] / "studies" / "test_stand.py"
QUICK = ["--manoeuvres", "short,empty", "--repeats", "2", "--duration", "0.2"]


REFUSED: list[tuple[list[str], str]] = [
    ([], "required: OUT_FOLDER"),
    (["out", "--p0", "much"], "invalid float"),
    (["out", "--p0", "-1"], "p0 must be a positive number"),
    (["out", "--eta3", "1.2"], "cannot exceed 1"),
    (["out", "--n", "nan"], "n must be a positive number"),
    (["out", "--p0", "9e6"], "leave the travel"),
    (["out", "--manoeuvres", "jump"], "no manoeuvre 'jump'"),
    (["out", "--manoeuvres", "a=1:2"], "must read NAME="),
    (["out", "--manoeuvres", "a=1:x:shell:28"], "no number"),
    (["out", "--manoeuvres", "a=1:80:shell:28"], "outside the travel"),
    (["out", "--manoeuvres", "a=1:1:shell:28"], "starts at its target"),
    (["out", "--manoeuvres", "a=1:2:shell:0"], "positive voltage"),
    (["out", "--manoeuvres", "a/b=1:2:shell:28"], "must be letters"),
    (["out", "--manoeuvres", "lower,lower"], "each of them once"),
    (["out", "--manoeuvres", "lower,lower_2=0:9:shell:28"], "a repeat of lower needs"),
    (["out", "--holdout", "inside_E"], "none of the campaign's"),
    (["out", "--holdout", "lower,raise,short,empty"], "nothing to train on"),
    (["out", "--repeats", "0"], "repeats must be 1"),
    (["out", "--seed", "-1"], "seed must be 0"),
    (["out", "--duration", "0"], "between 0.01 and 10"),
    (["out", "--window-s", "0.5", "0.2"], "window must rise"),
    (["out", "--noise-deg-s", "-1"], "noise_deg_s must be"),
    (["out", "--effect", "cool=1"], "no effect"),
    (["out", "--figure", "sub/a.png"], "mere file name"),
    (["out", "--figure", "a.png", "--repeats", "1"], "--repeats must be 2"),
    (["out", "--name", "a b"], "--name"),
    (["out", "--colour", "red"], "unrecognized"),
    (["file"], "is a file"),
    (["file/out"], "cannot be"),
    (["full"], "not empty"),
    (["full", "--force"], "holds no campaign.toml"),
]
EFFECTS_REFUSED = [
    (["cool=1"], "no effect 'cool'"),
    (["coulomb"], "NAME=SIZE"),
    (["coulomb=40", "coulomb=30"], "twice"),
    (["coulomb=-1"], "negative"),
    (["viscous=nan"], "finite"),
    (["worm_loss=1"], "below 1.0"),
    (["coulomb=40", "coulomb_width=0"], "above 0"),
    (["rocking_damping=0.1"], "nothing without rocking_hz"),
]


def test_refuses_with_one_sentence_and_writes_nothing(
    tmp_path: Path, monkeypatch: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    for words, sentence in REFUSED:
        assert main(words) == 2, words
        said = capsys.readouterr()
        assert sentence in said.err
        assert (said.err.count("\n"), said.out) == (1, "")
        assert sorted(tmp_path.rglob("*")) == before


def test_refuses_effects_that_mean_nothing() -> None:
    for words, sentence in EFFECTS_REFUSED:
        with pytest.raises(RefusalError, match=sentence):
            read_effects(words)


def test_force_replaces_a_campaign_whole(tmp_path: Path) -> None:
    folder = tmp_path / "c"
    assert main([str(folder), *QUICK]) == 0
    assert main([str(folder), *QUICK]) == 2
    assert main([str(folder), "--manoeuvres", "raise", "--repeats", "1", "--duration", "0.05", "--force"]) == 0
    assert {each.name for each in folder.iterdir()} == {"campaign.toml", "README.md", "raise.csv"}
    assert [each.name for each in tmp_path.iterdir()] == ["c"]


def test_an_earlier_campaign_survives_a_disk_that_fails(tmp_path: Path, monkeypatch: Any) -> None:
    folder = tmp_path / "c"
    assert main([str(folder), *QUICK]) == 0
    before = {each.name: each.read_bytes() for each in folder.iterdir()}
    rename = Path.rename

    def fail_for_the_new(self: Path, target: Path) -> Path:
        if ".new-" in self.name:
            raise OSError("the disk is gone")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", fail_for_the_new)
    assert main([str(folder), *QUICK, "--seed", "9", "--force"]) == 2
    assert {each.name: each.read_bytes() for each in folder.iterdir()} == before
    assert [each.name for each in tmp_path.iterdir()] == ["c"]


def test_the_exit_code_of_the_program_is_2_when_it_refuses(tmp_path: Path) -> None:
    words = [sys.executable, str(PROGRAM), str(tmp_path / "c"), "--k", "0"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, "test_stand: k must be a positive number, not 0.0\n")
