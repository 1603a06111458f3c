"""Where the noise decides ranks stop, and the first sentence of a study answers the question of its kind."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from made_results import PAPER_CASES, made

from armid.study.analyses.analysis import Evidence
from armid.study.analyses.overview import answer_of, main_table
from armid.study.analyses.ranks import RANKS, arrived, rank_tests, steps_of, suite_answer, tied
from armid.study.document import report_of


def on_the_same_noise(offsets, **more):
    """Return evidence in which each identifier ends so many Cramer-Rao deviations from the minimum of its noise."""
    results = made(identifiers=dict.fromkeys(offsets, 1e-9), noises=(0.3,), **more)
    runs, rows = results.runs, results.parameters.merge(results.runs[["run", "case", "seed", "identifier"]], on="run")
    draws = {key: np.random.default_rng(i).normal() for i, key in enumerate(sorted({*zip(rows["case"], rows["seed"])}))}
    noise = np.array([draws[key] for key in zip(rows["case"], rows["seed"])])
    offset = rows["identifier"].map(offsets).to_numpy()
    rows["value"] = rows["truth"] + (np.abs(noise) + 1.0 + offset) * rows["deviation"]
    rows["relative_error"] = (rows["value"] / rows["truth"] - 1.0).abs()
    runs["value"] = 1.0 + runs["identifier"].map(offsets).abs()
    return Evidence(replace(results, runs=runs, parameters=rows.drop(columns=["case", "seed", "identifier"])))


def test_differences_below_a_hundredth_of_the_bound_are_ties_in_chains_and_arrivals_are_counted():
    evidence = on_the_same_noise({"exact": 0.0, "near": 0.004, "far": 0.5})
    steps = steps_of(evidence, "0.3 deg/s")
    assert list(steps.values()) == pytest.approx([0.01 * 2e-3] * 5)
    tests = rank_tests(evidence.of("0.3 deg/s"), steps)
    assert tests.ranks.to_dict() == {"exact": 1.5, "near": 1.5, "far": 3.0}
    assert rank_tests(evidence.of("0.3 deg/s")).ranks["near"] == 2.0
    assert arrived(evidence, "0.3 deg/s").to_dict() == {"exact": 1.0, "near": 1.0, "far": 0.0}
    text, ranks, *_ = RANKS.parts(evidence)
    said = "0.3 deg/s: 2 of the 3 identifiers that share a fitness arrive at its lowest value in most runs."
    assert said in text.text
    assert ranks.frame["arrived"].tolist() == [1.0, 1.0, 0.0]
    blocks = pd.DataFrame([[1.0, 1.4, 1.8, 3.0], [1.0, 1.4, 1.8, np.inf]], index=["a", "b"], columns=[*"wxyz"])
    assert tied(blocks, {"a": 0.5}).loc["a"].tolist() == [1.0, 1.0, 1.0, 3.0]
    assert tied(blocks, {"a": 0.5}).loc["b"].tolist() == [1.0, 1.4, 1.8, np.inf]


def test_the_answer_says_who_is_best_with_noise_who_is_like_it_and_where_a_plugin_stands():
    cases = [{"name": f"case {i}", "truth": {"p0": 3e6, "k": 0.8, "eta3": 0.6, "n": 1.2}} for i in range(12)]
    evidence = on_the_same_noise({"exact": 0.0, "near": 0.004, "mine": 0.5}, cases=cases, seeds=2)
    evidence.study["plugins"] = ["folder/mine.py:mine"]
    first, yours = answer_of(evidence, main_table(evidence))
    assert first.startswith("Best: 0.3 deg/s: exact (mean rank 1.5 of 3 over 12 cases), largest error of a run ")
    assert "; the tests cannot tell near from it; 2 of the 3 identifiers that share a fitness arrive" in first
    assert yours.startswith("Your own: mine is number 3 of 3 (0.3 deg/s, ")


def test_no_answer_tells_of_the_case_without_noise_first():
    for study in ({"report": "table1"}, {"fitness": ("similarity", "rmse")}, {}):
        evidence = Evidence(made(noises=(0.0, 0.3), seeds=2, **study))
        answer = answer_of(evidence, main_table(evidence))
        assert "0.3 deg/s" in answer[0]
        assert answer[0].find("0.3 deg/s") < answer[0].find("noise-free") or "noise-free" not in answer[0]
        if "fitness" in study:
            assert re.match(r"Largest error of a run by fitness, median.* 0.3 deg/s: (rmse|similarity) ", answer[0])


def test_the_answer_to_table_2_is_how_repeats_agree_and_what_is_off():
    results = made(report="table2", noises=(0.3,), identifiers={"pso": 1e-3, "cmaes": 1e-5})
    rows = results.parameters
    is_eta = rows["parameter"] == "eta3"
    rows.loc[is_eta, "value"] = 1.1 * rows.loc[is_eta, "truth"]
    evidence = Evidence(replace(results, parameters=rows))
    said = answer_of(evidence, main_table(evidence))[0]
    assert re.match(r"Repeats on a record agree to [\d.e-]+ % with cmaes, to [\d.]+ % with pso \(0.3 deg/s", said)
    why = "since the model lacks an effect of these records"
    assert said.endswith(f"off is eta3 by 10 %, {why}.")


def test_a_study_that_was_cut_off_after_its_first_case_has_an_answer_and_ranks_nobody():
    results = made(seeds=2)
    runs = results.runs
    is_common = (runs["case"] == runs["case"].iloc[0]) | (runs["identifier"] == runs["identifier"].iloc[0])
    kept = runs[is_common]
    rows = results.parameters[results.parameters["run"].isin(kept["run"])]
    evidence = Evidence(replace(results, runs=kept, parameters=rows))
    assert len(evidence.cases) > 1
    assert rank_tests(evidence.of("0.3 deg/s")).n_cases == 1
    (answer,) = answer_of(evidence, main_table(evidence))
    assert answer.startswith("Best: 0.3 deg/s: ")
    assert "the tests" not in answer
    (text,) = RANKS.parts(evidence)
    assert "arrive" not in text.text


def test_a_plug_in_whose_runs_fail_is_named_with_its_first_error():
    results = made(seeds=2, failed=3, identifiers={"exact": 0.0, "mine": 0.1})
    evidence = Evidence(replace(results, study=results.study | {"plugins": ["folder/mine.py:mine"]}))
    yours = answer_of(evidence, main_table(evidence))[-1]
    assert yours.endswith("; 3 of 20 runs failed, the first of mine: it broke in the middle.")


def test_the_report_of_a_suite_says_who_cannot_be_told_from_the_best_and_where_the_own_stands():
    landscape = dict.fromkeys(("n_records", "noise_deg_s", "valley", "stair", "plateau", "minima", "holes"), 1.0)
    cases = [{**PAPER_CASES[i % 5], "name": f"p{i}", "suite": f"p{i}", "difficulty": "valley", "floor": 0.0,
              "landscape": landscape, "bounds": {key: [0, 1] for key in "abcd"}} for i in range(12)]  # fmt: skip
    results = made(cases=cases, noises=(0.0,), seeds=2, budget=400,
                   identifiers={"cmaes": 1e-5, "near": 1e-5, "mine": 1e-3, "pso": 1e-2})  # fmt: skip
    results.study |= {"budget_per_parameter": [100], "plugins": ["mine.py:mine"]}
    results.runs["noise_deg_s"] = np.nan
    evidence = Evidence(results)
    (said,) = suite_answer(evidence)
    best, other = ("cmaes", "near") if "best is cmaes" in said else ("near", "cmaes")
    assert f"best is {best}" in said
    assert f"; the tests cannot tell {other} from it. Your own" in said
    assert "Your own mine is number 3 of " in said
    assert "The paper's swarm (pso) is number 4 of " in said
    assert "better than 0, worse than " in said.partition("The paper's swarm")[2]
    # two identifiers do not tell whether the suite is easy
    assert "too easy" not in said
    results.study["plugins"] = []
    document = report_of(results)
    assert "Your own" not in document.said[0]
    assert evidence.settings == ["100 D"]
    assert [s.title for s in document.sections][:2] == ["Ranks by class of difficulty", "At any time"]
    assert document.main[0].frame["rank"].sum() == 1 + 2 + 3 + 4
    assert document.sections[0].parts[2].frame["problem"].tolist() == [case["suite"] for case in cases]
