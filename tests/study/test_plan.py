"""What a study asks for: runs, their order, paired noise, and what a changed file keeps."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from small_study import RUNS_A_SEED

from armid.study.cases import RunCache, clean_records
from armid.study.results import load_study
from armid.study.runner import run_study
from armid.study.tasks import read_study
from armid.units import DEGREE

STUDIES = Path(__file__).parents[2] / "studies"
RANDOM = """\
[random_cases]
n = 20
seed = 3
margin = 0.1
manoeuvres = [{ start_angle_deg = -48, target_angle_deg = 22, shell = true, supply_V = 28, duration_s = 0.3 }]
"""
FIRST_CASE = '[[cases]]\nname = "row 1"'


def replays_of(study, **wanted):
    planned = next(p for p in study.plan() if all(getattr(p, word) == value for word, value in wanted.items()))
    return RunCache(study.registry, study.folder).replays(json.loads(planned.settings))[1]


def test_every_combination_is_there_once_and_random_truths_are_a_latin_hypercube_inside_the_margin(write_study):
    planned = list(read_study(write_study(3)).plan())
    assert len({p.run for p in planned}) == len(planned) == 3 * RUNS_A_SEED
    study = read_study(write_study(3))
    assert study.n_runs == len(planned)
    assert study.cost() == f"{len(planned)} runs, {sum(p.budget for p in planned):,} simulations at most in all"
    assert [p.seed for p in planned] == sorted(p.seed for p in planned)
    words = {(p.case, p.identifier, p.fitness, p.noise_deg_s, p.seed) for p in planned}
    assert len(words) == len(planned)
    budgets = [p.budget for p in read_study(write_study(3, change=("budget = 40", "budget = [40, 90]"))).plan()]
    assert (budgets.count(40), budgets.count(90)) == (len(planned), len(planned))
    random_cases = RANDOM + FIRST_CASE
    cases = read_study(write_study(1, change=(FIRST_CASE, random_cases))).cases[2:]
    assert [c.name for c in cases[:2]] == ["random 01", "random 02"]
    for name, (low, high) in cases[0].bounds.items():
        shares = (np.array([c.truth[name] for c in cases]) - low) / (high - low)
        assert sorted(((shares - 0.1) / 0.8 * 20).astype(int)) == list(range(20))


@pytest.mark.slow
def test_without_a_folder_results_go_where_git_ignores_them_and_names_of_tables_choose_runs(
    write_study, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    run_study(write_study(1), jobs=1, only="row 1/random")
    assert [path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.sqlite")] == ["out/small/study.sqlite"]
    assert "out/" in (STUDIES.parent / ".gitignore").read_text().splitlines()
    file = write_study(1, change=('fitness = ["rmse", "similarity"]', 'fitness = ["rmse", "mae"]'))
    results = run_study(file, jobs=1, out=tmp_path / "out", only="row 1/pso on m*")
    assert set(results.runs["fitness"]) == {"mae"}
    assert set(results.runs["case"]) == {"row 1"}


def test_noise_is_paired_white_and_as_loud_as_told_and_a_window_shows_a_part_of_a_record(write_study):
    study = read_study(write_study(2))
    one = replays_of(study, case="row 1", identifier="random", noise_deg_s=0.3, seed=1)[0]
    for other in ({"identifier": "pso", "fitness": "similarity"}, {"identifier": "pso+least_squares"}):
        same = replays_of(study, case="row 1", noise_deg_s=0.3, seed=1, **other)[0]
        assert np.array_equal(one.measured, same.measured)
    again = replays_of(study, case="row 1", identifier="random", noise_deg_s=0.3, seed=2)[0]
    assert not np.any(one.measured == again.measured)
    study = read_study(write_study(1, change=("noise_deg_s = [0.0, 0.3]", "noise_deg_s = [0.0, 0.3, 0.6]")))
    clean = replays_of(study, case="row 1", noise_deg_s=0.0)[0]
    for level in (0.3, 0.6):
        noisy = replays_of(study, case="row 1", noise_deg_s=level)[0]
        assert noisy.record.noise.rms == pytest.approx(DEGREE * level, rel=1e-15)
        noise = (noisy.measured - clean.measured) / noisy.record.noise.rms
        n = noise.size
        assert abs(np.mean(noise**2) - 1.0) < 4.0 * np.sqrt(2.0 / n)
        assert abs(np.mean(noise)) < 4.0 / np.sqrt(n)
        assert abs(np.mean(noise[1:] * noise[:-1])) < 4.0 / np.sqrt(n)
    study = read_study(write_study(1, change=("[[0.0, 0.3]]", '[[0.05, 0.2], "whole"]')))
    part = replays_of(study, case="row 5", noise_deg_s=0.3, window="0.05-0.2 s")
    whole = replays_of(study, case="row 5", noise_deg_s=0.3, window="whole")
    assert [r.record.role for r in whole] == ["train", "holdout"]
    for a, b in zip(part, whole, strict=True):
        assert np.array_equal(a.measured, b.measured[50:201])


def test_simulated_records_agree_with_an_independent_integrator(stand, write_study):
    truth = ("--p0", "3.2e6", "--k", "1", "--eta3", "0.62", "--n", "1")
    told = ("--noise-deg-s", "0", "--quantisation-deg-s", "0", "--manoeuvres", "lower", "--repeats", "1")
    file = stand(*truth, *told, "--duration", "0.3")
    theirs = np.loadtxt(file / "lower.csv", delimiter=",", skiprows=101)[:, 1]
    study = read_study(write_study(1))
    settings = json.loads(next(study.plan()).settings)
    ours = clean_records(settings, study.cases[0].model)[0].measured
    # the file has six decimals
    assert np.abs(np.rad2deg(ours) - theirs).max() < 0.6e-6


@pytest.mark.slow
def test_a_changed_file_keeps_what_it_still_asks_for(write_study, tmp_path):
    told = {"jobs": 1, "out": tmp_path / "out", "only": "row 1/random"}
    first = run_study(write_study(2), **told)
    # another question, label and seed: presentation, and one run more
    change = ('name = "random"', 'name = "random"\nlabel = "random search"')
    more = run_study(write_study(3, change=change), jobs=1, out=tmp_path / "out", only="row 1/random search")
    kept = more.runs[more.runs["seed"] < 3]
    assert kept["run"].tolist() == first.runs["run"].tolist()
    assert kept["started_at"].tolist() == first.runs["started_at"].tolist()
    assert set(kept["identifier"]) == {"random search"}
    # another budget: other runs, and the old ones are not reported
    other = run_study(write_study(2, change=("budget = 40", "budget = 41")), **told)
    assert not set(other.runs["run"]) & set(first.runs["run"])
    assert set(other.runs["budget"]) == {41}
    # the first file again: nothing is left to do
    assert run_study(write_study(2), **told).runs.equals(first.runs)


def test_a_campaign_is_a_case_and_its_content_counts(write_study, tmp_path, stand):
    source = stand("--manoeuvres", "lower,empty", "--repeats", "2", "--duration", "0.3")
    shutil.copytree(source, tmp_path / "made")
    case = '[[cases]]\nname = "made"\ncampaign = "made"\nrecords = ["lower_2.csv", "empty.csv"]\n' + FIRST_CASE
    told = {"jobs": 1, "out": tmp_path / "out", "only": "made"}
    first = run_study(write_study(1, change=(FIRST_CASE, case)), **told)
    runs = first.runs.set_index("identifier")
    assert set(first.runs["status"]) == {"done"}
    # the records keep their own noise: the levels of the study do not multiply the runs
    assert len(first.runs) == RUNS_A_SEED / 4
    assert first.runs["noise_deg_s"].isna().all()
    assert (first.runs["holdout_rmse"] > 0.0).all()
    assert first.parameters["relative_error"].isna().all()
    assert first.settings_of(runs.loc["random", "run"])["campaign"]["records"] == ["lower_2.csv", "empty.csv"]
    text = (tmp_path / "made" / "lower_2.csv").read_text().splitlines()
    (tmp_path / "made" / "lower_2.csv").write_text("\n".join(text[:-1]) + "\n")
    changed = read_study(write_study(1, change=(FIRST_CASE, case)))
    assert not {p.run for p in changed.plan()} & set(first.runs["run"])


@pytest.mark.parametrize("file", [f for f in sorted(STUDIES.glob("*.toml")) if "[[identifiers]]" in f.read_text()],
                         ids=lambda f: f.stem)  # fmt: skip
def test_the_studies_of_the_project_can_be_read(file):
    study = read_study(file)
    assert next(study.plan()).case == study.cases[0].name


def test_the_store_tells_all_of_a_run(undisturbed):
    run = undisturbed.runs.iloc[-1]
    settings = undisturbed.settings_of(run["run"])
    assert (settings["case"], settings["seed"], settings["identifier"]) == (run["case"], run["seed"], run["identifier"])
    assert "speed_rate" in undisturbed.text_of(run["model"]) or "d omega" in undisturbed.text_of(run["model"])
    assert set(json.loads(undisturbed.text_of(run["versions"]))) >= {"armid", "numpy", "pymoo", "nlopt", "python"}
    trace = undisturbed.trace_of(run["run"])
    assert trace["value"].iloc[-1] == run["value"]
    assert trace["value"].is_monotonic_decreasing
    assert trace["evaluation"].iloc[0] == 1
    assert trace["evaluation"].iloc[-1] <= run["used"] <= run["budget"]
    best = undisturbed.parameters.set_index(["run", "parameter"]).loc[run["run"], "value"]
    assert trace.filter(like="x_").iloc[-1].tolist() == best.tolist()
    assert undisturbed.study["n_done"] == undisturbed.study["n_planned"] == len(undisturbed.runs)
    assert load_study(undisturbed.path).runs.equals(undisturbed.runs)
