"""Errors on records against a direct computation."""

import numpy as np
import pytest

from armid.estimation.identify import campaign_errors, record_errors
from armid.problem.replay import replays
from armid.problem.similarity import similarity

CANDIDATE = np.array([3.1e6, 0.98, 0.56, 1.35])


@pytest.fixture(scope="module")
def several(paper_arm, arm, arm_space):
    """Records whose windows last 0.4, 0.7 and 1.2 s."""
    windows = ((0.1, 0.5), (0.0, 0.7), (0.0, 1.2))
    records = [paper_arm.with_window(*w).train[i] for w, i in zip(windows, (0, 3, 4))]
    return replays(records, arm, arm_space)


def series(replay):
    """Return measured and simulated samples of the window, rad/s."""
    return replay.measured, replay.signal(CANDIDATE[np.newaxis])[0]


def test_one_record(several):
    for replay in several:
        x, y = series(replay)
        e = record_errors(replay, CANDIDATE)
        assert e.rmse == pytest.approx(np.sqrt(np.mean((x - y) ** 2)), rel=1e-12)
        assert e.nrmse == pytest.approx(e.rmse / np.sqrt(np.mean(x**2)), rel=1e-12)
        assert e.chi2_per_sample == pytest.approx(e.rmse**2 / replay.record.noise.rms**2, rel=1e-12)
        assert e.s1 == pytest.approx(np.sum(np.maximum(0, np.abs(x) - np.abs(x - y))) / np.sum(np.abs(x)), rel=1e-12)
        assert e.s == pytest.approx(np.sqrt(e.s1 * e.s2), rel=1e-12)


def test_records_joined(several):
    pairs = [series(r) for r in several]
    each = [record_errors(r, CANDIDATE) for r in several]
    joined = campaign_errors(several, CANDIDATE)
    n = np.array([len(x) for x, _ in pairs])
    seconds = np.array([0.4, 0.7, 1.2])
    misses = np.concatenate([x - y for x, y in pairs])
    noise = np.concatenate([np.full(len(r.measured), r.record.noise.rms) for r in several])
    assert joined.rmse == pytest.approx(np.sqrt(np.mean(misses**2)), rel=1e-12)
    assert joined.chi2_per_sample == pytest.approx(np.mean((misses / noise) ** 2), rel=1e-12)
    assert joined.nrmse == pytest.approx(np.sqrt(n @ [e.nrmse**2 for e in each] / n.sum()), rel=1e-12)
    degrees = np.array([similarity(x, y[np.newaxis], 1e-3) for x, y in pairs])[:, :, 0]
    np.testing.assert_allclose([joined.s, joined.s1, joined.s2], seconds @ degrees / seconds.sum(), rtol=1e-12)


def test_without_noise_there_is_no_chi_square(several):
    from dataclasses import replace

    quiet = replace(several[0], record=replace(several[0].record, noise=replace(several[0].record.noise, rms=0.0)))
    assert record_errors(quiet, CANDIDATE).chi2_per_sample is None
    assert campaign_errors((quiet, several[1]), CANDIDATE).chi2_per_sample is None
    assert campaign_errors((several[1],), CANDIDATE).chi2_per_sample is not None


def test_a_diverged_candidate_has_infinite_errors(several):
    e = campaign_errors(several, CANDIDATE * [1, 1, 1, 400])
    assert (e.rmse, e.nrmse, e.chi2_per_sample) == (np.inf, np.inf, np.inf)
    assert (e.s, e.s1, e.s2) == (0.0, 0.0, 0.0)


def test_no_records_no_errors():
    assert campaign_errors((), CANDIDATE) is None
