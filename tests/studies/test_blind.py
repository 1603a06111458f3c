"""The blind suite: what it holds, that it tells nothing, and that its key lies apart."""

import json
import re
from collections import Counter

import numpy as np
import pytest

from armid.record import read_campaign
from input_texts import SUITE_HEAD
from stand import families
from stand.arm import KNOWN, Arm
from stand.blind.campaign import SUITE, key_path, main
from stand.blind.draw import declared_speeds, fit_declared
from stand.blind.suite import cases_of, read_suite, shuffled
from stand.effects import Effects
from stand.motion import Motion, simulate

LISTED = {
    "coulomb", "stribeck", "viscous", "quadratic_drag", "seal_friction", "shell_rocking", "tilt", "worm_direction",
    "worm_speed", "flux_saturation", "brush_drop", "winding_heating", "supply_sag", "gas_heat_loss", "line_loss",
    "tachometer_lag", "tachometer_offset", "controller_delay", "gyro_lag", "gyro_bias", "gyro_scale", "drive_gain",
    "torque_offset",
}  # fmt: skip
SMALL = (
    SUITE_HEAD.replace("[1.0, 1.1]", "[1.2, 1.3]")
    + """\
[[suite.effects]]
name = "gyro_bias"
port = "output"
form = "constant"
signed = true
sizes = [{ gyro_bias_deg_s = 0.4 }]
[suite.one_stroke]
effects = ["none"]
"""
)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Make four campaigns in one process: a control, an effect twice, one stroke."""
    folder = tmp_path_factory.mktemp("blind") / "suite"
    folder.with_name("small.toml").write_text(SMALL)
    assert main([str(folder), *words_of(folder.with_name("small.toml")), "--processes", "1"]) == 0
    return folder


def words_of(suite):
    return ["--seed", "5", "--suite", str(suite)]


def key_of(folder):
    return dict(json.loads(key_path(folder).read_text()))


def test_the_suite_holds_what_the_question_asks_and_a_part_the_campaigns_of_the_whole():
    suite = read_suite(SUITE)
    cases = cases_of(suite, 1)
    counts = Counter(case.label for case in cases)
    assert counts["control"] == 100
    assert (counts["two"], counts["unlisted"], counts["one_stroke"]) == (20, 12, 12)
    assert {kind.name for kind in suite.effects} == LISTED
    assert all(len(suite.kind(name).sizes) == 3 for name in LISTED)
    assert len({kind.name for kind in suite.unlisted}) >= 6
    assert not {kind.name for kind in suite.unlisted} & LISTED
    for label in ("control", "single", "two", "unlisted"):
        assert Counter(case.coloured for case in cases if case.label == label)[True] * 2 == counts[label]
    part = shuffled(cases, 1, ["coulomb"])
    assert {case.index for case in part.values()} == {case.index for case in cases if case.chosen(["coulomb"])}
    assert list(part) == [f"c{count:03d}" for count in range(len(part))]
    whole = [case.index for case in shuffled(cases, 1).values()]
    assert sorted(whole) == list(range(len(cases))) != whole


@pytest.mark.nightly
def test_a_suite_is_the_same_from_one_process_or_two(small, tmp_path):
    again = tmp_path / "suite"
    assert main([str(again), *words_of(small.with_name("small.toml")), "--processes", "2"]) == 0
    for file in (each for each in small.rglob("*") if each.is_file()):
        assert (again / file.relative_to(small)).read_bytes() == file.read_bytes()
    assert key_path(again).read_bytes() == key_path(small).read_bytes()


@pytest.mark.nightly
def test_a_campaign_tells_nothing_of_its_truth_and_the_package_reads_it(small):
    words = re.compile(r"effect|seed|true|noise|colou?r|white|p0|eta3|bias|class|index|key", re.IGNORECASE)
    assert sorted(each.name for each in small.iterdir()) == sorted(key_of(small)["campaigns"])
    assert {each.suffix for each in small.rglob("*") if each.is_file()} == {".toml", ".md", ".csv"}
    for campaign in small.iterdir():
        for name in ("campaign.toml", "README.md"):
            text = (campaign / name).read_text().replace("shell = true", "")
            assert not words.search(text), words.search(text)
            assert "SYNTHETIC and blind" in text
        assert (campaign / "lower.csv").read_text().startswith("time_s,angular_velocity_deg_s\n-0.200,")
    for name, entry in key_of(small)["campaigns"].items():
        campaign = read_campaign(small / name)
        one = entry["class"] == "one_stroke"
        assert len(campaign.train) == (1 if one else 4)
        assert len(campaign.holdout) in ((0, 1) if one else (2,))
        assert {record.file for record in campaign.records} == {record["file"] for record in entry["records"]}
        for record in campaign.records:
            assert record.rest.size == 200


@pytest.mark.nightly
def test_the_truth_is_away_from_the_edges_and_explains_the_records(small):
    ranges = read_suite(SUITE).ranges
    for name, entry in key_of(small)["campaigns"].items():
        for parameter, (low, high) in ranges.items():
            assert low + 0.1 * (high - low) <= entry["parameters"][parameter] <= high - 0.1 * (high - low)
        arm = Arm(**entry["parameters"])
        effects = Effects(**{k: v for each in entry["effects"] for k, v in each["sizes"].items()})
        for record in entry["records"][:1]:
            measured = np.loadtxt(small / name / record["file"], delimiter=",", skiprows=1)[200:, 1]
            stroke = type(KNOWN["lower"])("lower", record["start_angle_deg"], record["target_angle_deg"])
            true = simulate(Motion(arm, stroke, effects), (measured.size - 1) / 1000.0, 1e-9).gyro
            left = float(np.sqrt(np.mean((np.radians(measured) - true) ** 2)))
            assert left == pytest.approx(record["noise"], rel=1e-4)
            assert np.degrees(left) == pytest.approx(entry["noise"]["rms_deg_s"], rel=0.25)


@pytest.mark.nightly
def test_what_effects_do_is_told_for_each_campaign(small):
    for entry in key_of(small)["campaigns"].values():
        if entry["class"] == "single":
            fit = entry["declared_fit"]
            expected = np.hypot(1.0, fit["left_holdout"] / entry["floor"]["holdout"])
            assert fit["holdout_ratio"] == pytest.approx(expected, rel=1e-4)
            assert fit["left_train"] <= np.radians(0.4)
            assert abs(entry["effects"][0]["sizes"]["gyro_bias_deg_s"]) == 0.4
        else:
            assert entry["declared_fit"] is None


@pytest.mark.slow
@pytest.mark.parametrize("name", KNOWN)
def test_lanes_agree_with_the_stand(name):
    pairs = [(Arm(), KNOWN[name]), (Arm(3.2e6, 0.9, 0.6, 1.2), KNOWN[name])]
    for found, (arm, manoeuvre) in zip(declared_speeds(pairs, 1001), pairs):
        assert np.abs(found - simulate(Motion(arm, manoeuvre), 1.0, 1e-9).gyro).max() < 5e-4


def test_the_fit_finds_an_arm_that_lacks_nothing():
    truth = Arm(3.2e6, 0.9, 0.6, 1.2)
    strokes = [KNOWN[name] for name in ("lower", "raise", "empty")]
    speeds = declared_speeds([(truth, stroke) for stroke in strokes], 801)
    ranges = read_suite(SUITE).ranges
    found = fit_declared(strokes, speeds, Arm(), ranges)
    for name in ranges:
        assert getattr(found, name) == pytest.approx(getattr(truth, name), rel=1e-3)


REFUSED = [
    (main, ["suite", "--seed", "1", "--only", "cool"], "no class or effect 'cool'"),
    (main, ["suite", "--seed", "1", "--suite", "empty.toml"], "lacks the key 'suite'"),
    (main, ["suite", "--seed", "1", "--suite", "wrong.toml"], "describes no suite"),
    (main, ["full", "--seed", "1", "--force"], "holds mine.txt"),
    (families.main, ["made", "falt=1", "--seed", "1"], "families: 'falt=1' is not a FAMILY=N: one of control, fault"),
]


def test_refuses_with_one_sentence_and_writes_nothing(refuses):
    for program, words, sentence in REFUSED:
        refuses(program, words, sentence)
