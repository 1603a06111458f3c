"""Whatever ends a runner or a worker: no finished run is lost, none is there twice, and the rest is made as if nothing
had been."""

import os
import random
import re
import signal
import sqlite3
import time
from contextlib import closing, suppress

import pytest
from small_study import RUNS_A_SEED, beside_cost, n_kept, same_results, wait_for

from armid.study.results import load_study
from armid.study.runner import run_study
from armid.study.store import FILE_NAME

SEEDS = 6
N_RUNS = SEEDS * RUNS_A_SEED
# What a process has of the environment but for the measure of coverage: who is killed tells none.
UNMEASURED = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE")}


def kept(out):
    """Run -> everything that the store holds of it."""
    if not n_kept(out):
        return {}
    with closing(sqlite3.connect(f"file:{out / FILE_NAME}?mode=ro", uri=True)) as connection:
        rows = connection.execute("SELECT r.*, t.trace FROM runs r JOIN traces t USING (run)").fetchall()
        return {row[0]: row for row in rows}


def ended_well(process):
    """Return what a runner prints that ends without an error."""
    out, err = process.communicate(timeout=600)
    assert (process.returncode, beside_cost(err)) == (0, "")
    return out


@pytest.mark.nightly
def test_a_runner_killed_again_and_again(start, write_study, tmp_path, undisturbed):
    """After many kills nearly every run is finished, and none hits a runner at work."""
    file, out, rng, cut = write_study(SEEDS), tmp_path / "out", random.Random(2), 0
    for _ in range(3):
        before = kept(out)
        process = start(file, "--out", out, "--jobs", rng.choice((1, 2)), env=UNMEASURED)
        if rng.random() < 0.8:
            wait_for(process, out, len(before))
            # a store can be read while it is written
            assert len(before) <= len(load_study(out).runs) <= N_RUNS
            time.sleep(rng.uniform(0.0, 0.05))
        else:
            time.sleep(rng.uniform(0.0, 1.0))
        process.kill()
        cut += process.wait() == -signal.SIGKILL
        after = kept(out)
        assert {run: after[run] for run in before} == before
    assert cut >= 2
    assert f"{N_RUNS} of {N_RUNS} are in" in ended_well(start(file, "--out", out, "--jobs", 2))
    assert same_results(load_study(out), undisturbed)


def stat_of(pid):
    """Fields of /proc/PID/stat behind the name of the program, none where the process is not there."""
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii", errors="replace") as file:
            return file.read().rpartition(")")[2].split()
    except OSError:
        return []


def children_of(pid):
    return [int(entry) for entry in filter(str.isdigit, os.listdir("/proc")) if stat_of(entry)[1:2] == [str(pid)]]


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="looks for processes in /proc")
@pytest.mark.slow
def test_workers_may_be_killed_and_end_with_their_runner(start, write_study, tmp_path, undisturbed):
    process = start(write_study(SEEDS), "--out", tmp_path / "out", "--jobs", 2)
    wait_for(process, tmp_path / "out", 2)
    os.kill(children_of(process.pid)[0], signal.SIGKILL)
    wait_for(process, tmp_path / "out", n_kept(tmp_path / "out") + 2)
    workers = children_of(process.pid)
    process.kill()
    process.wait()
    end = time.monotonic() + 120.0
    while any(stat_of(worker)[:1] not in ([], ["Z"], ["X"]) for worker in workers):
        assert time.monotonic() < end, "workers outlive their runner"
        time.sleep(0.05)
    # two processes give what one gives, also after this
    assert same_results(run_study(write_study(SEEDS), jobs=2, out=tmp_path / "out"), undisturbed)


@pytest.mark.nightly
@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="looks for processes in /proc")
def test_an_interrupt_of_the_workers_cuts_no_run(start, write_study, tmp_path, undisturbed):
    """As a service manager sends it to every process, and the runner not among them."""
    process = start(write_study(SEEDS), "--out", tmp_path / "out", "--jobs", 2)
    wait_for(process, tmp_path / "out", 1)
    sent = 0
    while process.poll() is None:
        for worker in children_of(process.pid):
            with suppress(ProcessLookupError):
                os.kill(worker, signal.SIGINT)
                sent += 1
        time.sleep(0.005)
    ended_well(process)
    assert sent > 20
    assert same_results(load_study(tmp_path / "out"), undisturbed)


@pytest.mark.slow
def test_ctrl_c_keeps_what_is_finished_and_says_how_to_go_on(start, write_study, tmp_path):
    process = start(write_study(60), "--out", tmp_path / "out", "--jobs", 2)
    wait_for(process, tmp_path / "out", 3)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=600)
    assert (process.returncode, beside_cost(err)) == (130, "")
    assert "interrupted: every finished run is kept, the same command goes on" in out
    n = int(re.search(r"(\d+) of 960 are in", out)[1])
    assert n == len(load_study(tmp_path / "out").runs) > 3
    assert [p.name for p in (tmp_path / "out").iterdir()] == [FILE_NAME]
