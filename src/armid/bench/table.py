"""The benchmark as text: one table, shortfalls in words, notes."""

import os
import platform
from collections.abc import Sequence
from importlib.metadata import version

from armid.bench.row import Row

HEADER = ("what", "measured", "ratio", "of", "wanted", "met", "simulations/s", "error [rad/s]")
LEFT = (True, False, False, True, True, True, False, False)


def bench_table(rows: Sequence[Row]) -> str:
    """Return every row as one line of a table, then what falls short, the notes and the system, as plain text."""
    table = [HEADER, *(cells(row) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = [aligned(line, widths) for line in table]
    lines.insert(1, "-" * (sum(widths) + 2 * (len(widths) - 1)))
    notes = [f"{row.what}: {row.note}." for row in rows if row.note]
    return "\n".join([*lines, "", *verdict(rows), *notes, system_text()])


def aligned(line: Sequence[str], widths: Sequence[int]) -> str:
    """Return one line of the table."""
    padded = (f"{c:<{w}}" if left else f"{c:>{w}}" for c, w, left in zip(line, widths, LEFT, strict=True))
    return "  ".join(padded).rstrip()


def cells(row: Row) -> tuple[str, ...]:
    """Return the texts of a row, in the order of the header."""
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


def verdict(rows: Sequence[Row]) -> list[str]:
    """Return one sentence for each ratio that falls short, or one for all."""
    short = [
        f"Falls short: {row.what} has a ratio of {row.ratio:.4g}, {row.wanted.text} is wanted."
        for row in rows
        if row.met is False and row.ratio is not None and row.wanted is not None
    ]
    return short or [f"All {sum(row.met is True for row in rows)} ratios that have a bound are within it."]


def system_text() -> str:
    """Return what it ran on."""
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba", "pymoo"))
    return (
        f"{available_cores()} cores ({platform.machine()}), load {load_text()}; "
        f"Python {platform.python_version()}, {packages}."
    )


def available_cores() -> int:
    """Return how many cores this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def load_text() -> str:
    """Return the mean number of running processes over the last minute, as text."""
    return f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "not known"
