"""A measurement: its line and bound, the clock that took it, and the table of all as text."""

import os
import platform
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import TypeVar

from joblib import cpu_count

Key = TypeVar("Key", bound=Hashable)
Clock = Callable[[], float]
Work = Callable[[], object]

# The time of the process does not count what others do on the same core; not every system has it fine enough.
CPU: Clock = time.process_time if time.get_clock_info("process_time").resolution < 1e-5 else time.perf_counter
WALL: Clock = time.perf_counter


HEADER = ("what", "measured", "ratio", "of", "wanted", "met", "simulations/s", "error [rad/s]")
LEFT = (True, False, False, True, True, True, False, False)


@dataclass(frozen=True)
class Bound:
    """Say what a ratio should be: at least or at most a number."""

    number: float
    at_least: bool = True

    @property
    def text(self) -> str:
        return f"{'at least' if self.at_least else 'at most'} {self.number:,g}"

    def holds(self, ratio: float) -> bool:
        return ratio >= self.number if self.at_least else ratio <= self.number


@dataclass(frozen=True)
class Row:
    """Hold one measurement.

    what: was measured; measured: its value in `unit`, None where this system cannot tell. ratio: to what `baseline`
    says in words; wanted: its bound. simulations_per_s: [1/s]. error: largest error of the recorded signal [rad/s].
    note: what else a reader should know.
    """

    what: str
    measured: float | None
    unit: str
    baseline: str = ""
    ratio: float | None = None
    wanted: Bound | None = None
    simulations_per_s: float | None = None
    error: float | None = None
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the ratio is within its bound, None without ratio or bound."""
        return None if self.ratio is None or self.wanted is None else self.wanted.holds(self.ratio)


# Times of pieces of work, taken in turn, so that whatever disturbs the machine disturbs all of them.


def fastest(works: Mapping[Key, Work], rounds: int = 10, clock: Clock = CPU, slot: float = 0.02) -> dict[Key, float]:
    """Return the shortest time of each work [s].

    Each work runs once to warm up; then, in every round, all of them in turn for `slot` seconds, at least once.
    """
    for work in works.values():
        work()
    best = dict.fromkeys(works, float("inf"))
    for _ in range(rounds):
        for name, work in works.items():
            best[name] = min(best[name], shortest(work, clock, slot))
    return best


def shortest(work: Work, clock: Clock, slot: float) -> float:
    """Return the shortest time of a work that is repeated for `slot` seconds [s]."""
    best, begin = float("inf"), WALL()
    while True:
        start = clock()
        work()
        best = min(best, clock() - start)
        if WALL() - begin >= slot:
            return best


def bench_table(rows: Sequence[Row]) -> str:
    """Return every row as one line of a table, then what falls short, the notes and the system, as plain text."""
    table = [HEADER, *(cells(row) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = []
    for line in table:
        padded = (f"{c:<{w}}" if left else f"{c:>{w}}" for c, w, left in zip(line, widths, LEFT, strict=True))
        lines.append("  ".join(padded).rstrip())
    lines.insert(1, "-" * (sum(widths) + 2 * (len(widths) - 1)))
    short = [
        f"Falls short: {row.what} has a ratio of {row.ratio:.4g}, {row.wanted.text} is wanted."
        for row in rows
        if row.met is False and row.ratio is not None and row.wanted is not None
    ]
    within = f"All {sum(row.met is True for row in rows)} ratios that have a bound are within it."
    notes = [f"{row.what}: {row.note}." for row in rows if row.note]
    return "\n".join([*lines, "", *(short or [within]), *notes, system_text()])


def cells(row: Row) -> tuple[str, ...]:
    return (
        row.what,
        "not known" if row.measured is None else f"{number(row.measured)} {row.unit}",
        "" if row.ratio is None else number(row.ratio),
        row.baseline,
        "" if row.wanted is None else row.wanted.text,
        {None: "", True: "yes", False: "NO"}[row.met],
        "" if row.simulations_per_s is None else number(row.simulations_per_s),
        "" if row.error is None else f"{row.error:.1e}",
    )


def number(value: float) -> str:
    """Return a number with three digits, or all of those before the point."""
    if abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:#.3g}" if abs(value) >= 1e-3 or value == 0 else f"{value:.1e}"


def system_text() -> str:
    """Return what it ran on."""
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba", "pymoo"))
    return (
        f"{cpu_count()} cores ({platform.machine()}), load {load_text()}; "
        f"Python {platform.python_version()}, {packages}."
    )


def load_text() -> str:
    """Return the mean number of running processes over the last minute, as text."""
    return f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "not known"
