"""What several folders of tests share: the committed campaign, small campaigns of an axis, the test stand."""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from numba.core import event

from armid import errors
from armid.cli.new import campaign_text, synthetic_records
from armid.model import EFFECTS, Model
from armid.problem.problem import replays
from armid.problem.space import space_of
from armid.record import read_campaign, write_campaign, write_table
from commands import ended, remount
from input_texts import TABLE_STUDY

# How fast inputs are made hangs on what else the machine does.
settings.register_profile("armid", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("armid")
ROOT = Path(__file__).parents[1]
# Those that take longest come first, so that two processes end together.
LONGEST = (
    "test_a_late_voltage_is_no_late_torque", "test_the_small_blind_suite", "test_every_effect_keeps_its_contract",
    "test_a_runner_killed_again_and_again", "test_the_notebook_runs", "test_the_small_table",
    "test_every_snippet_runs_and_every_output_is_true", "test_right_campaigns_are_not_accused",
    "test_closing_the_loop",
)  # fmt: skip
AXIS_TOML = """\
name = "axis"
plant = "driven_axis"
[[records]]
file = "move.csv"
role = "train"
"""


@pytest.fixture(scope="session")
def root():
    """The repository's root."""
    return ROOT


@pytest.fixture(scope="session", autouse=True)
def no_word_of_compiling():
    """What compiling takes hangs on the cache and the machine: commands in this process do not announce it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("armid.progress.SLOW_S", 1e6)
        yield


class Untraced(event.Listener):
    """Coverage rests while numba compiles, which takes 1.8 times as long under it.

    tests/engine/test_simd_math.py compiles every operation, so that what makes machine code is seen to run there.
    """

    def __init__(self):
        self.tracers = []

    def on_start(self, event):
        self.tracers.append(sys.gettrace())
        if "test_simd_math.py" not in os.environ.get("PYTEST_CURRENT_TEST", ""):
            sys.settrace(None)

    def on_end(self, event):
        sys.settrace(self.tracers.pop())


event.register("numba:compile", Untraced())


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Put the longest tests first; those of the night are slow too, so that "not slow" leaves them out."""
    items.sort(key=lambda item: item.name.partition("[")[0] not in LONGEST)
    for item in items:
        if item.get_closest_marker("nightly"):
            item.add_marker("slow")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Leave out of coverage what a slow test starts: workers, which end without telling theirs, and examples."""
    with pytest.MonkeyPatch.context() as patch:
        if item.get_closest_marker("slow"):
            patch.delenv("COVERAGE_PROCESS_CONFIG", raising=False)
        return (yield)


@dataclass(frozen=True)
class Ran:
    """Hold what a command left: exit code, output, error output."""

    code: int
    out: str
    err: str


@pytest.fixture
def run(capsys):
    """Return a function that runs a command in this process."""

    def ran(*arguments):
        code = ended(*arguments)
        return Ran(code, *capsys.readouterr())

    return ran


@pytest.fixture
def refused(run):
    """Return a function that runs a command that has to be refused, and returns its one sentence."""

    def sentence(*arguments):
        ran = run(*arguments)
        assert (ran.code, ran.out) == (2, "")
        assert ran.err.startswith("armid: ")
        assert ran.err.count("\n") == 1
        assert len(ran.err) <= len("armid: ") + errors.LONGEST_SENTENCE + 1
        return ran.err

    return sentence


@pytest.fixture
def disk(tmp_path):
    """Return a function that makes a file system of some size, which only root may do."""
    folder = tmp_path / "disk"
    folder.mkdir()

    def mounted(size, *, read_only=False):
        command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
        if shutil.which("mount") is None or subprocess.run(command, check=False, capture_output=True).returncode:
            pytest.skip("a small file system cannot be mounted here")
        if read_only:
            (folder / "kept").write_text("kept")
            remount(folder, "ro")
        return folder

    yield mounted
    subprocess.run(["umount", str(folder)], check=False, capture_output=True)


@pytest.fixture(scope="session")
def every_command():
    """The words that call a command -> the command, of every command of armid."""
    from armid.cli.main import app

    def below(group, words):
        for name in group.list_commands(None):
            command = group.get_command(None, name)
            if hasattr(command, "commands"):
                yield from below(command, (*words, name))
            else:
                yield (*words, name), command

    return dict(below(app, ()))


@pytest.fixture(scope="session")
def paper_arm_folder():
    """Folder of the committed synthetic campaign."""
    return ROOT / "studies" / "campaigns" / "paper_arm"


@pytest.fixture(scope="session")
def paper_arm(paper_arm_folder):
    """The committed synthetic campaign: lower (three times), raise, short; empty and low voltage held out."""
    return read_campaign(paper_arm_folder)


@pytest.fixture(scope="session")
def arm(paper_arm):
    """The declared arm."""
    return Model(paper_arm.plant)


@pytest.fixture(scope="session")
def arm_space(arm):
    """Its box as declared."""
    return space_of(arm)


@pytest.fixture(scope="session")
def lowering(paper_arm):
    """One lowering to train on, cut at 0.7 s, and one to hold out."""
    train, holdout = paper_arm.train[0], paper_arm.holdout[1]
    return replace(paper_arm, records=(train, holdout)).with_window(0.0, 0.7)


@pytest.fixture(scope="session")
def lowering_replays(lowering, arm, arm_space):
    """The lowering ready to be simulated."""
    return replays(lowering.train, arm, arm_space)


@pytest.fixture(scope="session")
def synthetic_axis(tmp_path_factory):
    """Folder of the campaign that `armid new` writes."""
    folder = tmp_path_factory.mktemp("synthetic") / "axis"
    return write_campaign(folder, campaign_text("axis"), synthetic_records())


@pytest.fixture(scope="session")
def table_study(tmp_path_factory):
    """Folder of a study of Table I with its four runs in out; who writes into it works on a copy."""
    from armid.study.runner import run_study

    folder = tmp_path_factory.mktemp("tiny")
    (folder / "tiny.toml").write_text(TABLE_STUDY, encoding="utf-8")
    run_study(folder / "tiny.toml", jobs=1, out=folder / "out")
    return folder


@pytest.fixture(scope="module")
def store(table_study, tmp_path_factory):
    """Folder of the runs of a copy of that study, for one file of tests."""
    return shutil.copytree(table_study, tmp_path_factory.mktemp("stored") / "tiny") / "out"


def step_response(times, mass=2.0, slope=5.0, drive=8.0):
    """Return the speed of an axis with viscous friction under a constant drive from rest, F/c (1 - exp(-c t/m))."""
    return drive / slope * (1.0 - np.exp(-slope * times / mass))


@pytest.fixture(scope="session")
def axis_speed():
    """The closed form `step_response`."""
    return step_response


@pytest.fixture(scope="session")
def axis_model(write_axis, tmp_path_factory):
    """An axis with viscous friction, scaled as the step response of the defaults asks for."""
    return Model(read_campaign(write_axis(tmp_path_factory.mktemp("axis"))).plant) + EFFECTS["viscous"]


@pytest.fixture(scope="session")
def write_axis():
    """Return a function that writes a campaign of an axis, driven by a constant 8 N from rest for 2 s at 200 Hz.

    folder: where; velocity: what is recorded [m/s], (401,), None: the step response without noise; more: text for
    campaign.toml; others: further records, file -> velocity.
    """

    def write(folder, velocity=None, more="", others=None):
        times = np.arange(401) / 200.0
        recorded = {"move.csv": step_response(times) if velocity is None else velocity, **(others or {})}
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "campaign.toml").write_text(AXIS_TOML + more, encoding="utf-8")
        for file, speed in recorded.items():
            write_table(folder / file, {"time_s": times, "velocity_m_s": speed, "drive_N": np.full(401, 8.0)})
        return folder

    return write


@pytest.fixture(scope="session")
def stand(tmp_path_factory):
    """Return a function that makes a campaign with studies/test_stand.py.

    The same options are made once, and a motion that several campaigns record with other sensors is simulated once.
    """
    from stand import command

    @cache
    def campaign(*options):
        folder = tmp_path_factory.mktemp("stand") / "made"
        assert command.main([str(folder), *options]) == 0
        return folder

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "simulate", cache(command.simulate))
        yield campaign
