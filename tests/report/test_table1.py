"""Table I, row by row."""

import numpy as np
import pytest
from armid.study.analyses.histories import median_interval
from armid.study.analyses.outcomes import by_parameter, outcomes, published_values

from armid.study.analyses.table1 import table1, table1_rows

PAPERS_MEANS = [0.487, 0.421, 0.171, 0.899]


@pytest.fixture(scope="module")
def estimates(made):
    results = made(seeds=7)
    return by_parameter(outcomes(results.runs, results.parameters), results.parameters)


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
    table = table1(rows, "noise-free", "pso", "t").frame
    assert len(table) == 24
    means = table.iloc[-4:]
    assert means["parameter"].tolist() == ["p0", "k", "eta3", "n"]
    assert (100.0 * means["published_error"]).round(3).tolist() == PAPERS_MEANS
    assert means["n"].tolist() == [35] * 4
    of_n = table[(table["parameter"] == "n") & (table["case"] != "mean of the rows")]
    assert means.iloc[-1]["mean_error"] == pytest.approx(of_n["mean_error"].mean())


def test_pressures_in_mpa(rows):
    first = table1(rows, "noise-free", "pso", "t").frame.iloc[0]
    assert (first["unit"], first["truth"], first["published"]) == ("MPa", pytest.approx(3.2), pytest.approx(3.2114))
