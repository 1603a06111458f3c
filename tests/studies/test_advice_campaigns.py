"""Campaigns of the proof of advice: few strokes, then the same ones and one record more."""

import json
import tomllib

import pytest

from armid.record import read_campaign
from input_texts import SUITE_HEAD
from stand.advice import PROOF, make_base, make_more, read_proof
from stand.blind.campaign import key_path

SMALL = (
    SUITE_HEAD.replace("controls = 1", "tried = 2\ntaken = 1")
    + """\
[[suite.pairs]]
strokes = ["lower"]
first = { name = "coulomb", port = "torque", size = { coulomb = 50.0 } }
second = { name = "brush_drop", port = "winding", size = { brush_drop = 1.5 } }
[[suite.pairs]]
strokes = ["lower", "short"]
first = { name = "tilt", port = "gravity", size = { tilt_deg = 3.0 }, signed = true }
second = { name = "viscous", port = "torque", size = { viscous = 15.0 } }
"""
)
TOO_FAST = {"start_angle_deg": -50.0, "target_angle_deg": 40.0, "shell": True, "supply_V": 60.0}
RAISE = {"start_angle_deg": 20.0, "target_angle_deg": -45.0, "shell": False, "supply_V": 27.0}


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    folder = tmp_path_factory.mktemp("advice") / "base"
    folder.with_name("proof.toml").write_text(SMALL)
    assert make_base([str(folder), "--seed", "4", "--suite", str(folder.with_name("proof.toml"))]) == 0
    return folder


def key_of(folder):
    return dict(json.loads(key_path(folder).read_text())["campaigns"])


def write_reports(base, folder, **advice):
    """Write reports that leave the pair in doubt where advice is given, and explain all elsewhere."""
    for name, entry in key_of(base).items():
        given = [{"manoeuvre": m, "separates": entry["pair"], "power": 0.9} for m in advice.get(name, [])]
        (folder / name).mkdir(parents=True)
        verdict = "cannot_tell_apart" if given else "explained"
        (folder / name / "report.json").write_text(json.dumps({"verdict": verdict, "advice": given}))
    return folder


def more(base, reports, out):
    proof = ["--suite", str(base.with_name("proof.toml")), "--seed", "4"]
    return make_more([str(out), *proof, "--base", str(base), "--reports", str(reports)])


def test_each_effect_of_a_pair_is_true_in_turn_and_the_proof_asks_for_six_pairs_of_twenty(base):
    key = key_of(base)
    assert sorted(key) == ["a01", "a02", "b01", "b02"] == sorted(each.name for each in base.iterdir())
    assert [entry["effects"][0]["name"] for entry in key.values()] == ["brush_drop", "coulomb", "viscous", "tilt"]
    for name in key:
        text = (base / name / "campaign.toml").read_text()
        assert not [word for word in ("coulomb", "brush", "tilt", "viscous", "effect") if word in text]
        assert len(read_campaign(base / name).train) == (1 if name.startswith("a") else 2)
    proof = read_proof(PROOF)
    assert (len(proof.pairs), proof.taken) == (6, 20)
    assert len({frozenset(pair.names) for pair in proof.pairs}) == 6
    for file in ("advice.toml", "advised.toml"):
        rivals = tomllib.loads((PROOF.parent / file).read_text())["rivals"]
        assert {pattern.rstrip("*"): set(names) for pattern, names in rivals.items()} == {
            pair.letter: set(pair.names) for pair in proof.pairs
        }


def test_one_record_more_and_the_others_as_they_were(base, tmp_path):
    reports = write_reports(base, tmp_path / "reports", a01=[RAISE], a02=[RAISE], b02=[TOO_FAST, RAISE])
    assert more(base, reports, tmp_path / "out") == 0
    key = key_of(tmp_path / "out")
    assert sorted(key) == ["a01_advised", "a01_random", "b02_advised", "b02_random"]
    for name, entry in key.items():
        for file in (base / entry["base"]).glob("*.csv"):
            assert (tmp_path / "out" / name / file.name).read_bytes() == file.read_bytes()
        last = read_campaign(tmp_path / "out" / name).train[-1]
        assert last.file == "next.csv"
    assert key["a01_advised"]["next"] == RAISE == key["b02_advised"]["next"]
    assert (key["a01_advised"]["rank"], key["b02_advised"]["rank"]) == (1, 2)
    assert key["a01_random"]["next"] != RAISE
    assert [key[name]["in_doubt"] for name in ("a01_random", "b02_advised")] == [2, 1]


def test_advice_that_the_arm_cannot_follow_leaves_the_campaign_as_it_was(base, tmp_path):
    reports = write_reports(base, tmp_path / "reports", a01=[TOO_FAST])
    assert more(base, reports, tmp_path / "out") == 0
    entry = key_of(tmp_path / "out")["a01_advised"]
    assert (entry["rank"], entry["next"]) == (None, None)
    assert sorted(f.name for f in (tmp_path / "out" / "a01_advised").glob("*.csv")) == ["lower.csv"]
