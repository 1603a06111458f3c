"""Thinned curves look the same."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armid.report.style import thinned


@given(st.integers(0, 4000), st.integers(4, 600), st.integers(0, 2**32 - 1))
def test_few_points_rising_with_both_ends_and_the_extremes(n, most, seed):
    values = np.random.default_rng(seed).standard_normal(n).round(1)
    kept = thinned(values, most)
    assert len(kept) <= max(most, 4)
    assert np.all(np.diff(kept) > 0)
    if n:
        assert (kept[0], kept[-1]) == (0, n - 1)
        assert values[kept].min() == values.min()
        assert values[kept].max() == values.max()
    if n <= most:
        assert len(kept) == n


def test_a_single_spike_is_never_lost():
    for where in range(0, 50_000, 997):
        values = np.zeros(50_000)
        values[where] = 1.0
        assert where in thinned(values)


@pytest.mark.parametrize("value", [0.0, 3.0])
def test_a_constant_keeps_few_points(value):
    assert len(thinned(np.full(10_000, value), 100)) <= 100
