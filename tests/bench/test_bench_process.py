"""Framework, memory and start-up, at tiny sizes."""

import sys
from pathlib import Path

import numpy as np
import pytest

from armid.bench import memory
from armid.bench.framework import framework_rows, identification, pymoo_framework, sample_replays
from armid.bench.memory import beyond_output, forget_peak, grown, measured_apart, memory_rows, peak_memory
from armid.bench.sample import NOISE, child_environment, write_sample
from armid.bench.scale import scale_rows
from armid.bench.startup import startup_row
from armid.errors import ArmidError
from armid.record import read_campaign

STAND_IN = (sys.executable, "-c", "import sys; assert sys.argv[1] == 'simulate' and sys.argv[3] == '--out'")


def test_the_sample_campaign_can_be_read_and_has_its_noise(tmp_path: Path) -> None:
    campaign = read_campaign(write_sample(tmp_path / "c"))
    (record,) = campaign.train
    assert record.measured.shape == (701,)
    assert record.noise.source == "rest"
    assert record.noise.rms == pytest.approx(NOISE, rel=0.3)


def test_an_identification_uses_its_whole_budget_and_its_time_is_split() -> None:
    spent = identification(sample_replays(101), 2)
    assert spent.used == 160
    parts = (spent.simulation, spent.fitness, spent.framework)
    assert all(np.isfinite(p) and p > 0 for p in parts)
    assert spent.total == pytest.approx(sum(parts))
    assert pymoo_framework(2) > 0


def test_framework_rows() -> None:
    framework, whole = framework_rows(rounds=1, n_iterations=2, n_samples=101)
    assert framework.ratio > 0
    assert framework.wanted.text == "at most 0.5"
    assert whole.simulations_per_s > 0
    assert all(word in whole.note for word in ("simulation", "fitness", "framework"))


def test_memory_is_measured_in_another_process() -> None:
    assert measured_apart(8, 60) >= 0 or peak_memory() is None
    assert beyond_output(8, 60) >= 0 or peak_memory() is None


def test_memory_rows_compare_ten_times_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "measured_apart", lambda n, s: n * s)
    candidates, samples = memory_rows(10, 100)
    for row in (candidates, samples):
        assert row.ratio == pytest.approx(1 / 8)
        assert row.met is False
    assert "10 to 100" in candidates.what
    assert "100 to 1,000 samples" in samples.what


def test_memory_that_shrinks_counts_as_flat_and_unknown_memory_as_unknown() -> None:
    assert grown("memory", 10, 5, 100).ratio == 0
    unknown = grown("memory", -1, 5, 100)
    assert unknown.measured is None
    assert unknown.met is None


@pytest.mark.skipif(peak_memory() is None, reason="the system does not tell the peak memory of a process")
def test_the_peak_sees_what_is_taken() -> None:
    forget_peak()
    before = peak_memory()
    taken = np.ones(60_000_000 // 8)
    assert peak_memory() - before > 0.5 * taken.nbytes


def test_start_up_calls_the_command_with_a_campaign() -> None:
    row = startup_row(rounds=1, command=STAND_IN, n_samples=60)
    assert 0 < row.ratio < np.inf
    assert "compiled nothing" in row.note


def test_start_up_says_why_the_command_failed() -> None:
    command = (sys.executable, "-c", "raise SystemExit('no such thing')")
    with pytest.raises(ArmidError, match="no such thing"):
        startup_row(rounds=1, command=command, n_samples=60)


def test_a_child_finds_this_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "elsewhere")
    assert child_environment()["PYTHONPATH"].endswith("elsewhere")


@pytest.mark.slow
def test_large_campaigns_are_identified_in_memory_that_is_told() -> None:
    long, many = scale_rows(20_000, 10)
    assert (long.what, many.what) == ("identify, 20,000 samples", "identify, 10 records")
    for row in (long, many):
        assert row.measured is None or row.measured > 50.0
