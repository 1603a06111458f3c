"""ECDF over runs and targets."""

import matplotlib.pyplot as plt
import numpy as np
from armid.study.analyses.ecdf import ecdf_figure, share_hit
from hypothesis import given
from hypothesis import strategies as st

HIT = st.one_of(st.integers(1, 100).map(float), st.just(np.inf))
HITS = st.lists(st.lists(HIT, min_size=3, max_size=3), min_size=1)


def test_by_hand():
    hits = np.array([[1.0, 10.0], [5.0, np.inf]])
    assert share_hit(hits, np.array([1, 4, 5, 10, 99])).tolist() == [0.25, 0.25, 0.5, 0.75, 0.75]


@given(HITS)
def test_it_rises_and_ends_at_the_share_that_is_ever_hit(rows):
    hits = np.array(rows)
    shares = share_hit(hits, np.arange(1, 101))
    assert (np.diff(shares) >= 0.0).all()
    assert shares[-1] == np.isfinite(hits).mean()


def test_figure_names_lines_in_the_order_of_their_ends():
    grid = np.array([1, 10, 100])
    groups = {"noise-free": {"bad": np.array([[50.0, np.inf]]), "good": np.array([[2.0, 3.0]])}}
    figure = ecdf_figure(groups, grid, {"bad": 0, "good": 1})
    names = sorted(figure.axes[0].texts, key=lambda t: t.get_position()[1])
    assert [t.get_text() for t in names] == ["bad", "good"]
    plt.close(figure)
