"""Table I, row by row; the bootstrap interval of a median against its exact distribution."""

import numpy as np
import pytest
from scipy.stats import binom

from armid.study.analyses.analysis import Evidence, published_values
from armid.study.analyses.table1 import median_interval, percentile_among, table1_rows

PAPERS_MEANS = [0.487, 0.421, 0.171, 0.899]


@pytest.fixture(scope="module")
def estimates(made):
    return Evidence(made(seeds=7)).estimates


@pytest.fixture(scope="module")
def rows(estimates, table1_cases):
    return table1_rows(estimates, published_values({"cases": table1_cases}))


def test_one_row_by_hand(estimates, rows):
    key = {"setting": "0.3 deg/s", "variant": "pso", "case": "row 3", "parameter": "n"}
    own = estimates[np.all([estimates[k] == v for k, v in key.items()], axis=0)]
    row = rows[np.all([rows[k] == v for k, v in key.items()], axis=0)].iloc[0]
    assert (row["n"], row["truth"], row["published"]) == (7, 1.2, 1.2126)
    assert row["published_error"] == pytest.approx(0.0105)
    assert row["median"] == np.median(own["value"])
    assert row["error_of_median"] == pytest.approx(abs(np.median(own["value"]) - 1.2) / 1.2)
    assert (row["low"], row["high"]) == median_interval(own["relative_error"])
    assert row["percentile"] == pytest.approx(100.0 * np.mean(own["relative_error"] < 0.0105))


def test_the_last_four_rows_are_means_beside_the_papers(rows):
    table = rows[(rows["setting"] == "noise-free") & (rows["variant"] == "pso")]
    assert len(table) == 24
    means = table.iloc[-4:]
    assert means["parameter"].tolist() == ["p0", "k", "eta3", "n"]
    assert (100.0 * means["published_error"]).round(3).tolist() == PAPERS_MEANS
    assert means["n"].tolist() == [35] * 4
    of_n = table[(table["parameter"] == "n") & (table["case"] != "mean of the rows")]
    assert means.iloc[-1]["mean_error"] == pytest.approx(of_n["mean_error"].mean())


def test_pressures_in_mpa(rows):
    first = rows.iloc[0]
    assert (first["unit"], first["truth"], first["published"]) == ("MPa", pytest.approx(3.2), pytest.approx(3.2114))


def test_percentile_counts_equal_ones_by_half_and_failed_runs_as_worse():
    assert percentile_among([1.0, 2.0, 3.0, np.inf], 2.0) == 37.5
    assert percentile_among([1.0, 2.0], 9.0) == 100.0
    assert np.isnan(percentile_among([], 1.0))


def exact_interval(sample, confidence=0.95):
    """For odd n the median of a resample is the k-th value or less with P(Bin(n, k/n) >= (n + 1)/2)."""
    n, ordered = len(sample), np.sort(sample)
    below = binom.sf((n + 1) / 2 - 1, n, np.arange(1, n + 1) / n)
    tail = (1.0 - confidence) / 2.0
    return ordered[np.searchsorted(below, tail)], ordered[np.searchsorted(below, 1.0 - tail)]


def test_the_interval_of_a_median_against_the_exact_distribution():
    for n in (25, 101):
        sample = np.arange(n, dtype=float)
        assert median_interval(sample) == pytest.approx(exact_interval(sample), abs=1.0)


def test_infinite_values_leave_the_rest_of_an_interval_as_it_is():
    sample = np.arange(25, dtype=float)
    assert median_interval(np.where(sample >= 22, np.inf, sample)) == median_interval(sample)
    low, high = median_interval([1.0, 2.0, *[np.inf] * 9])
    assert high == np.inf
    assert low in (1.0, 2.0, np.inf)


def test_intervals_of_one_value_of_any_order_and_of_large_samples_in_batches():
    assert np.isnan(median_interval([1.0])).all()
    sample = np.random.default_rng(1).lognormal(size=25)
    assert median_interval(sample) == median_interval(sample[::-1])
    low, high = median_interval(np.random.default_rng(1).normal(size=6001))
    # standard error of a normal median: sqrt(pi/2/n)
    assert high - low == pytest.approx(2 * 1.96 * np.sqrt(np.pi / 2 / 6001), rel=0.3)
