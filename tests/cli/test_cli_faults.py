"""Folders that cannot be written and disks that are full: one sentence, and what was there stays as it was."""

import json
import os
import re
import subprocess
import sys

import pytest

from commands import remount

LOOP = ("--candidates", "viscous", "--threads", "1")


def commands(synthetic_axis, out):
    """Command and its words, each of which writes into a folder."""
    return {
        "identify": (synthetic_axis, "--identifier", "least_squares", "--fitness", "rmse", "--out", out),
        "close-loop": (synthetic_axis, *LOOP, "--out", out),
        "identifiability": (synthetic_axis, "--out", out),
        "simulate": (synthetic_axis, "--set", "inertia=0.05", "--out", out),
        "new": ("effect", "mine", "--out", out),
    }


WRITING = ("identify", "close-loop", "identifiability", "simulate", "new")


@pytest.mark.parametrize("command", WRITING)
def test_a_read_only_folder_is_refused_before_the_work(refused, synthetic_axis, disk, command):
    folder = disk("1m", read_only=True)
    sentence = refused(command, *commands(synthetic_axis, folder)[command])
    assert "Read-only file system" in sentence
    assert [p.name for p in folder.iterdir()] == ["kept"]


def test_a_page_for_a_read_only_folder(run, refused, synthetic_axis, disk):
    folder = disk("20m")
    assert run("identify", *commands(synthetic_axis, folder / "out")["identify"]).code == 0
    before = {p.name: p.read_bytes() for p in (folder / "out").iterdir()}
    remount(folder, "ro")
    assert "Read-only file system" in refused("report", folder / "out")
    assert {p.name: p.read_bytes() for p in (folder / "out").iterdir()} == before


@pytest.mark.parametrize("command", ["identify", "simulate", "new", pytest.param("close-loop", marks=pytest.mark.slow)])
def test_a_full_disk_leaves_nothing_half_written(run, synthetic_axis, disk, command, monkeypatch):
    folder = disk("40k")
    (folder / "kept").write_bytes(b"k" * (40_960 if command == "new" else 24_000))
    ran = run(command, *commands(synthetic_axis, folder)[command])
    assert ran.code == 2, ran
    assert ran.err.count("\n") == 1
    # a search is not begun; what needs none names the file for which no room was left
    expected = r"\w\.json: 0\.0 MB are left on its disk|\w\.\w+ cannot be used: No space left"
    assert re.search(expected, ran.err)
    monkeypatch.setattr("armid.report.result.LEAST_ROOM", 0)
    ran = run(command, *commands(synthetic_axis, folder)[command])
    assert re.search(r"\w+\.\w+ cannot be used: No space left on device", ran.err), ran
    # the fits of a loop are no half of its report: with them the same command goes on
    fits = ["progress.jsonl"] if command == "close-loop" else []
    assert sorted(p.name for p in folder.iterdir()) == ["kept", *fits]


@pytest.mark.slow
@pytest.mark.parametrize(("closed", "more", "code"), [
    ((1,), (), 0), ((2,), ("--quiet",), 0), ((0, 1, 2), ("--json",), 0), ((0, 1, 2), ("--budget", "x"), 2),
])  # fmt: skip
def test_streams_that_are_closed_hear_nothing_and_harm_nothing(synthetic_axis, tmp_path, closed, more, code):
    """No file that the command opens takes the number of a stream."""
    words = ("identify", synthetic_axis, "--budget", "80", "--identifier", "random", "--fitness", "rmse", "--out",
             tmp_path / "out")  # fmt: skip
    command = [sys.executable, "-m", "armid", *map(str, words), *more]
    shell = " ".join(["exec", '"$@"', *(f"{stream}>&-" for stream in closed)])
    ran = subprocess.run(["sh", "-c", shell, "sh", *command], capture_output=True, text=True, check=False)
    assert (ran.returncode, "Traceback" in ran.stderr) == (code, False), ran
    if code == 0:
        assert "report.html" in os.listdir(tmp_path / "out")
        assert json.loads((tmp_path / "out" / "result.json").read_text())["used"] == 80
