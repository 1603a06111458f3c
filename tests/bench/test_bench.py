"""The benchmarks at tiny sizes: right numbers and tables, no claims about time."""

import sys
from inspect import signature
from itertools import count

import numpy as np
import pytest

from armid.errors import ArmidError
from bench import processes
from bench import run as bench
from bench.engine import ALLOWED, effects_row, engine_rows, fitness_rows, threads_row
from bench.framework import framework_rows
from bench.measure import Bound, Row, bench_table, fastest
from bench.processes import grown, memory_rows, scale_rows, startup_row

ROWS = [
    Row("engine", 3.84, "us", simulations_per_s=260_150.0, error=3.04e-6, note="on one core"),
    Row("scipy", 9756.0, "us", "the engine's time", 2538.0, Bound(2000), 102.5, 4.4e-6),
    Row("second start", 0.9, "s", "the imports", 2.9, Bound(2.5, at_least=False)),
    Row("memory", None, "MB"),
]


STAND_IN = (sys.executable, "-c", "import sys; assert sys.argv[1] == 'simulate' and sys.argv[3] == '--out'")


def test_the_table_prints_every_row_and_says_in_words_what_falls_short():
    lines = bench_table(ROWS).splitlines()
    for row, line in zip(ROWS, lines[2:], strict=False):
        assert line.startswith(row.what)
    assert "3.84 us" in lines[2]
    assert "260,150" in lines[2]
    assert "3.0e-06" in lines[2]
    assert all(text in lines[3] for text in ("9,756 us", "2,538", "the engine's time", "at least 2,000", "yes"))
    assert "NO" in lines[4]
    assert "not known" in lines[5]
    text = bench_table(ROWS)
    assert "Falls short: second start has a ratio of 2.9, at most 2.5 is wanted." in text
    assert "engine: on one core." in text
    assert "cores" in text
    assert "All 1 ratios that have a bound are within it." in bench_table(ROWS[:2])


def test_works_run_in_turn_and_the_shortest_time_counts():
    calls = []
    ticks = count()
    best = fastest({n: lambda n=n: calls.append(n) for n in "ab"}, 3, lambda: float(next(ticks)), slot=0.0)
    assert calls == list("ab" * 4)
    assert best == {"a": 1.0, "b": 1.0}


def test_quick_has_the_same_parts_with_options_that_they_take_and_a_run_measures_every_part(monkeypatch):
    quick = bench.bench_parts(quick=True)
    assert list(quick) == list(bench.bench_parts())
    for part in quick.values():
        assert part.keywords.keys() <= signature(part.func).parameters.keys()
    monkeypatch.setattr(bench, "bench_parts", lambda *_: {"first": lambda: ROWS[:2], "second": lambda: ROWS[2]})
    assert bench.run_bench() == ROWS[:3]


def assert_measured(row):
    numbers = [row.measured, row.ratio, row.simulations_per_s]
    assert all(n is None or (np.isfinite(n) and n > 0) for n in numbers)
    assert row.measured is not None
    assert (row.ratio is None) == (row.wanted is None) == (row.met is None)


@pytest.mark.slow
def test_engine_scipy_and_plain_loop_are_measured_with_their_errors():
    engine, scipy, plain = rows = engine_rows(rounds=1, n_candidates=16, n_scipy=2)
    for row in rows:
        assert_measured(row)
        assert row.simulations_per_s == pytest.approx(1e6 / row.measured)
    assert engine.ratio is None
    assert max(engine.error, scipy.error) <= ALLOWED
    assert plain.error <= 2e-3
    assert [r.wanted.number for r in (scipy, plain)] == [2000, 12]


@pytest.mark.nightly
def test_effects_are_measured_on_candidates_that_reach_their_switch():
    row = effects_row(rounds=1, n_candidates=16)
    assert_measured(row)
    assert row.error <= ALLOWED
    assert "16 of 16 candidates reach their switch" in row.note


def test_threads_give_the_same_bits_and_fitnesses_and_the_framework_are_measured_apart():
    row = threads_row(rounds=1, n_candidates=32, attempts=1)
    assert_measured(row)
    assert row.error <= ALLOWED
    assert "the same bits" in row.note
    whole, numerical = fitness_rows(rounds=1, n_candidates=4)
    assert whole.measured > numerical.measured > 0
    framework, whole = framework_rows(rounds=1, n_iterations=2, n_samples=101)
    assert (framework.ratio > 0, framework.wanted.text, whole.simulations_per_s > 0) == (True, "at most 0.5", True)
    assert all(word in whole.note for word in ("simulation", "fitness", "framework"))


def test_memory_rows_compare_ten_times_the_work(monkeypatch):
    monkeypatch.setattr(processes, "measured_apart", lambda n, s: n * s)
    candidates, samples = memory_rows(10, 100)
    for row in (candidates, samples):
        assert row.ratio == pytest.approx(1 / 8)
        assert row.met is False
    assert "10 to 100" in candidates.what
    assert "100 to 1,000 samples" in samples.what
    assert grown("memory", 10, 5, 100).ratio == 0
    unknown = grown("memory", -1, 5, 100)
    assert (unknown.measured, unknown.met) == (None, None)


def test_start_up_calls_the_command_and_says_why_it_failed(tmp_path, monkeypatch):
    # a folder of its own: other tests compile into the shared one meanwhile
    monkeypatch.setenv("ARMID_CACHE", str(tmp_path))
    row = startup_row(rounds=1, command=STAND_IN, n_samples=60)
    assert 0 < row.ratio < np.inf
    assert "compiled nothing" in row.note
    command = (sys.executable, "-c", "raise SystemExit('no such thing')")
    with pytest.raises(ArmidError, match="no such thing"):
        startup_row(rounds=1, command=command, n_samples=60)


@pytest.mark.nightly
def test_large_campaigns_are_identified_in_memory_that_is_told():
    long, many = scale_rows(20_000, 10)
    assert (long.what, many.what) == ("identify, 20,000 samples", "identify, 10 records")
    for row in (long, many):
        assert row.measured is None or row.measured > 50.0
