"""Whatever ends a runner: no finished run is lost, none is there twice, and the rest is made as if nothing had been."""

import os
import random
import re
import signal
import sqlite3
import time
from contextlib import closing

import pytest
from small_study import RUNS_A_SEED, same_results

from armid.study.results import load_study
from armid.study.store import FILE_NAME

SEEDS = 6


def kept(out):
    """Run -> everything that the store holds of it."""
    if not (out / FILE_NAME).exists():
        return {}
    try:
        with closing(sqlite3.connect(f"file:{out / FILE_NAME}?mode=ro", uri=True)) as connection:
            rows = connection.execute("SELECT r.*, t.trace FROM runs r JOIN traces t USING (run)").fetchall()
            return {row[0]: row for row in rows}
    except sqlite3.OperationalError:
        # the tables are not made yet
        return {}


def wait_for(process, out, more_than, seconds=600.0):
    """Wait until a store holds more runs, or the process has ended."""
    end = time.monotonic() + seconds
    while len(kept(out)) <= more_than and process.poll() is None:
        assert time.monotonic() < end
        time.sleep(0.01)


def killed_again_and_again(start, file, out, moments, rng):
    """Kill a runner at random moments, then let it end; return how often it was really killed in the middle."""
    cut = 0
    for _ in range(moments):
        before = kept(out)
        process = start(file, "--out", out, "--jobs", 2)
        if rng.random() < 0.8:
            wait_for(process, out, len(before))
            time.sleep(rng.uniform(0.0, 0.05))
        else:
            time.sleep(rng.uniform(0.0, 2.0))
        process.kill()
        cut += process.wait() == -signal.SIGKILL
        after = kept(out)
        assert {run: after[run] for run in before} == before
    ended = start(file, "--out", out, "--jobs", 2)
    out_text, err = ended.communicate(timeout=600)
    assert ended.returncode == 0, err
    assert f"{SEEDS * RUNS_A_SEED} of {SEEDS * RUNS_A_SEED} are in" in out_text
    return cut


def test_killed_at_random_moments(start, write_study, tmp_path, undisturbed):
    cut = killed_again_and_again(start, write_study(SEEDS), tmp_path / "out", 3, random.Random(1))
    assert cut == 3
    assert same_results(load_study(tmp_path / "out"), undisturbed)


@pytest.mark.slow
def test_killed_fifty_times(start, write_study, tmp_path, undisturbed):
    killed_again_and_again(start, write_study(SEEDS), tmp_path / "out", 50, random.Random(2))
    assert same_results(load_study(tmp_path / "out"), undisturbed)


def test_a_store_can_be_read_while_it_is_written_and_after_a_kill(start, write_study, tmp_path):
    process = start(write_study(50), "--out", tmp_path / "out", "--jobs", 1)
    wait_for(process, tmp_path / "out", 3)
    meanwhile = load_study(tmp_path / "out")
    assert 0 < len(meanwhile.runs) <= meanwhile.study["n_planned"] == 50 * RUNS_A_SEED
    process.kill()
    process.wait()
    assert len(load_study(tmp_path / "out").runs) >= len(meanwhile.runs)


def children_of(pid):
    """Processes whose parent is a process."""
    found = []
    for entry in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{entry}/stat", encoding="ascii", errors="replace") as file:
                if int(file.read().rpartition(")")[2].split()[1]) == pid:
                    found.append(int(entry))
        except (OSError, IndexError):
            continue
    return found


def is_alive(pid):
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii", errors="replace") as file:
            return file.read().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="looks for processes in /proc")
def test_workers_end_with_their_runner_and_may_be_killed(start, write_study, tmp_path, undisturbed):
    process = start(write_study(SEEDS), "--out", tmp_path / "out", "--jobs", 2)
    wait_for(process, tmp_path / "out", 2)
    os.kill(children_of(process.pid)[0], signal.SIGKILL)
    wait_for(process, tmp_path / "out", len(kept(tmp_path / "out")) + 2)
    workers = children_of(process.pid)
    process.kill()
    process.wait()
    end = time.monotonic() + 120.0
    while any(map(is_alive, workers)):
        assert time.monotonic() < end, "workers outlive their runner"
        time.sleep(0.05)
    ended = start(write_study(SEEDS), "--out", tmp_path / "out", "--jobs", 2)
    assert ended.wait() == 0
    assert same_results(load_study(tmp_path / "out"), undisturbed)


def test_ctrl_c_keeps_what_is_finished_and_says_how_to_go_on(start, write_study, tmp_path):
    process = start(write_study(500), "--out", tmp_path / "out", "--jobs", 2)
    wait_for(process, tmp_path / "out", 3)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=600)
    assert (process.returncode, err) == (130, "")
    assert "interrupted: every finished run is kept, the same command goes on" in out
    n = int(re.search(r"(\d+) of 8000 are in", out)[1])
    assert n == len(load_study(tmp_path / "out").runs) > 3
    assert [p.name for p in (tmp_path / "out").iterdir()] == [FILE_NAME]


def test_two_runners_share_the_work(start, write_study, tmp_path, undisturbed):
    file = write_study(SEEDS)
    both = [start(file, "--out", tmp_path / "out", "--jobs", 1) for _ in range(2)]
    made = []
    for process in both:
        out, err = process.communicate(timeout=600)
        assert (process.returncode, err) == (0, "")
        made.append(int(re.search(r"small: (\d+) runs made", out)[1]))
    assert sum(made) == SEEDS * RUNS_A_SEED
    assert same_results(load_study(tmp_path / "out"), undisturbed)
