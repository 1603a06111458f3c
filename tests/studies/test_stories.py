"""The committed campaigns with an undeclared effect: made again, small, and of one arm."""

import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stand.command import main

CAMPAIGNS = Path(__file__).parents[2] / "studies" / "campaigns"
STORIES = ("one_stroke", "four_strokes", "rocking_shell")


@pytest.mark.slow
@pytest.mark.parametrize("name", STORIES)
def test_a_story_can_be_made_again(name: str, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    there = CAMPAIGNS / name
    line = next(line for line in (there / "README.md").read_text().splitlines() if line.startswith("python "))
    assert main(shlex.split(line)[2:-1]) == 0
    again = tmp_path / "studies" / "campaigns" / name
    for file in there.iterdir():
        if file.suffix == ".csv":
            found, told = (np.loadtxt(each, delimiter=",", skiprows=1) for each in (again / file.name, file))
            assert np.abs(found - told).max() < 2e-4
        else:
            assert (again / file.name).read_text() == file.read_text()


@pytest.mark.parametrize("name", STORIES)
def test_a_story_is_small_and_says_its_truth(name: str) -> None:
    assert sum(file.stat().st_size for file in (CAMPAIGNS / name).iterdir()) < 500_000
    said = (CAMPAIGNS / name / "README.md").read_text()
    assert "SYNTHETIC" in said
    assert ("rocking_hz" if name == "rocking_shell" else "coulomb = 25") in said


def test_one_stroke_is_the_first_of_the_four() -> None:
    one, four = ((CAMPAIGNS / name / "lower.csv").read_bytes() for name in STORIES[:2])
    assert one == four
