"""Scatter over the Cramer-Rao bound."""

import numpy as np
import pandas as pd
import pytest

from armid.report.style import pyplot
from armid.study.analyses.cramer_rao import cramer_rao_figure, efficiencies, efficiency, summary


def test_by_hand_and_a_robust_ratio_that_single_lost_runs_do_not_move():
    found = efficiency([1.0, 2.0, 3.0, 6.0], truth=2.0, bound=2.0)
    assert found["n"] == 4
    assert found["ratio"] == pytest.approx(np.sqrt(14.0 / 3.0) / 2.0)
    assert found["bias"] == pytest.approx(0.5)
    x = np.random.default_rng(0).normal(3.0, 0.5, 4000)
    found = efficiency(x, 3.0, 0.5)
    assert found["ratio"] == pytest.approx(1.0, abs=0.04)
    assert found["robust"] == pytest.approx(1.0, abs=0.05)
    lost = efficiency([*x, 90.0], 3.0, 0.5)
    assert lost["ratio"] > 2.0
    assert lost["robust"] == pytest.approx(found["robust"], abs=1e-3)


def test_intervals_hold_the_truth_as_often_as_they_say():
    """1000 samples of 20 from a normal distribution: 95 % +- 2 % of the intervals hold ratio 1 and bias 0."""
    rng = np.random.default_rng(5)
    found = [efficiency(rng.normal(1.0, 0.1, 20), 1.0, 0.1) for _ in range(1000)]
    ratio = np.mean([f["low"] <= 1.0 <= f["high"] for f in found])
    bias = np.mean([abs(f["bias"]) <= f["bias_half_width"] for f in found])
    assert ratio == pytest.approx(0.95, abs=0.02)
    assert bias == pytest.approx(0.95, abs=0.02)


def estimates(n, scale):
    rng = np.random.default_rng(1)
    return pd.DataFrame({
        "setting": "0.3 deg/s", "variant": "least_squares", "case": "row 1", "parameter": "k", "unit": "1",
        "value": 1.0 + scale * rng.normal(size=n), "truth": 1.0, "deviation": 0.01, "at_bound": False,
    })  # fmt: skip


def test_verdict_and_none_of_too_few_realisations_or_without_a_bound():
    for scale, verdict in ((0.01, "yes"), (0.02, "no"), (0.005, "no")):
        assert efficiencies(estimates(2000, scale))["verdict"].tolist() == [verdict]
    assert efficiencies(estimates(19, 0.01)).empty
    assert efficiencies(estimates(50, 0.01).assign(deviation=np.inf)).empty


def test_summary_over_cases():
    rows = pd.concat([estimates(50, s).assign(case=f"row {i}") for i, s in enumerate([0.01, 0.03])])
    found = efficiencies(rows)
    pyplot().close(cramer_rao_figure(found, dict.fromkeys(found["variant"], 0)))
    line = summary(found).frame.iloc[0]
    ratios = found["ratio"].to_numpy()
    assert (line["n_cases"], line["n"]) == (2, 100)
    assert line["rms"] == pytest.approx(np.sqrt(np.mean(ratios**2)))
    assert (line["smallest"], line["largest"]) == (ratios.min(), ratios.max())
    assert line["within"] == np.count_nonzero((ratios >= 0.9) & (ratios <= 1.1))
