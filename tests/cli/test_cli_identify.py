"""`armid identify` and `armid identifiability`: what they print and write, and every option."""

import json
import re
import warnings
from shutil import copytree

import numpy as np
import pytest

from commands import python

QUICK = ("--budget", "160", "--window", "0:0.4", "--identifier", "pso", "--fitness", "similarity")
USED = r"^(\d+) of (\d+) simulations used, (.*); seed (\d+)\.$"


@pytest.fixture
def identified(run, small_folder, tmp_path):
    """Return a function that identifies the small campaign, and what it printed and wrote, if it is to write."""

    def written(*options, campaign=small_folder, out=tmp_path / "out"):
        ran = run("identify", campaign, *QUICK, *(("--out", out) if out else ()), *options)
        assert (ran.code, ran.err) == (0, "")
        return ran.out, json.loads((out / "result.json").read_text()) if out else None

    return written


@pytest.mark.nightly
def test_prints_tables_and_remarks_in_units_that_people_read(run, paper_arm_folder):
    ran = run("identify", paper_arm_folder, "--budget", "800", "--identifier", "pso", "--fitness", "similarity")
    assert (ran.code, ran.err) == (0, "")
    for pattern in (
        r"p0 +│ +3\.0\d* +│ MPa +│ does not hold │ ~[\d.]+ to [\d.]+~", r"has not come to the minimum",
        r"RMSE, deg/s", r"train \(5\) +│ +0\.\d+ │ +\d\.\d+ │ +0\.99\d",
        r"holdout \(2\)", r"noise 0\.\d+ deg/s rms and mean [+-]0\.\d+ deg/s \(shown, not subtracted\) from 100 ",
        r"Hardly to be told apart on these records \(correlation\): \w+ and \w+ [+-]0\.9\d+",
        r"800 of 800 simulations used",
    ):  # fmt: skip
        assert re.search(pattern, ran.out), pattern
    assert max(len(line) for line in ran.out.splitlines() if "│" in line) <= 80


@pytest.mark.nightly
def test_writes_result_and_figures_the_same_bits_in_another_process(identified, small_folder, tmp_path):
    text, result = identified("--seed", "7")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "convergence.png", "convergence.svg", "details.json", "fit.png", "pairs.png", "pairs.svg", "report.html",
        "report.md", "result.json",
    ]  # fmt: skip
    wrote = "fit.png, convergence.png, convergence.svg, pairs.png, pairs.svg, details.json, report.md, report.html to"
    assert f"wrote result.json, {wrote}" in text
    assert (result["budget"], result["used"], result["seed"], result["unit"]) == (160, 160, 7, "rad/s")
    assert result["campaign"] == "paper_arm"
    # its TOML stands for the folder
    campaign = small_folder / "campaign.toml"
    again = python("-m", "armid", "identify", campaign, *QUICK, "--seed", 7, "--out", tmp_path / "again")
    # no bar without a terminal
    assert (again.returncode, again.stderr) == (0, "")
    assert "\x1b" not in again.stdout
    assert json.loads((tmp_path / "again" / "result.json").read_text()) == result
    assert identified("--seed", "8", out=None)[0].partition("Errors")[0] != text.partition("Errors")[0]


def test_fixed_values_and_bounds(identified):
    text, result = identified("--fix", "n=1.4", "--fix", "k=1", "--bounds", "p0=3.2e6:3.5e6", "--fitness", "rmse")
    p = result["parameters"]
    assert p["n"].pop("value") == 1.4
    assert p["n"].pop("unit") == "1"
    # a fixed one has neither interval nor bounds
    assert not any(p["n"].values())
    assert (p["p0"]["bound_low"], p["p0"]["bound_high"]) == (3.2e6, 3.5e6)
    assert p["p0"]["value"] == 3.2e6
    assert re.search(r"p0 +│ +3\.2 .*AT ITS BOUND", text)
    assert "p0 sits on its bound" in text
    assert list(result["correlation"]) == ["p0", "eta3"]
    assert re.search(r"n +│ +1\.4 +│ 1 +│ fixed", text)


@pytest.mark.nightly
def test_effects_fitness_and_identifier_also_of_a_user_on_an_axis(identified, mine, write_axis, tmp_path):
    axis = write_axis(tmp_path / "axis")
    options = ("--window", "0:2", "--effects", "coulomb, viscous", "--bounds", "coulomb.width=0.001:0.1", "--fitness")
    text, result = identified(
        *options, "rmse", "--plugin", f"{mine}:evolution", "--identifier", "evolution", campaign=axis
    )
    assert result["effects"] == ["coulomb", "viscous"]
    assert list(result["parameters"]) == ["mass", "coulomb.level", "coulomb.width", "viscous.slope"]
    assert [p["unit"] for p in result["parameters"].values()] == ["kg", "N", "m/s", "N s/m"]
    assert (result["fitness"], result["identifier"], result["used"]) == ("rmse", "evolution", 160)
    assert result["fitness_value"] == pytest.approx(result["error"]["train"]["rmse"], rel=1e-12)
    assert result["error"]["holdout"] is None
    assert re.search(r"holdout: none +│ +│", text)
    assert "mm/s" in text
    plugins = ("--plugin", f"{mine}:cubic_drag", "--plugin", f"{mine}:largest_miss", "--fitness", "largest_miss")
    text, _ = identified("--window", "0:2", *plugins, "--effects", "cubic_drag", campaign=axis, out=None)
    assert "cubic_drag.c" in text


@pytest.mark.parametrize(("fitness", "target", "reached"), [
    ("similarity", 0.9, r"train \(1\) +│ +[\d.]+ │ +[\d.e+]+ │ +([\d.]+)"), ("rmse", 0.2, r"train \(1\) +│ +([\d.]+)"),
])  # fmt: skip
def test_target_stops_early(identified, fitness, target, reached):
    text, _ = identified("--target", target, "--fitness", fitness, "--budget", "5000", out=None)
    used, _, stopped, _ = re.search(USED, text, re.MULTILINE).groups()
    assert int(used) < 2000
    assert int(used) % 80 == 0
    assert stopped == "target reached"
    value = float(re.search(reached, text)[1])
    assert np.radians(value) <= target if fitness == "rmse" else value >= target


def test_nothing_free_is_judged_without_a_search(identified, tmp_path):
    fixed = [word for name in ("p0=3.05e6", "k=1", "eta3=0.55", "n=1.4") for word in ("--fix", name)]
    text, result = identified(*fixed)
    assert (result["used"], result["stopped"], result["correlation"]) == (0, "no parameter is free", {})
    assert result["error"]["train"]["s"] > 0.98
    assert not (tmp_path / "out" / "convergence.png").exists()
    assert "wrote result.json, fit.png, details.json, report.md, report.html to" in text


def test_all_diverge(refused, small_folder, mine, tmp_path):
    options = ("--plugin", f"{mine}:diverging", "--fitness", "diverging", "--out", tmp_path / "out")
    assert "none of 160 candidates has a fitness" in refused("identify", small_folder, *QUICK, *options)
    assert not (tmp_path / "out").exists()


def test_an_error_of_ours_is_not_hidden(paper_arm_folder, monkeypatch):
    from armid.cli.main import main

    monkeypatch.setattr("armid.api.read_campaign", lambda *_: {}["lost"])
    with pytest.raises(KeyError):
        main(["identify", str(paper_arm_folder)])


def test_a_value_far_outside_its_range_is_told(run, small_folder):
    """3.05 for 3.05e6 is what a forgotten factor of the unit gives."""
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        outside = run("identify", small_folder, "--fix", "p0=3.05", *QUICK)
    assert outside.code == 0
    said = "fix p0 = 3.05 is far outside the declared range, 2.6e+06 to 3.5e+06 Pa; it is taken as it is"
    first, second = outside.err.splitlines()
    assert first == f"armid: warning: {said}"
    assert "bounds or fixed values look wrong" in second


def test_a_warning_of_several_records_is_told_once(run, tmp_path, write_axis, axis_speed):
    times = np.arange(401) / 200.0
    others = {f"{name}.csv": axis_speed(times) for name in "abc"}
    entries = "".join(f'[[records]]\nfile = "{name}"\nrole = "train"\n' for name in others)
    folder = write_axis(tmp_path / "axis", None, entries, others)
    for name in others:
        rows = (folder / name).read_text().split()
        (folder / name).write_text("\n".join(rows[:100] + rows[103 + ord(name[0]) % 3 :]) + "\n")
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        messages = run("identify", folder, "--budget", "80").err.splitlines()
    assert len(messages) == 1, messages
    assert messages[0].startswith("armid: warning: axis/a.csv: irregular sampling: ")
    assert messages[0].endswith("; the same with other numbers: b.csv, c.csv")


def test_a_whole_run(run, small_folder, tmp_path):
    """With the usual tolerances, which the committed campaign does without."""
    folder, out = copytree(small_folder, tmp_path / "one"), tmp_path / "out"
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text().partition("[tolerances]")[0])
    ran = run("identifiability", folder, "--window", "0:0.7", "--rank", "worst", "--out", out)
    assert ran.code == 0
    assert ran.err == ""
    for words in ("What the records say", "What one more manoeuvre would buy", "p0, eta3 and n move together",
                  "One more record, ", "do not tell a change of k +1 %, K_d -1 %, made together",
                  "The tolerances of the constants counted, the deviations are: p0 "):  # fmt: skip
        assert words in ran.out
    assert sorted(p.name for p in out.iterdir()) == [
        "identifiability.html", "identifiability.json", "identifiability.md", "pairs.png", "pairs.svg", "profiles.png",
        "profiles.svg", "sensitivities.png", "sensitivities.svg",
    ]  # fmt: skip
    told = json.loads((out / "identifiability.json").read_text())
    assert told["ranked_by"] == "worst"
    assert told["groups"][0]["names"] == ["p0", "eta3", "n"]
    page = (out / "identifiability.html").read_text()
    assert page.count("<svg") == 3
    assert "p0, eta3 and n move together" in page
    again = run("report", out)
    assert (again.code, (out / "identifiability.html").read_text()) == (0, page)
    assert "wrote identifiability.html" in again.out


def test_at_a_point_and_from_a_result(run, small_folder, tmp_path):
    result = tmp_path / "result.json"
    point = {"p0": 3.05e6, "k": 1.0, "eta3": 0.55, "n": 1.4}
    result.write_text(json.dumps({"parameters": {name: {"value": value} for name, value in point.items()}}))
    at = ",".join(f"{name}={value}" for name, value in point.items())
    one = run("identifiability", small_folder, "--from", result, "--noise", "0.005")
    other = run("identifiability", small_folder, "--at", at, "--noise", "0.005")
    assert one.code == 0
    assert one.out == other.out
    assert "white noise of 0.286 deg/s rms is ASSUMED" in one.out
    assert "1.4 " in one.out
