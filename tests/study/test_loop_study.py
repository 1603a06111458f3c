"""Studies that close the loop: what they read, what they refuse, what decides a run."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from loop_suite import STUDY, fake_campaigns

from armid.errors import ArmidError, MachineError
from armid.model import EFFECTS, PLANTS, Model
from armid.study.spec import StudyRegistry
from armid.study.tasks import read_study

ROOT = Path(__file__).parents[2]


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a study with two campaigns beside it and returns its file."""
    fake_campaigns(tmp_path / "suite", "c000", "c001")

    def study(more="", text=STUDY):
        (tmp_path / "blind.toml").write_text(text + more, encoding="utf-8")
        return tmp_path / "blind.toml"

    return study


def test_other_records_and_other_candidates_are_other_runs(write, tmp_path):
    before = {p.case: p.run for p in read_study(write()).plan()}
    assert before == {p.case: p.run for p in read_study(write("# a remark\n")).plan()}
    with open(tmp_path / "suite" / "c001" / "lower.csv", "a", encoding="utf-8") as file:
        file.write("0.001,0\n")
    changed = {p.case: p.run for p in read_study(write()).plan()}
    assert (changed["c000"] == before["c000"], changed["c001"] == before["c001"]) == (True, False)
    (tmp_path / "suite" / "c000" / "runs").mkdir()
    (tmp_path / "suite" / "c000" / "runs" / "deeper.CSV").write_text("time_s\n", encoding="utf-8")
    assert {p.case: p.run for p in read_study(write()).plan()}["c000"] != before["c000"]
    other = {p.case: p.run for p in read_study(write('without = ["tilt"]\n')).plan()}
    assert not set(other.values()) & set(changed.values())


def test_another_plant_of_the_user_makes_other_runs_and_is_not_mistaken_for_the_first(write):
    def registry(digest):
        return StudyRegistry(digests={"plants boom": digest, "fitness mine": digest})

    study, runs = read_study(write()), []
    for digest in "12":
        planned = list(replace(study, registry=registry(digest)).plan())
        assert [json.loads(p.settings)["own"] for p in planned] == [{"plants boom": digest}] * 2
        runs.append({p.run for p in planned})
    assert not runs[0] & runs[1]
    registry("1").refuse_changed({"plants boom": "1"})
    with pytest.raises(MachineError, match="the plug-in that holds boom has changed since the study was started"):
        registry("2").refuse_changed({"plants boom": "1"})


def test_effects_of_a_sensor_are_looked_for_where_all_are(write):
    chosen = 'candidates = ["coulomb", "seal_friction", "supply_sag", "tilt", "viscous"]'
    each = {more: next(iter(read_study(write(text=STUDY.replace(chosen, more))).plan())).settings for more in
            ("", 'candidates = ["angle_bias"]', 'without = ["angle_bias", "coulomb"]')}  # fmt: skip
    whole, told, less = (json.loads(s) for s in each.values())
    assert not {"sensors", "without"} & whole.keys()
    assert (told["candidates"], told["sensors"]) == (["angle_bias"], False)
    assert (less["without"], "coulomb" in less["candidates"]) == (["angle_bias"], False)
    arm = Model(PLANTS["rotary_arm"])
    assert StudyRegistry().with_effects(arm, ["angle_bias"], "here").effects[0].name == "angle_bias"


def test_what_is_looked_for_in_which_campaigns_and_the_key_as_seen_from_the_store(write, tmp_path):
    text = re.sub(r"candidates = .*\n", "", STUDY)
    assert set(read_study(write(text=text)).candidates) == set(EFFECTS)
    assert set(read_study(write('without = ["tilt"]\n', text)).candidates) == set(EFFECTS) - {"tilt"}
    study = read_study(write('[rivals]\n"*0" = ["tilt"]\n'))
    assert study.candidates_for("c000") == ("tilt",)
    assert study.candidates_for("c001") == study.candidates
    assert ['"candidates":["tilt"]' in p.settings for p in study.plan()] == [True, False]
    assert read_study(write('only = ["*1"]\n')).case_names == ["c001"]
    told = read_study(write()).description(tmp_path / "results" / "blind")
    assert told["key"] == "../../suite.key.json"
    assert json.loads(json.dumps(told)) == told
    study = read_study(write("[suite]\nanything = [1, 2]\n"))
    planned = list(study.plan())
    assert [p.case for p in planned] == ["c000", "c001"]
    assert len({p.run for p in planned}) == 2
    assert not any("key" in p.settings for p in planned)


@pytest.mark.parametrize(("more", "sentence"), [
    ('only = ["c002"]\n', "key 'only' holds 'c002', which is not a campaign of 'suite', did you mean 'c00"),
    ('without = ["tillt"]\n', "effect 'tillt' is unknown, did you mean 'tilt'?"),
    ('report = "blnd"\n', "report 'blnd' is unknown, did you mean 'blind'?"),
    ('kind = "close_lop"\n', "kind 'close_lop' is unknown, did you mean 'close_loop'?"),
    ("budget = 3\n", "key 'budget' is unknown"),
    ('campaigns = "swite"\n', "there are no campaigns in 'swite', `make suite` makes them"),
    ('campaigns = "."\n', "'.' holds no folder with a campaign.toml, `make suite` makes them"),
])  # fmt: skip
def test_refuses_with_one_sentence(more, sentence, write, refused):
    name = more.partition(" ")[0]
    text = re.sub(rf"^{name} = .*\n", "", STUDY, flags=re.MULTILINE) + more
    assert sentence in refused("study", write(text=text))


@pytest.mark.parametrize("name", ["blind", "blind_short"])
def test_the_suites_say_how_they_are_made(name, tmp_path):
    text = (ROOT / "studies" / f"{name}.toml").read_text(encoding="utf-8")
    (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    told = rf"`python studies/test_stand.py blind studies/campaigns/{name} --seed [0-9]+"
    with pytest.raises(ArmidError, match=told):
        read_study(tmp_path / f"{name}.toml")
    fake_campaigns(tmp_path / "campaigns" / name, "c000")
    assert read_study(tmp_path / f"{name}.toml").case_names == ["c000"]
