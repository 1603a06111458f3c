"""Ctrl-C ends a search; what was found so far is judged, printed and written. A terminal sees a bar."""

import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from armid.estimation.identify import identify
from armid.identifiers import IDENTIFIERS
from armid.problem.fitness import FITNESS
from commands import python

pty = pytest.importorskip("pty")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "handler"), [(signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_IGN)]
)
def test_ctrl_c_and_a_request_to_end_lose_nothing(small_folder, tmp_path, number, handler):
    terminal, theirs = pty.openpty()
    command = [sys.executable, "-m", "armid", "identify", str(small_folder), "--budget", "100000000",
               "--window", "0:0.7", "--out", str(tmp_path / "out")]  # fmt: skip
    before = signal.signal(signal.SIGINT, handler)  # a child goes on ignoring what is ignored
    try:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs, text=True)
    finally:
        signal.signal(signal.SIGINT, before)
    with process:
        os.close(theirs)
        shown, end = b"", time.monotonic() + 60.0
        while b"best 0.0" not in shown:
            assert time.monotonic() < end, shown
            shown += os.read(terminal, 4096)
        process.send_signal(number)
        text, _ = process.communicate(timeout=60)
    os.close(terminal)
    assert b"/100000000 simulations" in shown
    assert process.returncode == 130
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["stopped"] == "interrupted"
    assert 0 < result["used"] < 100_000_000
    assert result["error"]["train"]["s"] > 0.9
    there = set(os.listdir(tmp_path / "out"))
    assert {"convergence.png", "fit.png", "result.json", "report.html"} <= there
    assert not any(name.startswith(".") for name in there)
    assert f"{result['used']} of 100000000 simulations used, interrupted; seed 1." in text


def pressed(*_, **__):
    raise KeyboardInterrupt


def pressed_in_compiled_code(*_, **__):
    raise SystemError("returned a result with an exception set") from KeyboardInterrupt()


@pytest.mark.parametrize("interrupted", [pressed, pressed_in_compiled_code])
def test_ctrl_c_before_the_first_candidate_is_only_an_end(run, small_folder, tmp_path, monkeypatch, interrupted):
    monkeypatch.setattr("armid.problem.problem.fitness_of", interrupted)
    ran = run("identify", small_folder, "--budget", "80", "--out", tmp_path / "out")
    assert (ran.code, ran.out, ran.err.strip()) == (130, "", "armid: interrupted")
    assert not (tmp_path / "out").exists()


def interrupted_after(times, presses=1):
    """Return what is told of progress: it presses Ctrl-C after so many generations."""
    left = [times]

    def press(_):
        left[0] -= 1
        if left[0] == 0:
            for _ in range(presses):
                signal.raise_signal(signal.SIGINT)

    return press


@pytest.fixture
def keyboard():
    """Ctrl-C as Python handles it by itself, whatever the runner of the tests made of it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


ASKED = """
import os, signal, sys

class Asking:
    def find_spec(self, name, *_):
        if name == "click":
            os.kill(os.getpid(), signal.SIGTERM)

sys.meta_path.insert(0, Asking())
sys.argv[1:] = ["list", "plants"]
import runpy
runpy.run_module("armid", run_name="__main__")
"""


# `python -m` takes an interrupt within the text of an `exec`, as of each dataclass, for its own end.
WITHIN = """
import armid.cli.main, os, signal, sys

class CutOff:
    def __init__(self):
        exec("os.kill(os.getpid(), signal.SIGINT)")
        self.file = None

    def __del__(self):
        self.file.close()

armid.cli.main.main = CutOff
from armid.__main__ import run
run()
"""


@pytest.mark.usefixtures("keyboard")
def test_an_interrupt_within_generated_code_is_one_and_a_request_to_end_in_the_first_moments(tmp_path):
    (tmp_path / "within.py").write_text(WITHIN)
    ran = python("-m", "within", cwd=tmp_path)
    assert (ran.returncode, ran.stdout, ran.stderr) == (130, "", "armid: interrupted\n")
    # While the command is being imported.
    ran = python("-c", ASKED)
    assert (ran.returncode, ran.stdout, ran.stderr) == (130, "", "armid: interrupted\n")


LATE = """
import os, signal, sys

sys.argv[1:] = ["list", "plants", "--quiet"]
from armid.__main__ import run
try:
    run()
finally:
    os.kill(os.getpid(), signal.SIG{})
"""


@pytest.mark.parametrize("word", ["INT", "TERM"])
def test_a_signal_after_the_work_changes_no_exit_code(word):
    ran = python("-c", LATE.format(word))
    assert (ran.returncode, ran.stderr) == (0, "")
    assert "driven_axis" in ran.stdout


@pytest.mark.usefixtures("keyboard")
@pytest.mark.parametrize("presses", [1, 2])
def test_an_interrupted_search_returns_its_best(lowering, arm, arm_space, presses):
    press = interrupted_after(3, presses)
    stopped = identify(lowering, arm, arm_space, FITNESS["rmse"], IDENTIFIERS["pso"], budget=8000, progress=press)
    assert stopped.stopped == "interrupted"
    assert stopped.used == 240
    assert stopped.value == stopped.train.rmse == stopped.trace[1][-1]
    assert stopped.holdout is not None
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_search_in_another_thread_leaves_signals_alone(lowering, arm, arm_space):
    with ThreadPoolExecutor(1) as pool:
        told = (lowering, arm, arm_space, FITNESS["rmse"], IDENTIFIERS["pso"], 80)
        assert pool.submit(identify, *told).result().stopped == "budget used"
