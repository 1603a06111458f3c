"""Names under which runs are compared, their largest error, and what analyses are given."""

import numpy as np
import pytest

from armid.contract.check import synthetic_runs
from armid.study.analyses.analysis import Evidence, outcomes, published_values, wide_runs


def test_a_label_on_one_fitness_keeps_its_name_and_on_several_tells_which(made):
    one, two = made(seeds=1), made(seeds=1, fitness=("rmse", "similarity"))
    assert set(outcomes(one.runs, one.parameters)["variant"]) == {"pso", "cmaes", "de+bobyqa"}
    assert "pso on rmse" in set(outcomes(two.runs, two.parameters)["variant"])


def test_settings(made):
    one, two = made(seeds=1), made(seeds=1, windows=("0-0.7 s", "whole"))
    assert set(outcomes(one.runs, one.parameters)["setting"]) == {"noise-free", "0.3 deg/s"}
    assert "0.3 deg/s, whole" in set(outcomes(two.runs, two.parameters)["setting"])
    own = outcomes(one.runs.assign(noise_deg_s=np.nan), one.parameters)
    assert set(own["setting"]) == {"as recorded"}


def test_largest_error_is_of_known_truths_and_infinite_for_a_failed_run(made):
    results = made(seeds=1, failed=2)
    runs = outcomes(results.runs, results.parameters)
    assert np.isinf(runs["largest_error"].iloc[-2:]).all()
    by_run = results.parameters.set_index(["run", "parameter"])["relative_error"].unstack()
    done = runs["run"].iloc[:-2]
    assert runs["largest_error"].iloc[:-2].tolist() == by_run.max(axis=1).loc[done].tolist()
    rows = results.parameters.copy()
    rows.loc[rows["parameter"] != "k", ["truth", "relative_error"]] = np.nan
    assert outcomes(results.runs, rows)["largest_error"].iloc[:-2].tolist() == by_run["k"].loc[done].tolist()
    unknown = outcomes(results.runs, rows.assign(relative_error=np.nan))["largest_error"]
    assert unknown.iloc[:-2].isna().all()


def test_the_papers_swarm_and_the_best_of_the_others_are_of_interest(made):
    identifiers = {"pso, x": 1e-2, "pso+bobyqa": 1e-5, "a": 1e-1, "b": 1e-4, "c": 1e-3}
    evidence = Evidence(made(seeds=3, noises=(0.0,), identifiers=identifiers))
    assert evidence.interesting == ["pso, x", "pso+bobyqa", "b", "c"]
    assert evidence.best_first == ["pso+bobyqa", "b", "c", "pso, x", "a"]


def test_groups_are_the_positions_of_runs_and_failed_runs_count_their_budget(made):
    evidence = Evidence(made(seeds=2, failed=1))
    for setting, variants in evidence.groups.items():
        for variant, rows in variants.items():
            own = evidence.runs.iloc[rows]
            assert set(own["setting"]) == {setting}
            assert set(own["variant"]) == {variant}
    assert sum(len(rows) for of in evidence.groups.values() for rows in of.values()) == len(evidence.runs)
    failed = int(np.flatnonzero(evidence.runs["status"] != "done")[0])
    assert (evidence.used[failed], evidence.n_free[failed]) == (3000.0, 4)


def test_mean_errors_of_table_1_as_the_paper_prints_them(table1_cases):
    published = published_values({"cases": table1_cases})
    means = 100.0 * published.groupby("parameter")["relative_error"].mean()
    assert means.round(3).to_dict() == {"p0": 0.487, "k": 0.421, "eta3": 0.171, "n": 0.899}


def test_an_analysis_of_a_user_gets_the_columns_that_its_contract_shows(made):
    results = made(seeds=1, failed=1)
    wide, shown = wide_runs(Evidence(results)), synthetic_runs()
    ends = ("", "_truth", "_error", "_deviation", "_at_bound")
    own = {f"{name}{end}" for name in ("eta3", "n") for end in ends}
    assert set(wide.columns) - own == set(shown.columns)
    row = wide[wide["status"] == "done"].iloc[0]
    rows = results.parameters[results.parameters["run"] == row["run"]].set_index("parameter")
    assert row["k"] == rows.loc["k", "value"]
    assert row["n_error"] == pytest.approx(abs(row["n"] / row["n_truth"] - 1.0))
    assert np.isnan(wide.loc[wide["status"] == "failed", "k"]).all()
