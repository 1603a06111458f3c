"""The scorer: one word for each report, and the targets."""

import json
from pathlib import Path

import pytest
from made_up import entry, report

from stand import RefusalError
from stand.blind.campaign import key_path
from stand.score.judge import judge, judge_all, read_json
from stand.score.targets import targets_of

ROOT = Path(__file__).parents[2]
COULOMB = ("coulomb", (), True)
PAIR = ("coulomb", ("seal_friction",), False)
TILT = ("tilt", (), True)
CANDIDATE = ("viscous", (), False)


@pytest.mark.parametrize(("label", "truths", "verdict", "steps", "word"), [
    ("control", (), "no_discrepancy", (), "right"),
    ("control", (), "unexplained", (), "false_alarm"),
    ("control", (), "explained", (COULOMB,), "false_alarm"),
    ("control", (), "does_not_carry_over", (), "false_alarm"),
    ("single", ("coulomb",), "explained", (COULOMB,), "right"),
    ("single", ("coulomb",), "cannot_tell_apart", (PAIR,), "right"),
    # what is claimed stands alone, whatever else is not impossible
    ("single", ("seal_friction",), "explained", ((*PAIR[:2], True),), "wrong"),
    ("single", ("seal_friction",), "cannot_tell_apart", (PAIR,), "group"),
    ("single", ("coulomb",), "explained", (COULOMB, TILT), "right_with_extra"),
    ("single", ("coulomb",), "partly_explained", (COULOMB, CANDIDATE), "right"),
    ("single", ("viscous",), "explained", (COULOMB,), "wrong"),
    ("single", ("e",), "cannot_tell_apart", (("a", ("b", "c", "d", "e"), False),), "wrong"),
    ("single", ("viscous",), "cannot_tell_apart", (), "cannot_tell"),
    ("single", ("viscous",), "no_discrepancy", (), "none"),
    ("single", ("viscous",), "partly_explained", (CANDIDATE,), "none"),
    ("single", ("viscous",), "cannot_tell_apart", (CANDIDATE,), "cannot_tell"),
    ("single", ("coulomb",), "does_not_carry_over", (PAIR,), "none"),
    ("two", ("coulomb", "tilt"), "explained", (TILT, COULOMB), "right"),
    ("two", ("seal_friction", "tilt"), "cannot_tell_apart", (TILT, PAIR), "group"),
    ("two", ("coulomb", "seal_friction"), "cannot_tell_apart", (PAIR,), "half"),
    ("two", ("coulomb", "viscous"), "explained", (COULOMB, TILT), "half_with_extra"),
    ("two", ("stribeck", "viscous"), "explained", (COULOMB, TILT), "wrong"),
    ("unlisted", ("cam_bump",), "explained", (COULOMB,), "claimed"),
    ("unlisted", ("cam_bump",), "partly_explained", (COULOMB,), "partial"),
    ("unlisted", ("cam_bump",), "partly_explained", (CANDIDATE,), "none"),
    ("unlisted", ("cam_bump",), "unexplained", (), "none"),
    ("one_stroke", (), "explained", (COULOMB,), "false_alarm"),
    ("one_stroke", ("coulomb",), "cannot_tell_apart", (("viscous", ("coulomb",), False),), "group"),
])  # fmt: skip
def test_one_word_for_each_report(label, truths, verdict, steps, word):
    told = entry(label, *truths, listed=label != "unlisted")
    assert judge("c000", told, report(verdict, *steps))["judgement"] == word


def test_a_wrong_name_with_a_group_is_not_alone_and_a_group_less_probable_than_a_claim_is_none():
    row = judge("c000", entry("single", "viscous"), report("cannot_tell_apart", PAIR))
    assert (row["wrong_alone"], row["wrong_group"], row["largest_group"], row["group_of_truth"]) == (False, True, 2, 0)
    row = judge("c000", entry("single", "viscous"), report("explained", COULOMB))
    assert (row["wrong_alone"], row["wrong_group"]) == (True, False)
    told = report("cannot_tell_apart", PAIR)
    for probability, word in ((0.48, "right"), (0.47, "cannot_tell")):
        told["probabilities"]["effects"] = dict.fromkeys(("coulomb", "seal_friction"), probability)
        assert judge("c000", entry("single", "coulomb"), told)["judgement"] == word


def test_errors_and_biases_are_reckoned_and_no_held_out_error_without_a_holdout():
    row = judge("c000", entry("single", "coulomb"), report("explained", COULOMB, after=0.006, bias=0.02))
    assert (row["before_over_floor"], row["after_over_floor"]) == pytest.approx((4.0, 1.2))
    assert row["cut"] == pytest.approx(0.7)
    assert row["excess_cut"] == pytest.approx(1.0 - (0.44 / 15.0) ** 0.5)
    assert row["bias_after_eta3"] == pytest.approx(0.02)
    assert row["trusted_n"] is False
    told = report("cannot_tell_apart")
    told["error"]["before"]["holdout"] = told["error"]["after"]["holdout"] = None
    row = judge("c000", entry("one_stroke"), told)
    assert row["before"] is row["after_over_floor"] is row["cut"] is None


def found(rows, words):
    (target,) = (each for each in targets_of(rows, 0) if each.question.endswith(words))
    return target


def test_the_targets_count_what_they_say_or_nothing_and_one_stroke_may_not_be_trusted():
    right, wrong = (report("explained", step) for step in (COULOMB, TILT))
    rows = [judge("c", entry("single", "coulomb"), right) for _ in range(19)]
    held = "20 %: right name, or a group that holds it"
    assert (found(rows, held).found, found(rows, held).met) == (1.0, True)
    rows += [judge("c", entry("single", "coulomb"), wrong) for _ in range(2)]
    assert found(rows, held).met is False
    assert found(rows, "20 %: wrong name alone").found == pytest.approx(2 / 21)
    assert found(rows, "20 %: wrong name alone").met is False
    rows += [judge("c", entry("single", "coulomb", matters=False), wrong) for _ in range(9)]
    assert found(rows, held).among == 21
    assert found(rows, "20 %: share of all").found == pytest.approx(0.7)
    assert {each.met for each in targets_of([], 0)[1:]} == {None}
    assert targets_of([], 3)[0].met is False
    for trusted, met in ((0.0, False), (0.3, True)):
        rows = [judge("c", entry("one_stroke"), report("no_discrepancy", bias=trusted))]
        assert found(rows, "eta3 or n trusted").met is met


@pytest.fixture
def suite(tmp_path):
    folder = tmp_path / "suite"
    key = {"campaigns": {"c000": entry("control"), "c001": entry("single", "coulomb")}}
    key_path(folder).write_text(json.dumps(key))
    (tmp_path / "results" / "c001").mkdir(parents=True)
    (tmp_path / "results" / "c001" / "report.json").write_text(json.dumps(report("explained", COULOMB)))
    return folder


def scored(suite):
    key = read_json(key_path(suite))["campaigns"]
    files = {name: suite.with_name("results") / name / "report.json" for name in key}
    return judge_all(key, {name: read_json(file) for name, file in files.items() if file.is_file()})


def test_a_campaign_without_a_report_is_missing(suite):
    rows, missing = scored(suite)
    assert ([row["judgement"] for row in rows], [row["judgement"] for row in missing]) == (["right"], ["missing"])
    first = targets_of(rows, len(missing))[0]
    assert (first.question, first.found, first.among, first.met) == ("campaigns without a report", 1, 2, False)


@pytest.mark.parametrize(
    ("text", "sentence"), [("{", "is not JSON"), ("{}", "is not a report of a closed loop"), ("[]", "is not a report")]
)
def test_refuses_what_is_no_report(text, sentence, suite):
    (suite.with_name("results") / "c001" / "report.json").write_text(text)
    with pytest.raises(RefusalError, match=sentence):
        scored(suite)
    with pytest.raises(RefusalError, match="cannot be read"):
        read_json(suite / "nothing.json")


def test_nothing_in_the_package_names_a_key():
    files = list((ROOT / "src").rglob("*.py"))
    assert len(files) > 50
    assert not [file for file in files if "key.json" in file.read_text()]
