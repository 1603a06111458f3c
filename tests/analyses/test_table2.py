"""Table II: spreads within and between records, active bounds, the paper's own line."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from armid.study.analyses.table2 import spread, table2, table2_figure

# Table II of the paper: five identifications, and the mean and "mean square error" that it prints below them.
PAPER = {
    "p0": ([3.0215, 3.0641, 3.0578, 3.0438, 3.0422], 3.0459, 0.0147),
    "k": ([0.9973, 0.9991, 1.0000, 0.9964, 0.9916], 0.9969, 0.0029),
    "eta3": ([0.5338, 0.5662, 0.5607, 0.5526, 0.5523], 0.5531, 0.0110),
    "n": ([1.4986, 1.4837, 1.4888, 1.4993, 1.5000], 1.4941, 0.0066),
}
VALUES = {"record 1": [1.0, 3.0], "record 2": [5.0, 9.0]}


def estimates():
    return pd.DataFrame([
        {"setting": "whole", "variant": "pso", "case": case, "parameter": "p0", "unit": "Pa", "value": 1e6 * v,
         "truth": 4e6, "deviation": 0.5e6, "low": 0.0, "high": 9e6, "at_bound": v == 9.0}
        for case, values in VALUES.items() for v in values
    ])  # fmt: skip


def published(*values):
    rows = [(f"record {i}", "p0", 1e6 * v) for i, v in enumerate(values, 1)]
    return pd.DataFrame(rows, columns=["case", "parameter", "published"])


def test_means_and_deviations_are_those_that_the_paper_prints():
    for values, mean, deviation in PAPER.values():
        found = spread(values)
        assert (found.n, round(found.mean, 4), round(found.deviation, 4)) == (5, mean, deviation)
    assert spread([]).n == 0
    assert np.isnan(spread([]).mean)


def test_by_hand_in_mpa():
    row = table2(estimates(), published()).frame.iloc[0]
    assert (row["unit"], row["n"], row["mean"], row["truth"], row["bound"]) == ("MPa", 4, 4.5, 4.0, 0.5)
    assert row["deviation"] == pytest.approx(np.std([1.0, 3.0, 5.0, 9.0]))
    assert row["between"] == pytest.approx(np.std([2.0, 7.0]))
    assert row["within"] == pytest.approx(np.sqrt((1.0**2 + 2.0**2) / 2))
    assert row["deviation"] ** 2 == pytest.approx(row["between"] ** 2 + row["within"] ** 2)
    assert row["n_at_bound"] == 1


def test_the_papers_line_comes_first_with_its_own_bound_flagged():
    row = table2(estimates(), published(2.0, 4.0, 9.0)).frame.iloc[0]
    assert (row["variant"], row["mean"], row["n"], row["n_at_bound"]) == ("the paper's pso", 5.0, 3, 1)
    assert row["deviation"] == pytest.approx(np.std([2.0, 4.0, 9.0]))


def test_figure_shows_every_run_and_the_paper():
    figure = table2_figure(estimates(), published(2.0, 4.0))
    marks = sum(len(line.get_xdata()) for line in figure.axes[0].lines if line.get_ls() == "None")
    assert marks == 2 + 4
    plt.close(figure)
