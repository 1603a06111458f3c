"""The same results from a Dask cluster that loses a worker as from processes of our own."""

import os
import signal
import subprocess
import sys
import time

import pytest
from small_study import n_kept, same_results, wait_for

from armid.errors import ArmidError
from armid.study.results import load_study
from armid.study.runner import run_study

SEEDS = 6


@pytest.fixture
def cluster(tmp_path):
    """A scheduler and two workers in processes of their own: address, workers."""
    pytest.importorskip("distributed")
    file, started = tmp_path / "scheduler.json", []

    def dask(*words):
        command = [sys.executable, "-m", "dask", *words, "--scheduler-file", str(file)]
        with open(tmp_path / f"{len(started)}.log", "w", encoding="utf-8") as log:
            started.append(subprocess.Popen(command, stdout=log, stderr=log, cwd=tmp_path, start_new_session=True))

    dask("scheduler", "--port", "0", "--no-dashboard", "--host", "127.0.0.1")
    # the second is a child of Dask's nanny, in which multiprocessing starts no process
    for nanny in ("--no-nanny", "--nanny"):
        dask("worker", "--nthreads", "1", "--no-dashboard", nanny)
    end = time.monotonic() + 300.0
    while not file.exists():
        assert time.monotonic() < end, (tmp_path / "0.log").read_text()
        time.sleep(0.1)
    import json

    yield json.loads(file.read_text())["address"], started[1:]
    for process in started:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@pytest.mark.nightly
def test_a_dask_cluster_that_loses_a_worker(cluster, start, write_study, tmp_path, undisturbed):
    address, workers = cluster
    out = tmp_path / "out"
    process = start(write_study(SEEDS), "--out", out, "--dask", address)
    wait_for(process, out)
    assert 0 < n_kept(out) < len(undisturbed.runs), process.communicate()
    workers[0].kill()
    _, err = process.communicate(timeout=600)
    assert process.returncode == 0, err
    assert same_results(load_study(out), undisturbed)


def test_a_cluster_that_is_not_there_or_goes_while_runs_are_made(write_study, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("armid.study.pool.CONNECT_S", 0.5)
    with pytest.raises(ArmidError, match=r"the Dask cluster at tcp://127\.0\.0\.1:1 does not answer"):
        run_study(write_study(), dask="tcp://127.0.0.1:1", out=tmp_path / "out")
    monkeypatch.setattr("armid.study.pool._connected", lambda address: Gone())
    with pytest.raises(ArmidError, match="the Dask cluster at tcp://x:1 has gone: start again to go on"):
        run_study(write_study(), dask="tcp://x:1", out=tmp_path / "out")


class Gone:
    """A client whose scheduler has been killed."""

    status = "running"

    def nthreads(self):
        raise OSError("in <TCP (closed) ConnectionPool.ncores>: ConnectionResetError")

    def get_executor(self, pure):
        return self

    def shutdown(self, wait):
        raise OSError("closed")

    def close(self):
        pass
