"""Files, options and names of the day on which they were frozen (tests/frozen) still serve, exactly as they stand.

Nothing in tests/frozen is edited so that a test passes: somebody has such files. What is new joins them.
"""

import re
import runpy
from pathlib import Path

import pytest

import armid
from armid.cli.new import NEW_KINDS
from armid.model import EFFECTS, PLANTS
from armid.registry import load_plugin, load_registry

FROZEN = Path(__file__).parent / "frozen"
# Every plant would be compiled with the effect, as tests/contract does.
FILES = {"fitness": (), "identifier": (), "effect": ("--on", "driven_axis"), "plant": ()}


@pytest.fixture
def ran(run):
    """Return a function that runs a command that has to end well, and returns what it printed."""

    def output(*words):
        done = run(*words)
        assert (done.code, done.err) == (0, "")
        return done.out

    return output


@pytest.mark.parametrize(("kind", "on"), FILES.items())
def test_starting_files_of_then_and_now_pass_their_contract(kind, on, ran, tmp_path, monkeypatch):
    """One check where `armid new` still writes the frozen text."""
    monkeypatch.chdir(tmp_path)
    made = ran("new", kind, f"my_{kind}", "--out", "mine")
    file = tmp_path / "mine" / f"my_{kind}.py"
    assert made.partition("try: armid ")[2].split() == ["check", f"mine/my_{kind}.py:my_{kind}"]
    assert [p.name for p in file.parent.iterdir() if p.is_file()] == [file.name]
    text = file.read_text(encoding="utf-8")
    assert "$" not in text
    assert text.count("#") >= 3
    frozen = FROZEN / file.name
    for each in [file] if text == frozen.read_text(encoding="utf-8") else [file, frozen]:
        output = ran("check", f"{each}:my_{kind}", *on)
        assert re.search(r"^(\d+) of \1 points hold$", output, re.MULTILINE)


def test_every_kind_of_starting_file_that_is_frozen_is_still_there_and_the_campaign_holds(ran):
    frozen = {path.stem.removeprefix("my_") for path in (*FROZEN.glob("my_*.py"), *FROZEN.glob("campaigns/my_*"))}
    assert len(frozen) == 5
    assert frozen <= set(NEW_KINDS)
    told = ran("check", FROZEN / "campaigns" / "my_campaign")
    assert re.search(r"^(\d+) of \1 points hold$", told, re.MULTILINE)


def test_campaigns_and_studies_with_every_key_are_read():
    arm, axis = (armid.read_campaign(FROZEN / "campaigns" / name) for name in ("arm", "axis"))
    assert arm.effects == ("coulomb",)
    assert (arm.parameters["p0"].low, arm.parameters["n"].fixed) == (2.9e6, 1.2)
    assert arm.parameters["coulomb.width"].high == 0.1
    assert arm.train[0].manoeuvre.constants["R"] == 0.5
    assert arm.holdout[0].repeat_of == "lower.csv"
    assert (axis.plant.name, axis.unit, len(axis.train[0].pieces)) == ("driven_axis", "m/s", 3)
    study, loops = (armid.read_study(FROZEN / f"{name}.toml") for name in ("study", "loops"))
    assert study.case_names == ["row 1", "recorded", "random 1", "random 2"]
    assert study.labels == ["wide", "pso+least_squares"]
    first = study.cases[0]
    assert (first.bounds["p0"], first.bounds["coulomb.width"]) == ((2.8e6, 3.4e6), (0.001, 0.1))
    assert first.fixed == {"k": 1.0, "n": 1.2}
    assert first.published == {"p0": 3.2114e6}
    assert next(iter(study.cases[2].truth)) == "p0"
    assert loops.case_names == ["arm", "my_campaign"]
    assert [loops.candidates_for(name) for name in loops.case_names] == [
        ("coulomb", "viscous"), ("viscous", "quadratic_drag")
    ]  # fmt: skip


def test_the_plant_of_a_user_is_read_and_composed():
    """The plant of studies/your_own_machine, whose present text is tried in full in tests/studies."""
    kind, name, boom = load_plugin(f"{FROZEN / 'boom.py'}:boom")
    assert (kind, name) == ("plants", "boom")
    assert load_registry([f"{FROZEN / 'boom.py'}:boom"]).plants["boom"] is boom
    model = armid.Model(boom) + EFFECTS["coulomb"] + EFFECTS["gyro_lag"]
    assert {"inertia", "coulomb.level"} <= set(model.parameters)
    assert "upper_limit" in str(model)
    told = runpy.run_path(str(FROZEN / "boom.py"))["boom"]
    assert [guard.name for guard in told.guards] == ["upper_limit", "lower_limit"]


def test_every_command_option_name_and_registered_thing_is_still_there(every_command):
    there = {
        " ".join(words): {
            f"<{p.name}>" if p.param_type_name == "argument" else o for p in command.params for o in p.opts
        }
        for words, command in every_command.items()
    }
    for line in (FROZEN / "options.txt").read_text(encoding="utf-8").splitlines():
        command = re.split(r" (?=--|<)", line)[0]
        assert set(line.removeprefix(command).split()) <= there[command], command
    names = (FROZEN / "names.txt").read_text(encoding="utf-8").split()
    assert [name for name in names if not hasattr(armid, name)] == []
    exported = {}
    exec("from armid import *", exported)
    assert set(names) <= set(exported)
    # Names that campaigns, studies and commands may say.
    catalogues = load_registry()
    for line in (FROZEN / "registered.txt").read_text(encoding="utf-8").splitlines():
        kind, *names = line.split()
        assert set(names) <= set(getattr(catalogues, kind)), kind
    assert catalogues.plants == dict(PLANTS)
