"""First hits of targets, and values on a grid."""

import numpy as np
import pytest
from armid.study.analyses.histories import ERROR_TARGETS, first_hits, held
from hypothesis import given
from hypothesis import strategies as st

from armid.study.analyses.success import TOLERANCES

POINT = st.tuples(st.integers(1, 500), st.floats(0.0, 2.0))
SERIES = st.lists(POINT, min_size=1, max_size=20, unique_by=lambda p: p[0])


def split(series):
    ordered = sorted(series)
    return np.array([e for e, _ in ordered]), np.array([d for _, d in ordered])


@given(SERIES)
def test_first_hits_are_what_a_search_from_the_left_finds(series):
    evaluations, distances = split(series)
    targets = np.array([1.5, 1.0, 0.3, 0.0])
    by_hand = [next((e for e, d in zip(evaluations, distances) if d <= t), np.inf) for t in targets]
    assert first_hits(evaluations, distances, targets).tolist() == by_hand


def test_a_target_hit_and_left_again_is_hit():
    assert first_hits(np.array([1, 5, 9]), np.array([0.5, 0.1, 0.4]), np.array([0.2, 0.01])).tolist() == [5.0, np.inf]


def test_an_error_that_is_not_known_hits_nothing():
    assert first_hits(np.array([1, 5]), np.array([np.nan, np.nan]), np.array([1.0])).tolist() == [np.inf]


def test_the_tolerances_of_the_success_rates_are_targets():
    assert len(ERROR_TARGETS) == 51
    assert all((np.abs(ERROR_TARGETS / t - 1.0) < 1e-12).any() for t in TOLERANCES)


@given(SERIES)
def test_held_is_the_last_value_so_far(series):
    evaluations, values = split(series)
    grid = np.array([1, 2, 10, 400, 1000])
    by_hand = [next((v for e, v in zip(evaluations[::-1], values[::-1]) if e <= g), np.inf) for g in grid]
    assert held(evaluations, values, grid) == pytest.approx(by_hand)
