"""Errors by identifier and case, and where runs end."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from armid.study.analyses.analysis import Evidence
from armid.study.analyses.errors import (
    MOST_POINTS,
    brief,
    end_points,
    error_map,
    error_map_figure,
    thinned,
    valley_figure,
)


@pytest.fixture(scope="module")
def evidence(made):
    return Evidence(made(seeds=2))


def test_medians_in_the_orders_given(evidence):
    runs = evidence.of("noise-free")
    errors = error_map(runs, ["de+bobyqa", "pso", "unknown"], ["row 2", "row 1"])
    assert list(errors.index) == ["de+bobyqa", "pso"]
    assert list(errors.columns) == ["row 2", "row 1"]
    own = runs[(runs["variant"] == "pso") & (runs["case"] == "row 1")]
    assert errors.loc["pso", "row 1"] == np.median(own["largest_error"])
    figure = error_map_figure({"noise-free": errors})
    assert brief(100.0 * errors.loc["pso", "row 1"]) in {t.get_text() for t in figure.axes[0].texts}
    plt.close(figure)


def test_brief():
    assert [brief(p) for p in (np.inf, 1.234, 3.2e-7, 0.0)] == ["failed", "1.2", "3e-07", "0"]


def test_deviations_in_percent_of_the_valley_and_of_other_machines_first_three_parameters(evidence):
    ends = end_points(evidence.estimates)
    assert list(ends.columns) == ["variant", "setting", "p0", "eta3", "n"]
    rows = evidence.parameters
    first = rows[(rows["run"] == ends.index[0]) & (rows["parameter"] == "n")].iloc[0]
    assert ends.iloc[0]["n"] == pytest.approx(100.0 * (first["value"] / first["truth"] - 1.0))
    renamed = evidence.estimates.replace({"parameter": {"p0": "mass", "eta3": "coulomb.level"}})
    assert list(end_points(renamed).columns[2:]) == ["mass", "k", "coulomb.level"]


def test_figure_draws_every_run_once_a_pair_and_of_very_many_every_nth(evidence):
    ends = end_points(evidence.estimates)
    figure = valley_figure(ends, ["pso", "cmaes"])
    pair = next(axis for axis in figure.axes if axis.get_ylabel().startswith("eta3"))
    assert sum(len(line.get_xdata()) for line in pair.lines) == len(ends)
    plt.close(figure)
    many = ends.loc[np.repeat(ends.index, 100)].reset_index()
    assert thinned(many).groupby("variant").size().max() <= MOST_POINTS
