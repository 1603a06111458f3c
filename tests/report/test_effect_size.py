"""Effect size of Vargha and Delaney."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import mannwhitneyu

from armid.study.analyses.ranks import a12, size_in_words

SAMPLES = st.lists(st.integers(0, 9).map(float), min_size=1, max_size=15)


@given(SAMPLES, SAMPLES)
def test_it_is_the_mann_whitney_statistic_over_the_pairs(x, y):
    u = mannwhitneyu(y, x).statistic
    assert a12(x, y) == pytest.approx(u / (len(x) * len(y)))
    assert a12(x, y) + a12(y, x) == pytest.approx(1.0)


def test_by_hand_with_a_tie_and_a_failure():
    assert a12([1.0, 2.0], [2.0, np.inf]) == (2 + 1.5) / 4


def test_nothing_to_compare():
    assert np.isnan(a12([], [1.0]))


@pytest.mark.parametrize(("value", "word"), [
    (0.5, "negligible"), (0.44, "small"), (0.57, "small"), (0.65, "medium"), (0.28, "large"), (1.0, "large"),
])  # fmt: skip
def test_words(value, word):
    assert size_in_words(value) == word
