"""First hits of targets and values on a grid, against what a plain search of each trace finds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armid.study.analyses.analysis import TARGETS, first_hits, held, histories, outcomes, remaining_share
from armid.study.analyses.success import TOLERANCES

POINT = st.tuples(st.integers(1, 500), st.floats(0.0, 2.0))
SERIES = st.lists(POINT, min_size=1, max_size=20, unique_by=lambda p: p[0]).map(sorted)


@pytest.fixture(scope="module")
def kept(made):
    """Results of 60 runs, the last of which failed, their outcomes and their histories."""
    results = made(seeds=2, failed=1)
    runs = outcomes(results.runs, results.parameters)
    truths = {case["name"]: case["truth"] for case in results.study["cases"]}
    return results, runs, histories(results, runs, truths)


@given(SERIES)
def test_first_hits_and_held_values_are_what_a_search_from_the_left_finds(series):
    evaluations, values = (np.array(column) for column in zip(*series, strict=True))
    targets = np.array([1.5, 1.0, 0.3, 0.0])
    hits = [next((e for e, d in series if d <= t), np.inf) for t in targets]
    assert first_hits(evaluations, values, targets).tolist() == hits
    grid = np.array([1, 2, 10, 400, 1000])
    last = [next((v for e, v in reversed(series) if e <= g), np.inf) for g in grid]
    assert held(evaluations, values, grid) == pytest.approx(last)


def test_a_target_hit_and_left_again_is_hit_and_an_error_that_is_not_known_hits_nothing():
    assert first_hits(np.array([1, 5, 9]), np.array([0.5, 0.1, 0.4]), np.array([0.2, 0.01])).tolist() == [5.0, np.inf]
    assert first_hits(np.array([1, 5]), np.array([np.nan, np.nan]), np.array([1.0])).tolist() == [np.inf]


def test_the_tolerances_of_the_success_rates_are_targets():
    assert len(TARGETS) == 51
    assert all((np.abs(TARGETS / t - 1.0) < 1e-12).any() for t in TOLERANCES)


def test_a_share_is_the_convergence_test_of_more_and_wild():
    values, first, best = np.array([9.0, 5.0, 1.1, 1.0]), 9.0, 1.0
    shares = remaining_share(values, first, best)
    for tau in (0.5, 0.1, 0.01):
        assert ((shares <= tau) == (values <= best + tau * (first - best))).all()
    # a start that is the best already counts only what reaches it; no start is no progress
    assert remaining_share(np.array([2.0, 1.0]), 1.0, 1.0).tolist() == [np.inf, 0.0]
    assert remaining_share(np.array([2.0]), np.nan, 1.0).tolist() == [np.inf]


def test_hits_and_held_values_of_each_run(kept):
    results, runs, found = kept
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


def test_a_run_that_ends_within_a_tolerance_has_hit_it(kept):
    _, runs, found = kept
    for j in (10, 15, 20):
        within = (runs["largest_error"] <= TARGETS[j] * (1 - 1e-9)).to_numpy()
        assert within.any()
        assert np.isfinite(found.error_hits[within, j]).all()


def test_the_best_run_on_a_problem_reaches_the_strictest_share(kept):
    """Whoever found the best fitness on a case, noise and seed has nothing left; nobody has more at the end."""
    _, runs, found = kept
    best = runs.groupby(["case", "setting", "fitness", "seed"])["value"].idxmin()
    assert np.isfinite(found.value_hits[best, -1]).all()
    assert np.isfinite(found.value_hits[:, -1]).sum() == len(best)


def test_runs_that_came_in_later_are_left_out_and_unknown_truths_hit_nothing(kept):
    """A runner may add runs while the report reads: traces of runs that are not in the table are no surprise."""
    results, runs, _ = kept
    found = histories(results, runs.iloc[:10], {})
    assert len(found.values) == 10
    assert np.isinf(found.error_hits).all()
    assert np.isfinite(found.values[:, -1]).all()
