"""The filter that makes noise white, against what autoregressions are known to do."""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from armid.loop.whitening import coloured_level, white_level, yule_walker

TERMS = np.array([1.5, -0.7])


def autocovariance(terms, n):
    """Autocovariance of an autoregression with innovations of variance 1, from its impulse response."""
    response = lfilter([1.0], np.concatenate([[1.0], -terms]), np.eye(1, 4000).ravel())
    return np.array([response[: 4000 - k] @ response[k:] for k in range(n)])


def test_yule_walker_finds_the_terms_from_the_exact_covariance():
    terms, variance = yule_walker(autocovariance(TERMS, 3), 2)
    np.testing.assert_allclose(terms, TERMS, rtol=1e-9)
    assert variance == pytest.approx(1.0, rel=1e-9)


def test_filter_turns_the_covariance_into_the_unit_matrix():
    rng = np.random.default_rng(1)
    rests = [lfilter([1.0], [1.0, *-TERMS], rng.standard_normal(6000))[1000:] for _ in range(4)]
    rms = float(np.sqrt(autocovariance(TERMS, 1)[0]))
    level = coloured_level(rests, rms, 20_000)
    covariance = toeplitz(autocovariance(TERMS, 40))
    whitened = level.white(level.white(covariance, [40]).T, [40])
    np.testing.assert_allclose(whitened, np.eye(40), atol=0.06)


def test_pieces_are_filtered_each_on_its_own():
    rng = np.random.default_rng(2)
    level = coloured_level([lfilter([1.0], [1.0, *-TERMS], rng.standard_normal(3000))], 3.0, 3000)
    values = rng.standard_normal((3, 50))
    both = level.white(values, [20, 30])
    np.testing.assert_array_equal(both[:, :20], level.white(values[:, :20], [20]))
    np.testing.assert_array_equal(both[:, 20:], level.white(values[:, 20:], [30]))


def test_white_noise_is_only_scaled():
    rng = np.random.default_rng(3)
    level = coloured_level([rng.standard_normal(500) for _ in range(4)], 1.0, 2000)
    assert level.is_white
    np.testing.assert_array_equal(white_level(0.5, 100).white(np.ones(4), [4]), 2.0 * np.ones(4))


def test_coloured_noise_counts_fewer_samples():
    rng = np.random.default_rng(4)
    rests = [lfilter([1.0], [1.0, -0.9], rng.standard_normal(5000))[1000:] for _ in range(4)]
    level = coloured_level(rests, float(np.std(np.concatenate(rests))), 16_000)
    # 1 + 2 sum 0.9^k = 19 and 1 + 2 sum 0.81^k = 9.53 for this autoregression.
    assert level.n_samples / level.n_slow == pytest.approx(19.0, rel=0.15)
    assert level.n_samples / level.n_power == pytest.approx(1 + 2 * 0.81 / 0.19, rel=0.15)
