"""Data profiles."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from armid.study.analyses.ecdf import data_profile_figure
from armid.study.analyses.histories import data_profile, remaining_share


def test_by_hand():
    hits, n = np.array([10.0, 50.0, np.inf]), np.array([4, 4, 9])
    assert data_profile(hits, n, np.array([1.0, 2.0, 9.9, 10.0, 1e9])) == pytest.approx([0, 1 / 3, 1 / 3, 2 / 3, 2 / 3])


def test_a_share_is_the_convergence_test_of_more_and_wild():
    values, first, best = np.array([9.0, 5.0, 1.1, 1.0]), 9.0, 1.0
    shares = remaining_share(values, first, best)
    for tau in (0.5, 0.1, 0.01):
        assert ((shares <= tau) == (values <= best + tau * (first - best))).all()


def test_a_start_that_is_the_best_already_counts_only_what_reaches_it():
    assert remaining_share(np.array([2.0, 1.0]), 1.0, 1.0).tolist() == [np.inf, 0.0]


def test_no_start_is_no_progress():
    assert remaining_share(np.array([2.0]), np.nan, 1.0).tolist() == [np.inf]


def test_one_panel_a_setting_and_tolerance():
    hits = np.full((3, 51), 20.0)
    problems = {"a": (hits, np.array([4, 4, 4]))}
    figure = data_profile_figure({"noise-free": problems, "0.3 deg/s": problems}, 3000, {"a": 0})
    titles = [axis.get_title() for axis in figure.axes]
    assert titles == [f"{s}, {t} left" for s in ("noise-free", "0.3 deg/s") for t in ("0.1", "0.001", "1e-05")]
    plt.close(figure)
