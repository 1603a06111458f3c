"""A clock that jumps: runs are neither lost nor stopped for it, and the results are the same."""

import os

from small_study import RUNS_A_SEED, same_results

from armid.study.results import load_study

# What a process has of the wall clock goes back by an hour at every look.
BACKWARD = """\
import itertools
import time

now, steps = time.time(), itertools.count(1)
time.time = lambda: now - 3600.0 * next(steps)
time.time_ns = lambda: int(time.time() * 1e9)
"""


def test_a_clock_that_runs_backward_changes_nothing(start, write_study, tmp_path, undisturbed):
    (tmp_path / "clock").mkdir()
    (tmp_path / "clock" / "sitecustomize.py").write_text(BACKWARD)
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "clock")}
    process = start(write_study(6), "--out", tmp_path / "out", "--jobs", 2, "--time-limit", 60, env=environment)
    out, err = process.communicate(timeout=600)
    assert (process.returncode, err) == (0, "")
    assert f"{6 * RUNS_A_SEED} of {6 * RUNS_A_SEED} are in" in out
    assert same_results(load_study(tmp_path / "out"), undisturbed)
