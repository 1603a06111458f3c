"""What the paper printed, recomputed: its mean errors, its means and deviations, and where it stands among ours."""

import numpy as np
import pandas as pd
import pytest
from armid.study.analyses.outcomes import published_values

from armid.study.analyses.overview import overview
from armid.study.analyses.table1 import percentile_among
from armid.study.analyses.table2 import spread

# Table II of the paper: five identifications, and the mean and "mean square error" that it prints below them.
TABLE2 = {
    "p0": ([3.0215, 3.0641, 3.0578, 3.0438, 3.0422], 3.0459, 0.0147),
    "k": ([0.9973, 0.9991, 1.0000, 0.9964, 0.9916], 0.9969, 0.0029),
    "eta3": ([0.5338, 0.5662, 0.5607, 0.5526, 0.5523], 0.5531, 0.0110),
    "n": ([1.4986, 1.4837, 1.4888, 1.4993, 1.5000], 1.4941, 0.0066),
}


def test_mean_errors_of_table_1(table1_cases):
    published = published_values({"cases": table1_cases})
    means = 100.0 * published.groupby("parameter")["relative_error"].mean()
    assert means.round(3).to_dict() == {"p0": 0.487, "k": 0.421, "eta3": 0.171, "n": 0.899}


@pytest.mark.parametrize("parameter", TABLE2)
def test_means_and_deviations_of_table_2(parameter):
    values, mean, deviation = TABLE2[parameter]
    found = spread(values)
    assert (found.n, round(found.mean, 4), round(found.deviation, 4)) == (5, mean, deviation)


def test_spread_of_nothing():
    assert spread([]).n == 0
    assert np.isnan(spread([]).mean)


def test_percentile_counts_equal_ones_by_half_and_failed_runs_as_worse():
    assert percentile_among([1.0, 2.0, 3.0, np.inf], 2.0) == 37.5
    assert percentile_among([1.0, 2.0], 9.0) == 100.0
    assert np.isnan(percentile_among([], 1.0))


def test_overview_begins_with_the_paper(made, table1_cases):
    from armid.study.analyses.outcomes import by_parameter, outcomes

    results = made()
    found = outcomes(results.runs, results.parameters)
    estimates = by_parameter(found, results.parameters)
    frame = overview(found, estimates, published_values(results.study)).frame
    assert frame.iloc[0]["variant"] == "the paper's pso"
    assert (100.0 * frame.iloc[0][["p0_mean", "k_mean", "eta3_mean", "n_mean"]]).astype(float).round(3).tolist() == [
        0.487, 0.421, 0.171, 0.899
    ]  # fmt: skip
    row = frame[(frame["variant"] == "pso") & (frame["setting"] == "noise-free")].iloc[0]
    own = estimates[(estimates["variant"] == "pso") & (estimates["setting"] == "noise-free")]
    assert row["n_median"] == pd.Series(own.loc[own["parameter"] == "n", "relative_error"]).median()
    assert row["largest_worst"] == own["relative_error"].max()
