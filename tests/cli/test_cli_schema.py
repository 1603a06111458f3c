"""`armid schema` says of campaigns and studies what the readers say, and `armid new study` writes one that runs."""

import json
import tomllib
from copy import deepcopy
from dataclasses import fields
from shutil import copytree

import jsonschema
import pytest

from armid import ArmidError, read_campaign, read_study
from armid.record.schema import CampaignSheet, Known, Override, RecordSheet
from armid.study.spec import CaseSpec, EntrySpec, LoopSpec, ManoeuvreSpec, RandomCasesSpec, StudySpec, SuiteSpec
from commands import python
from input_texts import toml_of

SHEETS = (CampaignSheet, RecordSheet, Override, Known, StudySpec, LoopSpec, CaseSpec, EntrySpec, ManoeuvreSpec,
          RandomCasesSpec, SuiteSpec)  # fmt: skip
AXIS, STUDY = "tests/frozen/campaigns/axis/campaign.toml", "tests/frozen/study.toml"
ARM, LOOPS = "tests/frozen/campaigns/arm/campaign.toml", "tests/frozen/loops.toml"
# File, path to a key, a value that is wrong there.
WRONG = [
    (AXIS, ("plant",), 3), (AXIS, ("unwrap",), "yes"), (AXIS, ("most_lost",), 1.0), (AXIS, ("hold",), "cubic"),
    (AXIS, ("records", 0, "restart_s"), 0), (AXIS, ("records", 0, "role"), "tain"), (AXIS, ("records",), []),
    (AXIS, ("records", 0, "windw_s"), [0.0, 1.0]), (AXIS, ("constants", "gain"), "1"),
    (ARM, ("parameters", "p0", "lowest"), 1.0), (ARM, ("records", 0, "shell"), "yes"), (ARM, ("effects",), "coulomb"),
    (STUDY, ("budget",), 0), (STUDY, ("seeds",), [-1]), (STUDY, ("bounds",), {"p0": [1.0]}), (STUDY, ("name",), "a/b"),
    (STUDY, ("identifiers", 0, "buget"), 10), (STUDY, ("cases", 0, "manoeuvres", 0, "duration_s"), "long"),
    (STUDY, ("noise_deg_s",), -0.1), (STUDY, ("windows_s",), "all"), (STUDY, ("report",), "table3"),
    (LOOPS, ("budget",), 100), (LOOPS, ("candidates",), "coulomb"),
]  # fmt: skip


@pytest.fixture(scope="module")
def schemas():
    return {what: json.loads(python("-m", "armid", "schema", what).stdout) for what in ("campaign", "study")}


def kind_of(file):
    return "campaign" if file.endswith("campaign.toml") else "study"


def test_every_committed_campaign_and_study_keeps_the_schema(root, schemas):
    files = [*root.glob("studies/campaigns/*/campaign.toml"), *root.glob("tests/frozen/**/*.toml"),
             *(root / "studies").glob("*.toml"), root / "studies/suite/suite.toml"]  # fmt: skip
    for file in files:
        table = tomllib.loads(file.read_text(encoding="utf-8"))
        jsonschema.Draft7Validator(schemas[kind_of(str(file))]).validate(table)
    assert len(files) > 15


@pytest.mark.parametrize(("file", "path", "value"), WRONG)
def test_what_the_readers_refuse_the_schema_refuses(file, path, value, root, schemas, tmp_path):
    table = tomllib.loads((root / file).read_text(encoding="utf-8"))
    wrong = deepcopy(table)
    inner = wrong
    for step in path[:-1]:
        inner = inner[step]
    inner[path[-1]] = value
    validator = jsonschema.Draft7Validator(schemas[kind_of(file)])
    assert validator.is_valid(table)
    assert not validator.is_valid(wrong)
    written = copytree((root / file).parent, tmp_path / "there") / (root / file).name
    written.write_bytes(toml_of(wrong))
    with pytest.raises(ArmidError, match=r"expected|did you mean|unknown"):
        (read_campaign if kind_of(file) == "campaign" else read_study)(written)


def test_every_key_has_a_meaning_and_a_fitting_default_and_a_schema_offers_what_is_registered(schemas):
    sheets = {"campaign": schemas["campaign"], "study": schemas["study"]["else"], "loops": schemas["study"]["then"]}
    defaults = {(sheet, key): own["default"] for sheet, schema in sheets.items()
                for key, own in schema["properties"].items() if "default" in own}  # fmt: skip
    for (sheet, key), default in defaults.items():
        jsonschema.Draft7Validator(sheets[sheet]["properties"][key]).validate(default)
    assert defaults["study", "windows_s"] == ["whole"]
    assert defaults["study", "noise_deg_s"] == [0.0]
    assert defaults["campaign", "unwrap"] is False
    assert ("study", "report") not in defaults
    for sheet in SHEETS:
        for f in (f for f in fields(sheet) if f.metadata):
            assert f.metadata["meaning"].endswith("."), (sheet, f.name)
            assert f.metadata["expected"], (sheet, f.name)
            assert f.metadata["kind"].schema, (sheet, f.name)
    plant = schemas["study"]["else"]["properties"]["plant"]
    assert "driven_axis" in plant["anyOf"][0]["enum"]
    jsonschema.Draft7Validator(plant).validate("my_plant")
    assert "supply_V" in schemas["campaign"]["properties"]["records"]["items"]["properties"]


def test_a_new_study_runs_as_it_stands_and_an_unknown_schema_is_refused(run, tmp_path, monkeypatch, schemas):
    monkeypatch.chdir(tmp_path)
    assert run("new", "study", "mine").out == "wrote mine.toml; try: armid study mine.toml\n"
    study = read_study("mine.toml")
    assert (study.name, study.n_runs) == ("mine", 18)
    jsonschema.Draft7Validator(schemas["study"]).validate(tomllib.loads((tmp_path / "mine.toml").read_text()))
    ran = run("study", "mine.toml", "--only", "lowering/pso", "--jobs", "1")
    assert ran.code == 0
    assert "3 of 3 are in out/mine" in ran.out
    assert "did you mean 'study'" in run("schema", "studys").err
