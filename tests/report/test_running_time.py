"""Expected running time."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from armid.study.analyses.histories import ERROR_TARGETS

from armid.study.analyses.running_time import expected_running_time, running_time, running_time_figure


def test_by_hand():
    hits = np.array([[10.0, np.inf], [np.inf, np.inf], [30.0, np.inf]])
    ert, successes = expected_running_time(hits, np.array([100.0, 50.0, 40.0]))
    assert ert.tolist() == [(10 + 50 + 30) / 2, np.inf]
    assert successes.tolist() == [2, 0]


def test_it_is_the_mean_cost_of_restarting_until_there_is_a_success():
    """Independent trials: success with p after h, else all of the budget; restarted until one succeeds."""
    rng = np.random.default_rng(3)
    p, hit, budget = 0.3, 40.0, 100.0
    hits = np.where(rng.random(20_000) < p, hit, np.inf)[:, np.newaxis]
    ert, _ = expected_running_time(hits, np.full(20_000, budget))
    assert ert[0] == pytest.approx(hit + (1 - p) / p * budget, rel=0.03)


def test_table_takes_the_tolerances_and_counts_hits():
    found = pd.DataFrame({"setting": "s", "variant": "pso", "used": [1000.0, 1000.0]})
    hits = np.full((2, 51), np.inf)
    hits[0, ERROR_TARGETS >= 1e-2 * (1 - 1e-9)] = 200.0
    frame = running_time(found, hits).frame
    assert frame.loc[0, "1 %"] == "1200 (50 %)"
    assert frame.loc[0, "0.1 %"] == "inf (0 %)"


def test_lines_end_where_no_run_hits_and_the_farthest_is_named_first():
    hits = np.full((4, 51), np.inf)
    hits[:, :10], hits[:2, :30] = 5.0, 7.0
    groups = {"s": {"near": (hits[2:], np.full(2, 9.0)), "far": (hits[:2], np.full(2, 9.0))}}
    figure = running_time_figure(groups, ERROR_TARGETS, {"near": 0, "far": 1}, "error")
    assert [t.get_text() for t in figure.axes[0].texts] == ["far", "near"]
    line = figure.axes[0].lines[0].get_ydata()
    assert np.isfinite(line).sum() == 10
    plt.close(figure)
