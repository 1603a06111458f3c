"""`armid identify`: what it prints and writes, and every option."""

import json
import re
import warnings

import numpy as np
import pytest

QUICK = ("--budget", "160", "--window", "0:0.4")


@pytest.fixture
def identified(run, paper_arm_folder, tmp_path):
    """Return a function that identifies the committed campaign, and what it printed and wrote."""

    def written(*options, campaign=paper_arm_folder):
        ran = run("identify", campaign, *QUICK, "--out", tmp_path / "out", *options)
        assert (ran.code, ran.err) == (0, "")
        return ran.out, json.loads((tmp_path / "out" / "result.json").read_text())

    return written


def test_prints_tables_and_remarks_in_units_that_people_read(run, paper_arm_folder):
    ran = run("identify", paper_arm_folder, "--budget", "800")
    assert (ran.code, ran.err) == (0, "")
    for pattern in (
        r"p0 +│ 3\.0\d* +│ MPa +│ [\d.]+ to [\d.]+ +│ 2\.6 to 3\.5", r"RMSE, deg/s", r"train \(5\) +│ 0\.99\d",
        r"holdout \(2\)", r"noise 0\.\d+ deg/s rms and mean [+-]0\.\d+ deg/s \(shown, not subtracted\) from 100 ",
        r"can hardly be told apart on these records \(correlation [+-]0\.9\d+\)", r"800 of 800 simulations used",
    ):  # fmt: skip
        assert re.search(pattern, ran.out), pattern
    assert max(map(len, ran.out.splitlines())) <= 120


def test_writes_result_and_figures(identified, tmp_path):
    text, result = identified()
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "convergence.png", "convergence.svg", "details.json", "fit.png", "report.html", "result.json"
    ]  # fmt: skip
    assert "wrote result.json, fit.png, convergence.png, convergence.svg, details.json, report.html to" in text
    assert (result["budget"], result["used"], result["seed"], result["unit"]) == (160, 160, 1, "rad/s")
    assert result["campaign"] == "paper_arm"


def test_the_campaign_s_toml_stands_for_its_folder(identified, paper_arm_folder):
    assert identified(campaign=paper_arm_folder / "campaign.toml") == identified()


def test_the_same_bits_in_another_process(identified, other_process, paper_arm_folder, tmp_path):
    _, result = identified("--seed", "7")
    again = other_process("identify", paper_arm_folder, *QUICK, "--seed", 7, "--out", tmp_path / "again")
    assert (again.returncode, again.stderr) == (0, "")
    assert json.loads((tmp_path / "again" / "result.json").read_text()) == result
    assert identified("--seed", "8")[1]["parameters"] != result["parameters"]


def test_fix_and_bounds(identified):
    text, result = identified("--fix", "n=1.4", "--fix", "k=1", "--bounds", "p0=3.0e6:3.1e6")
    p = result["parameters"]
    assert p["n"] == {"value": 1.4, "unit": "1", "low": None, "high": None, "bound_low": None, "bound_high": None,
                      "bound_active": False}  # fmt: skip
    assert (p["p0"]["bound_low"], p["p0"]["bound_high"]) == (3.0e6, 3.1e6)
    assert 3.0e6 <= p["p0"]["value"] <= 3.1e6
    assert list(result["correlation"]) == ["p0", "eta3"]
    assert re.search(r"n +│ 1\.4 +│ 1 +│ +│ +│ fixed", text)


def test_an_active_bound_is_flagged(identified):
    text, result = identified("--bounds", "p0=3.2e6:3.5e6", "--fix", "eta3=0.55", "--fix", "n=1.4", "--fix", "k=1")
    assert result["parameters"]["p0"]["bound_active"]
    assert result["parameters"]["p0"]["value"] == 3.2e6
    assert "AT ITS BOUND" in text
    assert "p0 sits on its bound" in text


def test_what_is_not_seen_is_not_determined(identified):
    text, result = identified("--window", "0:0.3", "--fix", "eta3=0.55", "--fix", "n=1.4")
    assert re.search(r"k +│ [\d.]+ +│ 1 +│ not determined", text)
    assert "k is not determined by these records." in text
    assert (result["parameters"]["k"]["low"], result["parameters"]["k"]["high"]) == (None, None)
    assert result["correlation"]["p0"]["k"] is None


def test_effects_window_fitness_and_identifier(identified, mine):
    options = ("--effects", "coulomb, viscous", "--bounds", "coulomb.width=0.001:0.1", "--fitness", "rmse")
    _, result = identified(*options, "--plugin", f"{mine}:evolution", "--identifier", "evolution")
    assert result["effects"] == ["coulomb", "viscous"]
    assert list(result["parameters"])[4:] == ["coulomb.level", "coulomb.width", "viscous.slope"]
    assert [p["unit"] for p in result["parameters"].values()][4:] == ["N m", "rad/s", "N m s/rad"]
    assert (result["fitness"], result["identifier"], result["used"]) == ("rmse", "evolution", 160)
    assert result["fitness_value"] == result["error"]["train"]["rmse"]


def test_a_user_s_effect_and_fitness(identified, mine):
    plugins = ("--plugin", f"{mine}:cubic_drag", "--plugin", f"{mine}:largest_miss")
    _, result = identified(*plugins, "--effects", "cubic_drag", "--fitness", "largest_miss")
    assert result["fitness"] == "largest_miss"
    assert "cubic_drag.c" in result["parameters"]


@pytest.mark.parametrize(
    ("fitness", "target"), [("similarity", "0.9"), ("numerical_similarity", "0.9"), ("rmse", "0.2")]
)
def test_target_stops_early(identified, fitness, target):
    text, result = identified("--target", target, "--fitness", fitness, "--budget", "5000")
    assert result["used"] < 2000
    assert result["used"] % 80 == 0
    assert result["stopped"] == "target reached"
    assert "target reached" in text
    reached = result["error"]["train"][{"similarity": "s", "numerical_similarity": "s1", "rmse": "rmse"}[fitness]]
    assert reached <= 0.2 if fitness == "rmse" else reached >= 0.9


def test_nothing_free_is_judged_without_a_search(identified, tmp_path):
    fixed = [word for name in ("p0=3.05e6", "k=1", "eta3=0.55", "n=1.4") for word in ("--fix", name)]
    text, result = identified(*fixed)
    assert (result["used"], result["stopped"], result["correlation"]) == (0, "no parameter is free", {})
    assert result["error"]["train"]["s"] > 0.98
    assert not (tmp_path / "out" / "convergence.png").exists()
    assert "wrote result.json, fit.png, details.json, report.html to" in text


def test_a_campaign_without_holdout(identified, write_axis, tmp_path):
    text, result = identified("--effects", "viscous", "--window", "0:2", campaign=write_axis(tmp_path / "axis"))
    assert result["error"]["holdout"] is None
    assert re.search(r"holdout: none +│ +│", text)
    assert "RMSE, mm/s" in text


def test_all_diverge(refused, paper_arm_folder, mine, tmp_path):
    options = ("--plugin", f"{mine}:diverging", "--fitness", "diverging", "--out", tmp_path / "out")
    assert "none of 160 candidates has a fitness" in refused("identify", paper_arm_folder, *QUICK, *options)
    assert not (tmp_path / "out").exists()


def test_an_error_of_ours_is_not_hidden(paper_arm_folder, monkeypatch):
    from armid.cli.main import main

    monkeypatch.setattr("armid.record.read_campaign", lambda *_: {}["lost"])
    with pytest.raises(KeyError):
        main(["identify", str(paper_arm_folder)])


def test_a_warning_is_one_line(run, tmp_path, write_axis):
    folder = write_axis(tmp_path / "axis")
    rows = (folder / "move.csv").read_text().split()
    (folder / "move.csv").write_text("\n".join(rows[:100] + rows[103:]) + "\n")
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        ran = run("identify", folder, "--budget", "80")
    assert ran.code == 0
    assert re.fullmatch(r"armid: warning: axis/move\.csv: irregular sampling: .*\n", ran.err)


def test_the_interval_is_that_of_the_information(identified, paper_arm, arm, arm_space):
    from armid.estimation.information import information_at
    from armid.problem.replay import replays

    _, result = identified("--window", "0:0.7")
    x = np.array([p["value"] for p in result["parameters"].values()])
    information = information_at(replays(paper_arm.with_window(0.0, 0.7).train, arm, arm_space), arm_space, x)
    for name, half in zip(information.names, information.half_width):
        told = result["parameters"][name]
        assert told["high"] - told["value"] == pytest.approx(half, rel=1e-6)
        assert told["value"] - told["low"] == pytest.approx(half, rel=1e-6)


def test_a_value_far_outside_the_declared_range_is_taken_with_a_warning(run, paper_arm_folder):
    """3.05 for 3.05e6 is what a forgotten factor of the unit gives."""
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        ran = run("identify", paper_arm_folder, "--fix", "p0=3.05", *QUICK)
    assert ran.code == 0
    said = "--fix p0=3.05 is far outside the declared range, 2.6e+06 to 3.5e+06 Pa; it is taken as it is"
    assert ran.err == f"armid: warning: {said}\n"
