"""Success rates and their intervals."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from armid.study.analyses.success import success, success_figure, success_rates, wilson


def outcomes_with(errors):
    return pd.DataFrame({"setting": "noise-free", "variant": "pso", "largest_error": errors})


def closed_form(k, n, z=1.959963984540054):
    """Wilson's interval as its paper gives it."""
    p, middle = k / n, (k / n + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    return middle - half, middle + half


def test_wilson():
    for k, n in ((0, 25), (1, 25), (8, 10), (25, 25)):
        assert wilson(k, n) == pytest.approx(closed_form(k, n), abs=1e-12)


def test_at_the_tolerance_is_within_a_failed_run_is_no_success_and_an_unknown_truth_no_evidence():
    rates = success_rates(outcomes_with([1e-2, 0.0099, 0.02, np.inf, np.nan]), [1e-2, 1e-3])
    assert rates["successes"].tolist() == [2, 0]
    assert rates["n"].tolist() == [4, 4]
    assert rates["rate"].tolist() == [0.5, 0.0]


def test_table_shows_the_interval_in_percent():
    table = success(success_rates(outcomes_with([1e-5] * 8 + [1.0] * 2)))
    low, high = closed_form(8, 10)
    assert table.frame.loc[0, "within_1_percent_text"] == f"80.0 ({100 * low:.1f} to {100 * high:.1f})"


def test_figure_has_the_most_successful_on_top():
    frame = pd.concat([outcomes_with([1.0, 1e-5]), outcomes_with([1e-6, 1e-6]).assign(variant="de")])
    figure = success_figure(success_rates(frame))
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == ["de", "pso"]
    plt.close(figure)
