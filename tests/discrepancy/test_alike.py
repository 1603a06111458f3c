"""Which ray could take the place of an effect."""

import numpy as np
import pytest

from armid.loop.equivalence import LIKELY, likest

T = np.linspace(0.0, 1.0, 400)
BASIS = np.linalg.qr(np.column_stack([np.ones_like(T), T]))[0]
CHANGE = 3.0 * np.sin(9.0 * T) + 5.0 * T


def test_the_ray_that_moves_the_signal_alike_is_found_with_its_amplitude():
    moved = np.array([np.cos(9.0 * T), 12.0 * np.sin(9.0 * T) - 40.0, np.full_like(T, np.nan)])
    place, correlation, amplitude = likest(CHANGE, moved, BASIS)
    assert place == 1
    assert correlation == pytest.approx(1.0, abs=1e-9)
    assert amplitude == pytest.approx(0.25, rel=1e-9)


@pytest.mark.parametrize(
    "ray", [np.cos(9.0 * T), -np.sin(9.0 * T), 2.0 + 7.0 * T, np.zeros_like(T)],
    ids=["another", "reversed", "what the parameters do", "nothing"],
)  # fmt: skip
def test_none_is_near_where_it_moves_otherwise_the_other_way_or_not_at_all(ray):
    assert likest(CHANGE, ray[np.newaxis], BASIS) is None


def test_the_likeness_that_is_asked_for_lies_below_that_of_a_group():
    from armid.loop.equivalence import ALIKE

    assert LIKELY < ALIKE
