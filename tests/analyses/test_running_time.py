"""Expected running times, and ECDFs over runs and targets."""

from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armid.study.analyses.analysis import TARGETS
from armid.study.analyses.running_time import (
    ecdf_figure,
    expected_running_time,
    running_time,
    running_time_figure,
    share_hit,
)

HIT = st.one_of(st.integers(1, 100).map(float), st.just(np.inf))
HITS = st.lists(st.lists(HIT, min_size=3, max_size=3), min_size=1)


def test_share_hit_by_hand():
    hits = np.array([[1.0, 10.0], [5.0, np.inf]])
    assert share_hit(hits, np.array([1, 4, 5, 10, 99])).tolist() == [0.25, 0.25, 0.5, 0.75, 0.75]


@given(HITS)
def test_the_share_rises_and_ends_at_what_is_ever_hit(rows):
    hits = np.array(rows)
    shares = share_hit(hits, np.arange(1, 101))
    assert (np.diff(shares) >= 0.0).all()
    assert shares[-1] == np.isfinite(hits).mean()


def test_running_time_by_hand():
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
    evidence = SimpleNamespace(runs=pd.DataFrame({"setting": "s", "variant": ["pso"] * 2}), used=np.full(2, 1000.0))
    hits = np.full((2, 51), np.inf)
    hits[0, TARGETS >= 1e-2 * (1 - 1e-9)] = 200.0
    frame = running_time(evidence, hits, {"1 %": 1e-2, "0.1 %": 1e-3}, "t", "", "").frame
    assert frame.loc[0, "1 %"] == "1200 (50 %)"
    assert frame.loc[0, "0.1 %"] == "inf (0 %)"


def test_lines_end_where_no_run_hits_and_are_named_in_the_order_of_their_ends():
    hits = np.full((4, 51), np.inf)
    hits[:, :10], hits[:2, :30] = 5.0, 7.0
    evidence = SimpleNamespace(
        groups={"s": {"near": np.array([2, 3]), "far": np.array([0, 1])}}, colours={"near": 0, "far": 1},
        used=np.full(4, 9.0), histories=SimpleNamespace(grid=np.array([1, 10, 100]), error_hits=hits),
    )  # fmt: skip
    figure = running_time_figure(evidence, hits, TARGETS, "error")
    assert [t.get_text() for t in figure.axes[0].texts] == ["far", "near"]
    assert np.isfinite(figure.axes[0].lines[0].get_ydata()).sum() == 10
    plt.close(figure)
    figure = ecdf_figure(evidence)
    names = sorted(figure.axes[0].texts, key=lambda t: t.get_position()[1])
    assert [t.get_text() for t in names] == ["near", "far"]
    plt.close(figure)
