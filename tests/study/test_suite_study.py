"""A study of problems of the suite: plan, budgets, fitness, report in words, refusals."""

import json
import signal
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from armid.errors import ArmidError
from armid.estimation.identify import search
from armid.identifiers import IDENTIFIERS
from armid.problem.meter import Meter
from armid.problem.problem import IdentificationProblem
from armid.registry import load_registry
from armid.report.style import pyplot
from armid.study.analyses.analysis import TARGETS, first_hits, remaining_share
from armid.study.analyses.convergence import area_over_curve, attained
from armid.study.store import Store
from armid.study.tasks import read_study
from armid.study.tune import Tuned, proposed, ranges_of, training, tune, tuned_document, tuned_study
from commands import ended

STUDY = """\
name = "own"
plant = "shell_transfer_arm"
budget = 100
budget_per_parameter = [5, 30]
seeds = 2
{more}
[suite]
problems = ["arm", "arm_sh*"]
instances = [1, 2]
train = [3]
[[identifiers]]
name = "pso"
[[identifiers]]
name = "cmaes"
"""


@pytest.fixture
def written(tmp_path):
    def write(more="", **replaced):
        text = STUDY.format(more=more)
        for old, new in replaced.items():
            text = text.replace(old, new)
        file = tmp_path / "own.toml"
        file.write_text(text, encoding="utf-8")
        return file

    return write


def test_the_plan_has_each_problem_with_its_own_fitness_and_budgets_that_are_cut_or_for_each_parameter(written):
    study = read_study(written())
    planned = list(study.plan())
    assert study.case_names == [f"{name} {i}" for name in ("arm", "arm_shape", "arm_short") for i in (1, 2)]
    assert len(planned) == 6 * 2 * 2 * 2
    # 30 simulations for each of 4 parameters are more than the budget
    assert {run.budget for run in planned} == {20, 100}
    assert {(run.case.split()[0], run.fitness) for run in planned} == {
        ("arm", "rmse"), ("arm_shape", "shape_similarity"), ("arm_short", "rmse")
    }  # fmt: skip
    assert "48 runs, 2,880 simulations at most in all" in study.cost()
    study = read_study(written(**{"budget = 100\n": ""}))
    assert {run.budget for run in study.plan()} == {m * len(c.bounds) for c in study.cases for m in (5, 30)}
    assert [entry.largest_budget for entry in study.entries] == [30, 30]


@pytest.mark.parametrize(("replaced", "sentence"), [
    ({"arm_sh*": "am"}, "suite: the suite has no|there is no problem 'am'|problem 'am'"),
    ({"[1, 2]": "[16]"}, r"instances is \[16\], different ones from 1 to 15"),
    ({"[1, 2]": "[1, 1]"}, r"instances is \[1, 1\], different ones"),
    ({"[5, 30]": "[30, 5]"}, "budget_per_parameter"),
    ({"shell_transfer_arm": "driven_axis"}, "the suite brings its effects"),
    ({'name = "own"': 'name = "own"\nwindows_s = [[0.0, 0.3], "whole"]'}, "'windows_s' is given, but a problem"),
    ({'name = "own"': 'name = "own"\nfitness = "rmse"'}, "'fitness' is given, but a problem"),
    ({'name = "pso"': 'name = "pso"\nfitness = "rmse"'}, "'fitness' is given, but a problem"),
    ({'"cmaes"': '"least_squares"'}, "least_squares' needs residual vectors"),
])  # fmt: skip
def test_what_cannot_be_is_refused(written, replaced, sentence):
    with pytest.raises(ArmidError, match=sentence):
        read_study(written(**replaced))


def test_what_a_report_needs_of_an_instance_is_that_of_the_first_of_its_problem(written):
    cases = read_study(written()).description()["cases"]
    difficulties = {case["suite"]: case["difficulty"] for case in cases}
    assert difficulties == {"arm": "smooth", "arm_shape": "stair", "arm_short": "valley"}
    assert [case["landscape"] for case in cases[::2]] == [case["landscape"] for case in cases[1::2]]


def test_the_area_over_the_curve_by_hand_and_where_curves_end():
    hits = np.array([[1.0, 10.0], [100.0, np.inf], [1.0, 1.0]])
    np.testing.assert_allclose(area_over_curve(hits, np.array([100.0, 100.0, 1000.0])), [0.75, 0.0, 1.0])
    groups = {"10 D": {"pso": np.array([0])}, "100 D": {"pso": np.array([1])}}
    hits = SimpleNamespace(value_hits=np.array([[1.0, 8.0], [1.0, 80.0]]))
    evidence = SimpleNamespace(groups=groups, colours={"pso": 0}, histories=hits, n_free=np.array([4, 4]),
                               runs=pd.DataFrame({"budget": [40, 400]}))  # fmt: skip
    figure = attained(evidence)
    assert [axis.lines[0].get_xdata()[-1] for axis in figure.axes] == pytest.approx([10.0, 100.0])
    pyplot().close(figure)


SMALL = {'"arm_sh*"': '"arm_short"', "[5, 30]": "[2, 20]"}


@pytest.fixture
def watched(monkeypatch):
    """Runs that were handed out, and those that had ended then; the command is interrupted after so many runs."""
    seen = SimpleNamespace(handed=[], finished=[], started=[], press_after=0)

    def watch(counts, outcome):
        if outcome is None:
            seen.started.append(counts)
            return
        seen.finished.append(outcome.run)
        if len(seen.finished) == seen.press_after:
            signal.raise_signal(signal.SIGINT)

    def missing(store, missing=Store.missing):
        for each in missing(store):
            seen.handed.append((each.run, each.run in seen.finished))
            yield each

    monkeypatch.setattr(Store, "missing", missing)
    monkeypatch.setattr("armid.study.runner.progress_bar", lambda shown: nullcontext(watch))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield seen
    signal.signal(signal.SIGINT, before)


def area_of(entry, options, cases, seed):
    """The area over the curve of a search here, without study and store; mean over cases."""
    areas = []
    for problem in (case.suite for case in cases):
        known, meter = problem.identification, Meter(20 * problem.n_var)
        identifier = load_registry().identifier_of(entry.name).with_options(options)
        search(IdentificationProblem(known.space, known.replays, known.fitness, meter), meter, identifier, seed, None)
        start, trace = np.median(problem(problem.spread(64))), meter.trace()
        hits = first_hits(trace.evaluation, remaining_share(trace.value, start, problem.floor), TARGETS)
        areas.append(area_over_curve(hits[np.newaxis], np.array([20.0 * problem.n_var]))[0])
    return np.mean(areas)


@pytest.mark.nightly
def test_a_tuning_that_was_interrupted_ends_as_one_that_was_not(written, tmp_path, watched, capsys):
    pytest.importorskip("optuna")
    file, whole, broken = written(**SMALL), tmp_path / "whole", tmp_path / "broken"
    command = ("tune", file, "--configurations", 3, "--jobs", 1)
    assert ended(*command, "--out", whole) == 0
    ran = capsys.readouterr()
    assert "12 runs, 960 simulations at most in all" in ran.err
    assert ran.out.startswith("of 2 identifiers ")
    assert "12 of 12 are in " in ran.out
    # to who watches the three rounds are one study
    assert [(c.planned, c.done) for c in watched.started] == [(12, 0), (12, 4), (12, 8)]
    made = set(watched.finished)
    assert len(made) == len(watched.finished) == 12

    watched.finished.clear()
    watched.handed.clear()
    for watched.press_after in (5, 9):
        assert ended(*command, "--out", broken, "--json") == 130
        assert json.loads(capsys.readouterr().out)["tuned"] == {}
        assert not (broken / "tuned.toml").exists()
    assert 9 <= len(watched.finished) < 12
    watched.press_after = 0
    assert ended(*command, "--out", broken, "--json") == 0
    given = json.loads(capsys.readouterr().out)
    assert not any(had_ended for _, had_ended in watched.handed)
    assert sorted(watched.finished) == sorted(made)
    assert (broken / "tuned.toml").read_text() == (whole / "tuned.toml").read_text()

    tuned, first = read_study(broken / "tuned.toml"), training(read_study(file), 1)
    better = {entry.label.removesuffix(", tuned"): entry.options for entry in tuned.entries if entry.options}
    assert better, "of three configurations none is better than the defaults"
    assert (tuned.name, len(tuned.entries)) == ("own_tuned", 2 + len(better))
    for entry in first.entries:
        areas, options = given["areas"][entry.label], better.get(entry.label, {})
        assert given["tuned"][entry.label] == options
        assert areas["default"] == pytest.approx(area_of(entry, {}, first.cases, 1), abs=1e-12)
        assert areas["tuned"] == pytest.approx(area_of(entry, options, first.cases, 1), abs=1e-12)
        assert (areas["tuned"] > areas["default"]) == bool(options)


@pytest.mark.slow
def test_a_configuration_that_fails_or_comes_again_ends_no_tuning(written, tmp_path, monkeypatch):
    pytest.importorskip("optuna")
    ranges = {"pso": {"n_particles": (8, 8)}, "cmaes": {"no_such": (1.0, 2.0)}}
    monkeypatch.setattr("armid.study.tune.ranges_of", lambda identifier: ranges.get(identifier.name, {}))
    first = training(read_study(written(**SMALL)), 1)
    (swarm, cmaes), ending = tune(first, "own.toml", tmp_path / "out", 3, jobs=1)
    assert ending.counts == (2 * (2 + 3), 6, 4)
    assert "no_such" in ending.first_error
    assert swarm.options in ({}, {"n_particles": 8})
    assert (cmaes.options, cmaes.tuned) == ({}, cmaes.default)
    assert cmaes.default > 0.0


def test_proposals_follow_from_scores_and_seed_and_go_where_the_area_is():
    pytest.importorskip("optuna")
    known = [({"initial_step": float(x)}, -abs(np.log(x / 0.1))) for x in np.geomspace(0.005, 0.5, 30)]
    steps, swarm = (ranges_of(IDENTIFIERS[name]) for name in ("bobyqa", "pso"))
    found = [proposed(steps, known, (1, i))["initial_step"] for i in range(8)]
    assert found == [proposed(steps, known, (1, i))["initial_step"] for i in range(8)]
    assert len({*found, proposed(steps, known, (2, 0))["initial_step"]}) == 9
    assert 0.07 < np.median(found) < 0.14
    first = proposed(swarm, [], (1, 1))
    assert list(first) == list(swarm)
    assert all(low <= first[name] <= high for name, (low, high) in swarm.items())
    assert isinstance(first["n_particles"], int)


def test_a_tuned_identifier_has_the_budgets_and_seeds_of_the_one_as_it_is(written, tmp_path):
    own = 'name = "cmaes"\nbudget = 60\nbudget_per_parameter = 8\nseeds = [4]'
    study = read_study(written(**{'name = "cmaes"': own, 'name = "own"': "name='own'  # mine"}))
    found = [Tuned("pso", {"c1": 1.5}, 0.1, 0.2), Tuned("cmaes", {"growth": 2.0}, 0.1, 0.2)]
    file = tmp_path / "tuned.toml"
    file.write_text(tuned_study(study, found))
    tuned = read_study(file)
    assert tuned.name == "own_tuned"
    assert tuned.labels == ["pso", "cmaes", "pso, tuned", "cmaes, tuned"]
    for before, after in zip(tuned.entries[:2], tuned.entries[2:]):
        assert (after.name, after.budget, after.budget_per_parameter, after.seeds) == (
            before.name, before.budget, before.budget_per_parameter, before.seeds
        )  # fmt: skip
    assert [dict(entry.options) for entry in tuned.entries[2:]] == [{"c1": 1.5}, {"growth": 2.0}]
    file.write_text(tuned_study(tuned, [Tuned("pso", {"c1": 1.7}, 0.2, 0.3)]))
    assert read_study(file).labels[-1] == "pso, tuned again"


def test_no_tuning_without_its_package_or_while_another_is_at_its_runs(written, tmp_path, monkeypatch):
    pytest.importorskip("optuna")
    first = training(read_study(written()), 1)
    with Store(tmp_path / "out"), pytest.raises(ArmidError, match="another process is at the runs of"):
        tune(first, "own.toml", tmp_path / "out", 2)
    monkeypatch.setattr("armid.study.tune.find_spec", lambda name: None)
    with pytest.raises(ArmidError, match=r"needs the package optuna.*pip install 'armid\[suite\]'"):
        tune(first, "own.toml", tmp_path / "out", 2)


def test_the_answer_of_a_tuning(written):
    found = [Tuned("pso", {"c1": 1.2345, "n_particles": 20}, 0.41, 0.55), Tuned("de", {}, 0.3, 0.3)]
    study = read_study(written())
    document = tuned_document(study, found)
    gain = "of 2 identifiers 1 is better tuned; the largest gain is pso, area 0.410 to 0.550"
    assert document.said == [f"{gain}; nothing to tune in cmaes"]
    cells = [[cell.text for cell in row] for row in document.main_tables[0].cells()]
    assert cells == [["pso", "0.410", "0.550", "c1 = 1.23, n_particles = 20"], ["de", "0.300", "0.300", ""]]
    (said,) = tuned_document(study, found[1:]).said
    assert said == "of 1 identifiers none is better tuned; nothing to tune in pso and cmaes"


def test_tuning_takes_the_largest_budget_and_each_identifier_once_and_what_it_refuses(written):
    study = read_study(written(**{'name = "cmaes"': 'name = "pso"\nlabel = "again"'}))
    first = training(study, 7)
    assert first.labels == ["pso"]
    assert first.case_names == ["arm 3", "arm_shape 3", "arm_short 3"]
    assert [(run.budget, run.seed) for run in first.plan()] == [(100, 7)] * 3
    with pytest.raises(ArmidError, match="arm 2 is in train and in instances"):
        training(read_study(written(**{"train = [3]": "train = [2]"})), 1)
    with pytest.raises(ArmidError, match=r"train is \[\], different ones"):
        training(read_study(written(**{"train = [3]": ""})), 1)
    none = {'"pso"': '"random"', '"cmaes"': '"sobol"'}
    with pytest.raises(ArmidError, match="has nothing to tune, one of pso, pymoo_pso, "):
        training(read_study(written(**none)), 1)
    rest = '[[identifiers]]\nname = "pso"\n[[identifiers]]\nname = "cmaes"\n'
    study = read_study(written('identifiers = [{ name = "pso" }, { name = "cmaes" }]', **{rest: ""}))
    with pytest.raises(ArmidError, match=r"in one line: tables headed \[\[identifiers\]\] are expected"):
        training(study, 1)
