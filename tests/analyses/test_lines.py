"""Names beside lines keep their distance."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from armid.report.style import panel_height, spread

HEIGHTS = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=18).map(sorted)


@given(HEIGHTS)
def test_names_do_not_overlap_and_stay_beside_the_axes(heights):
    apart = 0.05
    places = spread(heights, apart)
    assert (np.diff(places) >= apart - 1e-9).all()
    assert min(places) >= -1e-9
    assert max(places) <= 1.0 + 1e-9


def test_they_move_as_little_as_it_takes():
    heights, apart = [0.30, 0.31, 0.33, 0.7], 0.1
    limits = [{"type": "ineq", "fun": lambda x, i=i: x[i + 1] - x[i] - apart} for i in range(3)]
    best = minimize(lambda x: np.sum((x - heights) ** 2), heights, constraints=limits).x
    assert np.allclose(spread(heights, apart), best, atol=1e-4)


def test_twenty_names_have_room():
    assert (panel_height(20) - 1.0) / 20 >= 0.2
