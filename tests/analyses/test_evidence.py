"""What analyses are given: names under which runs are compared, largest errors, first hits and values on a grid."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_results import made

from armid.study.analyses.analysis import (
    TARGETS,
    Evidence,
    budget_texts,
    first_hits,
    held,
    histories,
    ordered,
    outcomes,
    remaining_share,
    wide_runs,
)
from armid.study.analyses.convergence import SUCCESS_TOLERANCES


def test_labels_and_settings_tell_what_differs():
    one, two = made(seeds=1), made(seeds=1, fitness=("rmse", "similarity"))
    assert set(outcomes(one.runs, one.parameters, "rad/s")["variant"]) == {"pso", "cmaes", "de+bobyqa"}
    assert "pso on rmse" in set(outcomes(two.runs, two.parameters, "rad/s")["variant"])
    one, two = made(seeds=1), made(seeds=1, windows=("0-0.7 s", "whole"))
    assert set(outcomes(one.runs, one.parameters, "rad/s")["setting"]) == {"noise-free", "0.3 deg/s"}
    assert "0.3 deg/s, whole" in set(outcomes(two.runs, two.parameters, "rad/s")["setting"])
    own = outcomes(one.runs.assign(noise_deg_s=np.nan), one.parameters, "rad/s")
    assert set(own["setting"]) == {"as recorded"}


def test_budgets_rise_and_one_that_another_key_cuts_says_so():
    results = made(seeds=1, noises=(0.3,))
    runs = pd.concat([results.runs.assign(budget=budget) for budget in (800, 40)])
    results.study["cases"] = [case | {"bounds": dict.fromkeys("abcd")} for case in results.study["cases"]]
    study = results.study | {"budget_per_parameter": [10, 1000]}
    assert set(budget_texts(runs, study)) == {"10 D", "1000 D, at most 800"}
    own = ordered(runs, study).groupby(["identifier", "case"])["budget"]
    assert set(own.agg(tuple)) == {(40, 800)}


def test_largest_error_is_of_known_truths_and_infinite_for_a_failed_run():
    results = made(seeds=1, failed=2)
    runs = outcomes(results.runs, results.parameters, "rad/s")
    assert np.isinf(runs["largest_error"].iloc[-2:]).all()
    by_run = results.parameters.set_index(["run", "parameter"])["relative_error"].unstack()
    done = runs["run"].iloc[:-2]
    assert runs["largest_error"].iloc[:-2].tolist() == by_run.max(axis=1).loc[done].tolist()
    rows = results.parameters.copy()
    rows.loc[rows["parameter"] != "k", ["truth", "relative_error"]] = np.nan
    assert outcomes(results.runs, rows, "rad/s")["largest_error"].iloc[:-2].tolist() == by_run["k"].loc[done].tolist()
    unknown = outcomes(results.runs, rows.assign(relative_error=np.nan), "rad/s")["largest_error"]
    assert unknown.iloc[:-2].isna().all()


def test_the_papers_swarm_and_the_best_of_the_others_are_of_interest():
    identifiers = {"pso, x": 1e-2, "pso+bobyqa": 1e-5, "a": 1e-1, "b": 1e-4, "c": 1e-3}
    evidence = Evidence(made(seeds=3, noises=(0.0,), identifiers=identifiers))
    assert evidence.interesting == ["pso, x", "pso+bobyqa", "b", "c"]
    assert evidence.best_first == ["pso+bobyqa", "b", "c", "pso, x", "a"]


def test_an_analysis_of_a_user_gets_the_columns_that_the_docstring_shows():
    results = made(seeds=1, failed=1)
    wide, listed = wide_runs(Evidence(results)), str(wide_runs.__doc__).split("=\n")[1]
    shown = {name for line in listed.splitlines() for name in line.strip().partition("  ")[0].split(", ")}
    ends = ("", "_truth", "_error", "_deviation", "_at_bound")
    own = {f"{name}{end}" for name in ("p0", "k", "eta3", "n") for end in ends}
    assert set(wide.columns) - own == {name for name in shown if name and "NAME" not in name and set(name) != {"="}}
    row = wide[wide["status"] == "done"].iloc[0]
    rows = results.parameters[results.parameters["run"] == row["run"]].set_index("parameter")
    assert row["k"] == rows.loc["k", "value"]
    assert row["n_error"] == pytest.approx(abs(row["n"] / row["n_truth"] - 1.0))
    assert np.isnan(wide.loc[wide["status"] == "failed", "k"]).all()


POINT = st.tuples(st.integers(1, 500), st.floats(0.0, 2.0))
SERIES = st.lists(POINT, min_size=1, max_size=20, unique_by=lambda p: p[0]).map(sorted)


@given(SERIES)
def test_first_hits_and_held_values_are_what_a_search_from_the_left_finds(series):
    evaluations, values = (np.array(column) for column in zip(*series, strict=True))
    targets = np.array([1.5, 1.0, 0.3, 0.0])
    hits = [next((e for e, d in series if d <= t), np.inf) for t in targets]
    assert first_hits(evaluations, values, targets).tolist() == hits
    grid = np.array([1, 2, 10, 400, 1000])
    last = [next((v for e, v in reversed(series) if e <= g), np.inf) for g in grid]
    assert held(evaluations, values, grid) == pytest.approx(last)


def test_the_tolerances_of_the_success_rates_are_targets_and_a_share_is_that_of_more_and_wild():
    assert len(TARGETS) == 51
    assert all((np.abs(TARGETS / t - 1.0) < 1e-12).any() for t in SUCCESS_TOLERANCES)
    values, first, best = np.array([9.0, 5.0, 1.1, 1.0]), 9.0, 1.0
    shares = remaining_share(values, first, best)
    for tau in (0.5, 0.1, 0.01):
        assert ((shares <= tau) == (values <= best + tau * (first - best))).all()
    # a start that is the best already counts only what reaches it; no start is not progress
    assert remaining_share(np.array([2.0, 1.0]), 1.0, 1.0).tolist() == [np.inf, 0.0]
    assert remaining_share(np.array([2.0]), np.nan, 1.0).tolist() == [np.inf]


def test_hits_and_held_values_of_each_run_of_the_best_and_without_those_that_came_in_later():
    results = made(seeds=2, failed=1)
    runs = outcomes(results.runs, results.parameters, "rad/s")
    truths = {case["name"]: case["truth"] for case in results.study["cases"]}
    found = histories(results, runs, truths, {})
    assert np.isinf(found.error_hits[-1]).all()
    assert np.isinf(found.values[-1]).all()
    for i, trace in list(enumerate(results.iter_traces()))[::7]:
        assert runs.loc[i, "run"] == trace.run
        truth = np.array([results.study["cases"][int(runs.loc[i, "case"][-1]) - 1]["truth"][n] for n in trace.names])
        errors = np.abs(trace.X / truth - 1.0).max(axis=1)
        for j, target in enumerate(TARGETS):
            hit = next((e for e, d in zip(trace.evaluations, errors) if d <= target), np.inf)
            assert found.error_hits[i, j] == hit
        assert found.values[i, -1] == pytest.approx(trace.values[-1], rel=1e-6)
        assert found.errors[i, -1] == pytest.approx(errors[-1], rel=1e-5)
    # Whoever found the best fitness on a case, noise and seed has nothing left; nobody has more at the end.
    best = runs.groupby(["case", "setting", "fitness", "seed"])["value"].idxmin()
    assert np.isfinite(found.value_hits[best, -1]).all()
    assert np.isfinite(found.value_hits[:, -1]).sum() == len(best)
    # A runner may add runs while the report reads: traces of runs that are not in the table are no surprise.
    found = histories(results, runs.iloc[:10], {}, {})
    assert len(found.values) == 10
    assert np.isinf(found.error_hits).all()
    assert np.isfinite(found.values[:, -1]).all()
