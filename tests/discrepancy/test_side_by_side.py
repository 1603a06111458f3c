"""Work shared among threads: the same result, whatever their number."""

import threading

import pytest

from armid.loop.fit import side_by_side


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_results_come_in_order(threads):
    assert side_by_side(lambda x: x * x, range(20), threads) == [x * x for x in range(20)]
    assert side_by_side(lambda x: x, [], threads) == []


def test_two_items_are_at_work_at_once():
    both = threading.Barrier(2, timeout=30.0)
    assert side_by_side(lambda _: both.wait() >= 0, range(2), 2) == [True, True]


def test_an_error_comes_out():
    with pytest.raises(ZeroDivisionError):
        side_by_side(lambda x: 1 / x, [1, 0], 2)
