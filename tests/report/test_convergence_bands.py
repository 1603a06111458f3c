"""Convergence bands."""

import matplotlib.pyplot as plt
import numpy as np

from armid.study.analyses.convergence import band, convergence_figure


def test_quartiles_are_values_that_runs_had():
    runs = np.array([[np.inf, 4.0], [np.inf, 3.0], [8.0, 2.0], [9.0, 1.0]], np.float32)
    assert band(runs).tolist() == [[8.0, 1.0], [9.0, 2.0], [np.inf, 3.0]]


def test_one_panel_a_variant_with_a_band_a_setting():
    grid = np.array([1, 10, 100])
    held = np.array([[np.inf, 1.0, 1e-12], [2.0, 0.5, 1e-3]])
    groups = {v: {"noise-free": held, "0.3 deg/s": held} for v in ("pso", "de", "ga")}
    figure = convergence_figure(groups, grid, "error", floor=1e-6)
    assert [axis.get_title() for axis in figure.axes] == ["pso", "de", "ga"]
    assert [len(axis.collections) for axis in figure.axes] == [2, 2, 2]
    assert np.nanmin(figure.axes[0].lines[1].get_ydata()) == 1e-6
    plt.close(figure)
