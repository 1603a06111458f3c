"""The filter that makes noise white, against what autoregressions are known to do; when a residual is not noise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from armid.estimation.noise_model import (
    alternating_level,
    coloured_level,
    growing_level,
    log_density,
    white_level,
    yule_walker,
)
from armid.inference.checks import mains_hum, motion_phases, spectra, square_along, time_in_words
from armid.inference.model import decomposed
from armid.inference.whitening import soundness
from armid.model import Manoeuvre, Output
from armid.record.record import made_record
from armid.record.sensor import memory_of

TERMS = np.array([1.5, -0.7])


def autocovariance(terms, n):
    """Autocovariance of an autoregression with innovations of variance 1, from its impulse response."""
    response = lfilter([1.0], np.concatenate([[1.0], -terms]), np.eye(1, 4000).ravel())
    return np.array([response[: 4000 - k] @ response[k:] for k in range(n)])


def test_yule_walker_finds_the_terms_and_pieces_are_filtered_each_on_its_own():
    terms, variance = yule_walker(autocovariance(TERMS, 3), 2)
    np.testing.assert_allclose(terms, TERMS, rtol=1e-9)
    assert variance == pytest.approx(1.0, rel=1e-9)
    rng = np.random.default_rng(2)
    level = coloured_level([lfilter([1.0], [1.0, *-TERMS], rng.standard_normal(3000))], 3.0, 3000)
    values = rng.standard_normal((3, 50))
    both = level.white(values, [20, 30])
    np.testing.assert_array_equal(both[:, :20], level.white(values[:, :20], [20]))
    np.testing.assert_array_equal(both[:, 20:], level.white(values[:, 20:], [30]))


def test_filter_turns_the_covariance_into_the_unit_matrix():
    white = coloured_level(list(np.random.default_rng(3).standard_normal((4, 500))), 1.0, 2000)
    assert white.is_white
    np.testing.assert_array_equal(white_level(0.5, 100).white(np.ones(4), [4]), 2.0 * np.ones(4))
    rng = np.random.default_rng(1)
    rests = [lfilter([1.0], [1.0, *-TERMS], rng.standard_normal(6000))[1000:] for _ in range(4)]
    rms = float(np.sqrt(autocovariance(TERMS, 1)[0]))
    level = coloured_level(rests, rms, 20_000)
    covariance = toeplitz(autocovariance(TERMS, 40))
    whitened = level.white(level.white(covariance, [40]).T, [40])
    np.testing.assert_allclose(whitened, np.eye(40), atol=0.06)


def test_coloured_noise_counts_fewer_samples():
    rng = np.random.default_rng(4)
    rests = [lfilter([1.0], [1.0, -0.9], rng.standard_normal(5000))[1000:] for _ in range(4)]
    level = coloured_level(rests, float(np.std(np.concatenate(rests))), 16_000)
    # 1 + 2 sum 0.9^k = 19 and 1 + 2 sum 0.81^k = 9.53 for this autoregression.
    assert level.n_samples / level.n_slow == pytest.approx(19.0, rel=0.15)
    assert level.n_samples / level.n_power == pytest.approx(1 + 2 * 0.81 / 0.19, rel=0.15)


def test_noise_in_motion_is_found_and_turned_white():
    rng, reading = np.random.default_rng(5), np.linspace(-40.0, 60.0, 20_000)
    grown = np.hypot(0.2, 0.01 * reading) * rng.standard_normal(reading.size)
    level = growing_level([reading], [grown], 0.0)
    assert (level.still, level.growth) == pytest.approx((0.2, 0.01), rel=0.05)
    assert np.std(level.white(grown, [reading.size]) * level.weights(reading)) == pytest.approx(1.0, rel=0.02)
    assert log_density(level, reading, grown) > log_density(white_level(np.std(grown), 0), reading, grown) + 100.0
    assert growing_level([reading], [grown], 0.5).still == 0.5
    white = rng.standard_normal(20_001)
    level = alternating_level([white[1:] - 0.9 * white[:-1]], 0.0)
    assert (level.alternation, level.innovation) == pytest.approx((0.9, 1.0), rel=0.02)
    covariance = toeplitz([1.81, -0.9, *np.zeros(38)])
    exact = replace(level, alternation=0.9, innovation=1.0)
    np.testing.assert_allclose(exact.white(exact.white(covariance, [40]).T, [40]), np.eye(40), atol=1e-12)


def test_when_a_residual_is_no_noise_is_told_by_what_the_motion_does():
    speeds = [np.concatenate([np.zeros(10), np.linspace(0, 2, 40), np.full(30, 2.0), np.linspace(2, 0.1, 20)])] * 2
    phases = motion_phases(speeds)
    assert np.all(sum(phases.values()) == 1)
    assert [int(samples.sum()) // 2 for samples in phases.values()] == pytest.approx([11, 30, 40, 20], abs=2)
    residual = np.where(phases["while it slows down"] & (np.arange(200) >= 100), 5.0, 0.0)
    seen = SimpleNamespace(
        residual=residual, phases=phases, data=SimpleNamespace(known=True),
        stages={"before 'closed'": np.arange(200) < 100, "after 'closed'": np.arange(200) >= 100},
    )  # fmt: skip
    assert time_in_words(seen) == "When it is: 100% of it while it slows down, after 'closed', in 10% of the samples."


def test_memory_is_that_of_the_noise_and_not_of_what_the_model_lacks():
    rng = np.random.default_rng(5)
    slow = [6.0 * np.sin(2.0 * np.pi * (1.0 + i) * np.arange(800) / 200.0) for i in range(5)]
    for rho, beside in ((0.0, 0.0), (0.35, 0.0), (0.7, 0.0), (0.35, 1.0)):
        noise = [lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], rng.standard_normal(1000))[200:] for _ in range(5)]
        found = memory_of([n + beside * s for n, s in zip(noise, slow, strict=True)])
        assert found == (pytest.approx(rho, abs=0.15) if rho else 0.0)
    # too long to be told from a discrepancy, and nothing at all
    assert memory_of(slow) == memory_of([np.zeros(100)]) == 0.0


@pytest.mark.parametrize("data", [[], [3], [3, 4, 9]])
def test_samples_behind_a_gap_are_unsound_as_far_as_the_filter_reaches(data):
    """A piece may hold one measured sample, or none."""
    told = np.isin(np.arange(20), data)
    record = made_record("a.csv", "train", Manoeuvre(0.01, 20, {}), Output("speed", "v", "rad/s"), np.arange(20.0), 0.1)
    found = soundness(record.with_signals(lambda signal: replace(signal, data=told)), reach=1)
    np.testing.assert_array_equal(found, [1.0, 1.0, 0.0][: len(data)])


@pytest.mark.parametrize("rank", [1, 3, 5])
def test_the_part_along_columns_is_that_of_a_decomposition_whatever_their_rank(rank):
    rng = np.random.default_rng(rank)
    columns = rng.standard_normal((300, rank)) @ rng.standard_normal((rank, 5)) * np.logspace(-3, 3, 5)
    values = rng.standard_normal(300)
    basis, inverse = decomposed(columns)
    square, found = square_along(columns, values)
    assert found == rank == basis.shape[1]
    assert square == pytest.approx(float(np.sum((basis.T @ values) ** 2)), rel=1e-9)
    np.testing.assert_allclose(columns @ (inverse @ values), basis @ (basis.T @ values), atol=1e-8)


def test_a_record_without_a_rest_adds_no_ordinate():
    """Records in motion have none, while the rest of others shows coloured noise."""
    record, level = SimpleNamespace(spacing=0.01), SimpleNamespace(rms=1.0)
    seen = SimpleNamespace(data=SimpleNamespace(each=(record, record), levels=(level, level)))
    rest = np.random.default_rng(1).normal(size=400)
    alone = SimpleNamespace(data=SimpleNamespace(each=(record,), levels=(level,)))
    assert spectra([rest, np.empty(0)], seen, []) == spectra([rest], alone, [])


@pytest.mark.parametrize("n_rests", [1, 4])
def test_hum_of_the_mains_is_seen_in_a_rest_and_not_in_noise(n_rests):
    rng, times = np.random.default_rng(5), 0.001 * np.arange(300)

    def humming(size):
        rests = [rng.standard_normal(300) + size * np.sin(2.0 * np.pi * (50.04 * times + rng.random()))
                 for _ in range(n_rests)]  # fmt: skip
        each = [SimpleNamespace(rest=r, spacing=0.001, noise=SimpleNamespace(source="rest")) for r in rests]
        return mains_hum(SimpleNamespace(data=SimpleNamespace(each=each)))

    still = SimpleNamespace(rest=np.full(300, 0.5), spacing=0.001, noise=SimpleNamespace(source="rest"))
    assert mains_hum(SimpleNamespace(data=SimpleNamespace(each=[still] * n_rests))) == []
    assert sum(bool(humming(0.0)) for _ in range(100)) <= 4
    assert all(any(low < 50.0 < high for low, high in humming(1.0)) for _ in range(20))
