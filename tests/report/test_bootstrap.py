"""Bootstrap interval of the median, against its exact distribution."""

import numpy as np
import pytest
from armid.study.analyses.histories import median_interval
from scipy.stats import binom


def exact_interval(sample, confidence=0.95):
    """For odd n the median of a resample is the k-th value or less with P(Bin(n, k/n) >= (n + 1)/2)."""
    n, ordered = len(sample), np.sort(sample)
    below = binom.sf((n + 1) / 2 - 1, n, np.arange(1, n + 1) / n)
    tail = (1.0 - confidence) / 2.0
    return ordered[np.searchsorted(below, tail)], ordered[np.searchsorted(below, 1.0 - tail)]


@pytest.mark.parametrize("n", [25, 101])
def test_against_the_exact_distribution(n):
    sample = np.arange(n, dtype=float)
    assert median_interval(sample) == pytest.approx(exact_interval(sample), abs=1.0)


def test_infinite_values_leave_the_rest_as_it_is():
    sample = np.arange(25, dtype=float)
    lost = np.where(sample >= 22, np.inf, sample)
    assert median_interval(lost) == median_interval(sample)


def test_mostly_infinite():
    low, high = median_interval([1.0, 2.0, *[np.inf] * 9])
    assert high == np.inf
    assert low in (1.0, 2.0, np.inf)


def test_same_sample_in_any_order_gives_the_same_interval():
    sample = np.random.default_rng(1).lognormal(size=25)
    assert median_interval(sample) == median_interval(sample[::-1])


def test_one_value_has_no_interval():
    assert np.isnan(median_interval([1.0])).all()


def test_large_samples_are_resampled_in_batches():
    sample = np.random.default_rng(1).normal(size=6001)
    low, high = median_interval(sample)
    # standard error of a normal median: sqrt(pi/2/n)
    assert high - low == pytest.approx(2 * 1.96 * np.sqrt(np.pi / 2 / 6001), rel=0.3)
