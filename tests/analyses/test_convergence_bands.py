"""Convergence bands."""

from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np

from armid.study.analyses.convergence import band, convergence_figure


def test_quartiles_are_values_that_runs_had():
    runs = np.array([[np.inf, 4.0], [np.inf, 3.0], [8.0, 2.0], [9.0, 1.0]], np.float32)
    assert band(runs).tolist() == [[8.0, 1.0], [9.0, 2.0], [np.inf, 3.0]]


def test_one_panel_a_variant_with_a_band_a_setting_and_runs_of_another_fitness_left_out():
    of = {v: np.array([2 * i, 2 * i + 1]) for i, v in enumerate(("pso", "de", "ga", "other"))}
    evidence = SimpleNamespace(groups={"noise-free": of, "0.3 deg/s": of},
                               histories=SimpleNamespace(grid=np.array([1, 10, 100])))  # fmt: skip
    values = np.array([[np.inf, 1.0, 1e-12], [2.0, 0.5, 1e-3]] * 4)
    figure = convergence_figure(evidence, np.arange(8) < 6, values, "error", floor=1e-6)
    assert [axis.get_title() for axis in figure.axes] == ["pso", "de", "ga"]
    assert [len(axis.collections) for axis in figure.axes] == [2, 2, 2]
    assert np.nanmin(figure.axes[0].lines[1].get_ydata()) == 1e-6
    plt.close(figure)
