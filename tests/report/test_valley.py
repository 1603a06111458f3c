"""Where runs end."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from armid.study.analyses.outcomes import by_parameter, outcomes
from armid.study.analyses.valley import MOST_POINTS, end_points, thinned, valley_figure


@pytest.fixture(scope="module")
def ends(made):
    results = made(seeds=2)
    return end_points(by_parameter(outcomes(results.runs, results.parameters), results.parameters))


def test_deviations_in_percent_of_the_valley(made, ends):
    assert list(ends.columns) == ["variant", "setting", "p0", "eta3", "n"]
    rows = made(seeds=2).parameters
    first = rows[(rows["run"] == ends.index[0]) & (rows["parameter"] == "n")].iloc[0]
    assert ends.iloc[0]["n"] == pytest.approx(100.0 * (first["value"] / first["truth"] - 1.0))


def test_other_machines_show_their_first_three_parameters(made):
    results = made(seeds=1)
    renamed = results.parameters.replace({"parameter": {"p0": "mass", "eta3": "coulomb.level"}})
    estimates = by_parameter(outcomes(results.runs, results.parameters), renamed)
    assert list(end_points(estimates).columns[2:]) == ["mass", "k", "coulomb.level"]


def test_figure_draws_every_run_once_a_pair(ends):
    figure = valley_figure(ends, ["pso", "cmaes"])
    pair = next(axis for axis in figure.axes if axis.get_ylabel().startswith("eta3"))
    assert sum(len(line.get_xdata()) for line in pair.lines) == len(ends)
    plt.close(figure)


def test_of_very_many_runs_every_nth_is_drawn(ends):
    many = ends.loc[np.repeat(ends.index, 100)].reset_index()
    assert thinned(many).groupby("variant").size().max() <= MOST_POINTS
