"""What is left out in turn when a larger model is judged."""

from types import SimpleNamespace

import numpy as np
import pytest

from armid.loop.select import is_undetermined, parts_to_judge

N = 100
PARTS = [np.arange(N), np.arange(N, 2 * N), np.arange(2 * N, 3 * N)]


def models(slopes, size, n_parts=2):
    """A smaller model that leaves `size` at each sample, and a larger one with two parameters of such slopes."""
    jacobian = np.concatenate([np.tile(row, (N, 1)) for row in slopes[:n_parts]])
    data = SimpleNamespace(parts=lambda: PARTS[:n_parts])
    larger = SimpleNamespace(jacobian=jacobian, n_free=2, records=SimpleNamespace(data=data))
    return SimpleNamespace(residual=np.full(n_parts * N, size)), larger


# Each record sees its own parameter alone, or both see both.
APART = [(50.0, 0.0), (0.0, 50.0), (50.0, 50.0)]
TOGETHER = [(50.0, 0.0), (50.0, 1.0), (0.0, 50.0)]


def test_manoeuvres_that_do_not_determine_each_other_are_judged_in_blocks():
    parts = parts_to_judge(*models(APART, 2.0))
    assert len(parts) == 10
    assert np.array_equal(np.sort(np.concatenate(parts)), np.arange(2 * N))


@pytest.mark.parametrize(("slopes", "size", "n_parts"), [
    (TOGETHER, 2.0, 2), (APART, 50.0, 2), (APART, 2.0, 3), (APART, 2.0, 1),
])  # fmt: skip
def test_others_are_left_out_whole(slopes, size, n_parts):
    """They predict each other, or the effect is larger than what they leave open, or there are three, or one."""
    parts = parts_to_judge(*models(slopes, size, n_parts))
    assert [len(p) for p in parts] == [N] * n_parts


def test_the_spread_is_that_of_the_linear_prediction():
    """One parameter unseen by the rest has the variance 1/12 of its range, so that its slope s makes s^2/12."""
    for size, expected in ((14.0, True), (15.0, False)):
        assert is_undetermined(*models([(0.0, 0.0), (0.0, 50.0)], size), PARTS[1]) is expected
    assert pytest.approx(14.43**2, rel=1e-3) == 50.0**2 / 12
