"""`armid identifiability` as a user meets it."""

import json

import pytest


@pytest.fixture
def lowering_only(tmp_path, paper_arm_folder):
    """A campaign of one lowering."""
    folder = tmp_path / "one"
    folder.mkdir()
    text = (paper_arm_folder / "campaign.toml").read_text()
    (folder / "campaign.toml").write_text(text[: text.index("[[records]]", text.index("[[records]]") + 1)])
    (folder / "lower.csv").write_bytes((paper_arm_folder / "lower.csv").read_bytes())
    return folder


def test_a_whole_run(run, lowering_only, tmp_path):
    out = tmp_path / "out"
    ran = run("identifiability", lowering_only, "--window", "0:0.7", "--rank", "worst", "--out", out)
    assert ran.code == 0
    assert ran.err == ""
    for words in ("What the records say", "What one more manoeuvre would buy", "p0, eta3 and n move together",
                  "One more record, "):  # fmt: skip
        assert words in ran.out
    assert sorted(p.name for p in out.iterdir()) == [
        "identifiability.html", "identifiability.json", "profiles.png", "profiles.svg", "sensitivities.png",
        "sensitivities.svg",
    ]  # fmt: skip
    told = json.loads((out / "identifiability.json").read_text())
    assert told["ranked_by"] == "worst"
    assert told["groups"][0]["names"] == ["p0", "eta3", "n"]
    page = (out / "identifiability.html").read_text()
    assert page.count("<svg") == 2
    assert "p0, eta3 and n move together" in page
    again = run("report", out)
    assert (again.code, (out / "identifiability.html").read_text()) == (0, page)
    assert "wrote identifiability.html" in again.out


def test_at_a_point_and_from_a_result(run, lowering_only, tmp_path):
    result = tmp_path / "result.json"
    point = {"p0": 3.05e6, "k": 1.0, "eta3": 0.55, "n": 1.4}
    result.write_text(json.dumps({"parameters": {name: {"value": value} for name, value in point.items()}}))
    at = ",".join(f"{name}={value}" for name, value in point.items())
    one = run("identifiability", lowering_only, "--from", result, "--noise", "0.005")
    other = run("identifiability", lowering_only, "--at", at, "--noise", "0.005")
    assert one.code == 0
    assert one.out == other.out
    assert "white noise of 0.286 deg/s rms is ASSUMED" in one.out
    assert "1.4 " in one.out


def test_fixed_and_bounded(run, lowering_only):
    ran = run("identifiability", lowering_only, "--fix", "n=1.4", "--bounds", "p0=3.1e6:3.2e6")
    assert ran.code == 0
    assert "\N{BOX DRAWINGS LIGHT VERTICAL} n " not in ran.out
    assert "AT ITS BOUND" in ran.out


@pytest.mark.parametrize(("options", "words"), [
    (("--rank", "wurst"), "did you mean 'worst'?"),
    (("--noise", "-1"), "--noise is -1, a finite number above 0 is expected"),
    (("--noise", "nan"), "--noise is nan, a finite number above 0 is expected"),
    (("--at", "p0=3e6"), "--at: parameter 'k' is free and has no value there"),
    (("--at", "p0=3e6,k=1,eta3=0.5,m=1"), "--at: parameter 'm' is not in the model"),
    (("--at", "p0=3e6,k=1,eta3=0.5,n=9"), "n is 9, a value from 0.9 to 1.5 is expected"),
    (("--at", "p0=3e6,k=x,eta3=0.5,n=1.4"), "--at k: 'x' is no number"),
    (("--at", "p0"), "--at 'p0' is not of the form NAME=VALUE"),
    (("--effects", "coulom"), "did you mean 'coulomb'?"),
])  # fmt: skip
def test_refusals(refused, lowering_only, options, words):
    assert words in refused("identifiability", lowering_only, *options)


def test_refusals_of_files(refused, lowering_only, tmp_path):
    bad = tmp_path / "bad.json"
    for text in ("{", "[]", "{}", '{"parameters": {"p0": 3}}', '{"parameters": {"p0": {"value": "x"}}}'):
        bad.write_text(text)
        told = refused("identifiability", lowering_only, "--from", bad)
        assert "a result.json of `armid identify` is expected" in told
    assert "one point is expected" in refused("identifiability", lowering_only, "--from", bad, "--at", "p0=1")
    assert "No such file" in refused("identifiability", lowering_only, "--from", tmp_path / "none.json")
    bad.write_text("file")
    assert "is a file" in refused("identifiability", lowering_only, "--out", bad)
