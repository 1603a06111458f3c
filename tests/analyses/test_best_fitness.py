"""Data profiles."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from armid.study.analyses.analysis import Evidence
from armid.study.analyses.running_time import data_profile, data_profile_figure


def test_by_hand():
    hits, n = np.array([10.0, 50.0, np.inf]), np.array([4, 4, 9])
    assert data_profile(hits, n, np.array([1.0, 2.0, 9.9, 10.0, 1e9])) == pytest.approx([0, 1 / 3, 1 / 3, 2 / 3, 2 / 3])


def test_one_panel_a_setting_and_share(made):
    figure = data_profile_figure(Evidence(made(seeds=1)))
    titles = [axis.get_title() for axis in figure.axes]
    assert titles == [f"{s}, {t} left" for s in ("noise-free", "0.3 deg/s") for t in ("0.1", "0.001", "1e-05")]
    plt.close(figure)
