"""Fitness functions side by side."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from armid.study.analyses.fitness_quality import fitness_quality, fitness_quality_figure


def frame():
    return pd.DataFrame({
        "setting": "noise-free", "identifier": "pso", "status": "done", "fitness": ["similarity"] * 4 + ["rmse"] * 4,
        "train_s": [0.9, 0.99, 0.999, np.nan, 0.9, 0.99, 0.999, 0.9999],
        "largest_error": [3e-1, 2e-2, 1e-3, np.inf, 1e-3, 2e-3, 3e-3, 4e-3],
    })  # fmt: skip


def test_by_hand():
    table = fitness_quality(frame()).frame.set_index("fitness")
    # similarity: the better S the smaller the error; rmse: the other way round; a failed run is infinite
    assert table["correlation"].round(12).to_dict() == {"similarity": 1.0, "rmse": -1.0}
    assert table.loc["similarity", "median_error"] == (2e-2 + 3e-1) / 2
    assert table.loc["similarity", "worst_error"] == np.inf
    assert np.isclose(table.loc["similarity", "median_misfit"], 0.01)


def test_figure_has_a_mark_a_run():
    figure = fitness_quality_figure(frame())
    assert [len(line.get_xdata()) for line in figure.axes[0].lines] == [4, 4]
    plt.close(figure)
