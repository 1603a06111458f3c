"""The small study written, run, and run by a process of its own."""

import os
import signal
import subprocess
import sys

import pytest
from small_study import PLUGINS, STUDY

from armid.study.runner import run_study


@pytest.fixture
def write_study(tmp_path):
    """Return a function that writes the small study; identifiers: TOML in place of its own."""

    def write(seeds=2, more="", change=("", ""), name="small.toml"):
        file = tmp_path / name
        text = STUDY.format(seeds=seeds, more=more)
        assert change[0] in text
        file.write_text(text.replace(*change) if change[0] else text, encoding="utf-8")
        return file

    return write


@pytest.fixture(scope="session")
def bad_identifiers(tmp_path_factory):
    """A file of identifiers that misbehave."""
    file = tmp_path_factory.mktemp("plugins") / "bad_identifiers.py"
    file.write_text(PLUGINS, encoding="utf-8")
    return file


@pytest.fixture
def start(tmp_path):
    """Return a function that starts `armid study` in a process of its own."""
    started = []

    def popen(*arguments, **options):
        command = [sys.executable, "-m", "armid", "study", *map(str, arguments)]
        told = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "env": os.environ}
        # a child goes on ignoring what is ignored, as it is where a shell started the tests in the background
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            process = subprocess.Popen(command, cwd=tmp_path, **(told | options))
        finally:
            signal.signal(signal.SIGINT, before)
        started.append(process)
        return process

    yield popen
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory):
    """The small study with six seeds, run by one process that nobody disturbed."""
    folder = tmp_path_factory.mktemp("undisturbed")
    (folder / "small.toml").write_text(STUDY.format(seeds=6, more=""), encoding="utf-8")
    return run_study(folder / "small.toml", jobs=1, out=folder / "out")
