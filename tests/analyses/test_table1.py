"""Tables I and II of the paper; the bootstrap interval of a median against its exact distribution."""

import numpy as np
import pandas as pd
import pytest
from made_results import made

from armid.study.analyses.analysis import Evidence
from armid.study.analyses.paper_tables import median_interval, spread, table1_rows, table2

PAPERS_MEANS = [0.487, 0.421, 0.171, 0.899]


def test_one_row_by_hand_and_the_last_four_are_means_beside_the_papers():
    evidence = Evidence(made(seeds=7))
    estimates = evidence.estimates
    rows = table1_rows(estimates, evidence.published)
    key = {"setting": "0.3 deg/s", "variant": "pso", "case": "row 3", "parameter": "n"}
    own = estimates[np.all([estimates[k] == v for k, v in key.items()], axis=0)]
    row = rows[np.all([rows[k] == v for k, v in key.items()], axis=0)].iloc[0]
    assert (row["n"], row["truth"], row["published"]) == (7, 1.2, 1.2126)
    assert row["published_error"] == pytest.approx(0.0105)
    assert row["median"] == np.median(own["value"])
    assert row["error_of_median"] == pytest.approx(abs(np.median(own["value"]) - 1.2) / 1.2)
    assert (row["low"], row["high"]) == median_interval(own["relative_error"])
    assert row["percentile"] == pytest.approx(100.0 * np.mean(own["relative_error"] < 0.0105))
    table = rows[(rows["setting"] == "noise-free") & (rows["variant"] == "pso")]
    assert len(table) == 24
    means = table.iloc[-4:]
    assert means["parameter"].tolist() == ["p0", "k", "eta3", "n"]
    assert (100.0 * means["published_error"]).round(3).tolist() == PAPERS_MEANS
    assert means["n"].tolist() == [35] * 4
    of_n = table[(table["parameter"] == "n") & (table["case"] != "mean of the rows")]
    assert means.iloc[-1]["mean_error"] == pytest.approx(of_n["mean_error"].mean())


def test_intervals_of_one_value_of_any_order_and_of_large_samples_in_batches():
    assert np.isnan(median_interval([1.0])).all()
    sample = np.random.default_rng(1).lognormal(size=25)
    assert median_interval(sample) == median_interval(sample[::-1])
    low, high = median_interval(np.random.default_rng(1).normal(size=6001))
    # standard error of a normal median: sqrt(pi/2/n)
    assert high - low == pytest.approx(2 * 1.96 * np.sqrt(np.pi / 2 / 6001), rel=0.3)


# Table II of the paper: five identifications, and the mean and "mean square error" that it prints below them.
PAPER = {
    "p0": ([3.0215, 3.0641, 3.0578, 3.0438, 3.0422], 3.0459, 0.0147),
    "k": ([0.9973, 0.9991, 1.0000, 0.9964, 0.9916], 0.9969, 0.0029),
    "eta3": ([0.5338, 0.5662, 0.5607, 0.5526, 0.5523], 0.5531, 0.0110),
    "n": ([1.4986, 1.4837, 1.4888, 1.4993, 1.5000], 1.4941, 0.0066),
}
VALUES = {"record 1": [1.0, 3.0], "record 2": [5.0, 9.0]}


def two_records():
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
        assert (found["n"], round(found["mean"], 4), round(found["deviation"], 4)) == (5, mean, deviation)


def test_table_2_by_hand_in_mpa_and_the_papers_line_first():
    row = table2(two_records(), published()).frame.iloc[0]
    assert (row["unit"], row["n"], row["mean"], row["truth"], row["bound"]) == ("MPa", 4, 4.5, 4.0, 0.5)
    assert row["deviation"] == pytest.approx(np.std([1.0, 3.0, 5.0, 9.0]))
    assert row["between"] == pytest.approx(np.std([2.0, 7.0]))
    assert row["within"] == pytest.approx(np.sqrt((1.0**2 + 2.0**2) / 2))
    assert row["deviation"] ** 2 == pytest.approx(row["between"] ** 2 + row["within"] ** 2)
    assert row["n_at_bound"] == 1
    row = table2(two_records(), published(2.0, 4.0, 9.0)).frame.iloc[0]
    assert (row["variant"], row["mean"], row["n"], row["n_at_bound"]) == ("the paper's pso", 5.0, 3, 1)
    assert row["deviation"] == pytest.approx(np.std([2.0, 4.0, 9.0]))
