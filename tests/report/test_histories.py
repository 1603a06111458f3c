"""One pass over the traces, against what a plain search finds."""

import numpy as np
import pytest
from armid.study.analyses.histories import ERROR_TARGETS, histories
from armid.study.analyses.outcomes import outcomes, truths_of


def test_hits_and_held_values_of_each_run(made):
    results = made(seeds=2, failed=1)
    found = outcomes(results.runs, results.parameters)
    kept = histories(results, found, truths_of(found, results.parameters))
    assert np.isinf(kept.error_hits[-1]).all()
    assert np.isinf(kept.values[-1]).all()
    for i, trace in list(enumerate(results.iter_traces()))[::7]:
        assert found.loc[i, "run"] == trace.run
        truth = np.array([results.study["cases"][int(found.loc[i, "case"][-1]) - 1]["truth"][n] for n in trace.names])
        errors = np.abs(trace.X / truth - 1.0).max(axis=1)
        for j, target in enumerate(ERROR_TARGETS):
            hit = next((e for e, d in zip(trace.evaluations, errors) if d <= target), np.inf)
            assert kept.error_hits[i, j] == hit
        assert kept.values[i, -1] == pytest.approx(trace.values[-1], rel=1e-6)
        assert kept.errors[i, -1] == pytest.approx(errors[-1], rel=1e-5)


def test_a_run_that_ends_within_a_tolerance_has_hit_it(made):
    results = made(seeds=3)
    found = outcomes(results.runs, results.parameters)
    kept = histories(results, found, truths_of(found, results.parameters))
    for j in (10, 15, 20):
        within = (found["largest_error"] <= ERROR_TARGETS[j] * (1 - 1e-9)).to_numpy()
        assert within.any()
        assert np.isfinite(kept.error_hits[within, j]).all()


def test_the_best_run_on_a_problem_reaches_the_strictest_share(made):
    """Whoever found the best fitness on a case, noise and seed has nothing left; nobody has more at the end."""
    results = made(seeds=2)
    found = outcomes(results.runs, results.parameters)
    kept = histories(results, found, truths_of(found, results.parameters))
    best = found.groupby(["case", "setting", "fitness", "seed"])["value"].idxmin()
    assert np.isfinite(kept.value_hits[best, -1]).all()
    assert np.isfinite(kept.value_hits[:, -1]).sum() == len(best)


def test_runs_that_came_in_later_are_left_out(made):
    """A runner may add runs while the report reads: traces of runs that are not in the table are no surprise."""
    results = made(seeds=2)
    found = outcomes(results.runs.iloc[:10], results.parameters)
    kept = histories(results, found, truths_of(found, results.parameters))
    assert len(kept.values) == 10


def test_unknown_truths_hit_nothing(made):
    results = made(seeds=1)
    found = outcomes(results.runs, results.parameters)
    assert np.isinf(histories(results, found, {}).error_hits).all()
