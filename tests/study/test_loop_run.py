"""The loop closed on a small blind suite: the key stays shut, a kill loses nothing, the score is right."""

import json
import os
import shutil
import signal
from pathlib import Path

import pandas as pd
import pytest
from loop_suite import STUDY, SUITE
from small_study import n_kept, wait_for

from armid.study.results import load_study
from armid.study.runner import run_study
from commands import ended, python

pytestmark = pytest.mark.nightly
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def suite(tmp_path_factory):
    """A folder with the study, three campaigns, and their key."""
    folder = tmp_path_factory.mktemp("blind")
    (folder / "suite.toml").write_text(SUITE, encoding="utf-8")
    (folder / "blind.toml").write_text(STUDY, encoding="utf-8")
    words = ["blind", folder / "suite", "--seed", "3", "--suite", folder / "suite.toml", "--processes", "1"]
    # a program that shares no code with the package
    assert python(ROOT / "studies" / "test_stand.py", *words).returncode == 0
    return folder


@pytest.fixture(scope="module")
def closed(suite):
    return run_study(suite / "blind.toml", jobs=1, out=suite / "out")


def test_every_report_is_kept_whole_and_the_score_of_store_and_exported_reports_is_right(closed, suite, tmp_path):
    assert (closed.study["n_planned"], closed.study["n_failed"]) == (3, 0)
    assert (closed.loops["cpu_seconds"] > 0.0).all()
    named = sorted(tuple(report["effects"]) for report in closed.loops["report"])
    assert named == [(), ("supply_sag",), ("supply_sag",)]
    for case, report in zip(closed.loops["case"], closed.loops["report"]):
        assert report["campaign"] == case
        assert set(report) >= {"verdict", "error", "parameters", "steps", "advice"}
    assert ended("export", "reports", suite / "out", tmp_path / "reports") == 0
    for results in (suite / "out", tmp_path / "reports"):
        words = ("--key", suite / "suite.key.json", "--out", tmp_path / "score")
        said = python(ROOT / "studies" / "blind" / "score.py", results, *words).stdout
        assert "Complete: 3 of 3 campaigns" in said
        assert ("closing one campaign, median" in said) == (results == suite / "out")
        assert set(pd.read_csv(tmp_path / "score" / "campaigns.csv")["judgement"]) == {"right"}


def test_a_kill_loses_nothing_and_the_loop_never_opens_the_key(start, closed, suite, tmp_path):
    """A pipe where the key should be blocks for ever who opens it."""
    without_key = shutil.copytree(suite, tmp_path / "copy", ignore=shutil.ignore_patterns("out", "suite.key.json"))
    os.mkfifo(without_key / "suite.key.json")
    out = without_key / "out"
    process = start(without_key / "blind.toml", "--out", out, "--jobs", 1)
    wait_for(process, out)
    process.kill()
    assert process.wait() == -signal.SIGKILL
    before = n_kept(out)
    ended = start(without_key / "blind.toml", "--out", out, "--jobs", 2)
    text, err = ended.communicate(timeout=600)
    assert (ended.returncode, err) == (0, "")
    assert f"{3 - before} runs made" in text
    assert "3 of 3 are in" in text
    kept, whole = (map(json.dumps, results.loops["report"]) for results in (load_study(out), closed))
    assert list(kept) == list(whole)
