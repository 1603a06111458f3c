"""The table, the clock, and the whole run with its parts replaced."""

from itertools import count

import pytest

from armid.bench import Bound, Row, bench, bench_table, run_bench
from armid.bench.table import number
from armid.bench.timing import Stopwatch, fastest

ROWS = [
    Row("engine", 3.84, "us", simulations_per_s=260_150.0, error=3.04e-6, note="on one core"),
    Row("scipy", 9756.0, "us", "the engine's time", 2538.0, Bound(2000), 102.5, 4.4e-6),
    Row("second start", 0.9, "s", "the imports", 2.9, Bound(2.5, at_least=False)),
    Row("memory", None, "MB"),
]


def test_a_bound_is_met_or_not() -> None:
    assert [row.met for row in ROWS] == [None, True, False, None]
    assert Bound(2000).text == "at least 2,000"
    assert Bound(0.5, at_least=False).text == "at most 0.5"
    assert Bound(2.5, at_least=False).holds(2.5)


def test_the_table_prints_every_row_on_a_line_of_its_own() -> None:
    lines = bench_table(ROWS).splitlines()
    for row, line in zip(ROWS, lines[2:], strict=False):
        assert line.startswith(row.what)
    assert "3.84 us" in lines[2]
    assert "260,150" in lines[2]
    assert "3.0e-06" in lines[2]
    assert all(text in lines[3] for text in ("9,756 us", "2,538", "the engine's time", "at least 2,000", "yes"))
    assert "NO" in lines[4]
    assert "not known" in lines[5]


def test_the_table_says_in_words_what_falls_short_and_what_else_to_know() -> None:
    text = bench_table(ROWS)
    assert "Falls short: second start has a ratio of 2.9, at most 2.5 is wanted." in text
    assert "engine: on one core." in text
    assert "cores" in text
    assert "All 1 ratios that have a bound are within it." in bench_table(ROWS[:2])


@pytest.mark.parametrize(
    ("value", "text"),
    [(123456.7, "123,457"), (38.42, "38.4"), (0.61749, "0.617"), (0.0, "0.00"), (0.00002, "2.0e-05")],
)
def test_numbers_have_three_digits(value: float, text: str) -> None:
    assert number(value) == text


def test_works_run_in_turn_and_the_shortest_time_counts() -> None:
    calls: list[str] = []
    ticks = count()
    best = fastest({n: lambda n=n: calls.append(n) for n in "ab"}, 3, lambda: float(next(ticks)), slot=0.0)
    assert calls == list("ab" * 4)
    assert best == {"a": 1.0, "b": 1.0}


def test_a_short_work_is_repeated() -> None:
    calls = []
    fastest({"a": lambda: calls.append(1)}, 1, slot=0.01)
    assert len(calls) > 2


def test_a_stopwatch_adds_up() -> None:
    ticks = count()
    watch = Stopwatch(lambda: float(next(ticks)))
    assert watch.timed(max, 3, 4) == 4
    watch.timed(sum, [1, 2])
    assert watch.spent == 2.0


def test_a_run_measures_every_part_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "bench_parts", lambda *_: {"first": lambda: ROWS[:2], "second": lambda: ROWS[2]})
    told: list[str] = []
    assert run_bench(told.append) == ROWS[:3]
    assert told == ["first", "second"]
    assert run_bench() == ROWS[:3]


def test_quick_has_the_same_parts() -> None:
    assert list(bench.bench_parts(quick=True)) == list(bench.bench_parts())
