"""A study of problems of the suite: plan, budgets, fitness, report in words, refusals."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from armid.errors import ArmidError
from armid.report.style import pyplot
from armid.study.analyses.analysis import Evidence
from armid.study.analyses.convergence import area_over_curve, attained
from armid.study.document import report_of
from armid.study.results import load_study
from armid.study.runner import run_study
from armid.study.tasks import read_study
from armid.study.tune import score, training, tunable, tune, tuned_study

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


def test_the_plan_has_each_problem_with_its_own_fitness_and_budgets_that_are_cut(written):
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


@pytest.mark.parametrize(("replaced", "sentence"), [
    ({"arm_sh*": "am"}, "suite: the suite has no|there is no problem 'am'|problem 'am'"),
    ({"[1, 2]": "[16]"}, r"instances is \[16\], different ones from 1 to 15"),
    ({"[1, 2]": "[1, 1]"}, r"instances is \[1, 1\], different ones"),
    ({"[5, 30]": "[30, 5]"}, "budget_per_parameter"),
    ({"shell_transfer_arm": "driven_axis"}, "the suite brings its effects"),
    ({'"cmaes"': '"least_squares"'}, "least_squares' needs residual vectors"),
])  # fmt: skip
def test_what_cannot_be_is_refused(written, replaced, sentence):
    with pytest.raises(ArmidError, match=sentence):
        read_study(written(**replaced))


@pytest.mark.slow
def test_a_report_in_words(written, tmp_path):
    results = run_study(written(), jobs=1, out=tmp_path / "out")
    assert set(results.runs["status"]) == {"done"}
    evidence = Evidence(load_study(tmp_path / "out"))
    assert evidence.settings == ["5 D", "30 D"]
    document = report_of(results)
    assert [s.title for s in document.sections][:2] == ["Ranks by class of difficulty", "At any time"]
    first, second, easy = document.said[:3]
    assert first.startswith("Budget 5 D, 6 cases: best is ")
    assert "the paper's swarm (pso) comes" in second
    assert "identifiers are best in some class" in easy
    # by hand: the mean rank is that of the medians over the seeds
    table = document.main[0].frame
    assert table.groupby("setting")["rank"].sum().tolist() == [3.0, 3.0]
    problems = document.sections[0].parts[2].frame
    assert problems["problem"].tolist() == ["arm", "arm_shape", "arm_short"]
    assert problems["class"].tolist() == ["smooth", "stair", "valley"]
    again = run_study(written(), jobs=1, out=tmp_path / "out")
    assert len(again.runs) == 48


def test_the_area_over_the_curve_by_hand():
    hits = np.array([[1.0, 10.0], [100.0, np.inf], [1.0, 1.0]])
    np.testing.assert_allclose(area_over_curve(hits, np.array([100.0, 100.0, 1000.0])), [0.75, 0.0, 1.0])


def test_curves_end_where_the_budget_of_their_setting_does():
    groups = {"10 D": {"pso": np.array([0])}, "100 D": {"pso": np.array([1])}}
    hits = SimpleNamespace(value_hits=np.array([[1.0, 8.0], [1.0, 80.0]]))
    evidence = SimpleNamespace(groups=groups, colours={"pso": 0}, histories=hits, n_free=np.array([4, 4]),
                               runs=pd.DataFrame({"budget": [40, 400]}))  # fmt: skip
    figure = attained(evidence)
    assert [axis.lines[0].get_xdata()[-1] for axis in figure.axes] == pytest.approx([10.0, 100.0])
    pyplot().close(figure)


@pytest.mark.slow
def test_tuning_learns_on_other_instances_and_gives_a_study_that_runs(written, tmp_path):
    pytest.importorskip("optuna")
    study = read_study(written())
    cases = training(study)
    assert [case.name for case in cases] == ["arm 3", "arm_shape 3", "arm_short 3"]
    (swarm, cmaes) = tunable(study)
    found = [tune(entry, study, cases, 6, 1) for entry in (swarm, cmaes)]
    assert all(each.tuned >= each.default for each in found)
    assert found[0] == tune(swarm, study, cases, 6, 1)
    better = [each for each in found if each.options]
    assert better, "of six configurations none is better than the defaults"
    for each in better:
        assert score(swarm if each.label == "pso" else cmaes, study, cases, each.options, 1) == each.tuned
    file = tmp_path / "tuned.toml"
    file.write_text(tuned_study(study, found), encoding="utf-8")
    tuned = read_study(file)
    assert tuned.name == "own_tuned"
    assert tuned.labels == ["pso", "cmaes", *(f"{each.label}, tuned" for each in better)]


def test_tuning_refuses_what_it_would_be_tested_on(written):
    with pytest.raises(ArmidError, match="arm 2 is in train and in instances"):
        training(read_study(written(**{"train = [3]": "train = [2]"})))
    with pytest.raises(ArmidError, match=r"train is \[\], different ones"):
        training(read_study(written(**{"train = [3]": ""})))
