"""Every ratio in one run."""

from collections.abc import Callable
from functools import partial

from bench.engine import effects_row, engine_rows, fitness_rows, threads_row
from bench.framework import framework_rows
from bench.measure import Row
from bench.processes import memory_rows, scale_rows, startup_row

Part = Callable[[], Row | list[Row]]


def bench_parts(quick: bool = False) -> dict[str, Part]:
    """Return name -> measurement, in the order of the table."""
    parts = {
        "engine, scipy and the plain loop": (engine_rows, {"rounds": 4, "n_scipy": 8}),
        "effects": (effects_row, {"rounds": 5}),
        "threads": (threads_row, {"rounds": 8, "attempts": 4}),
        "fitness": (fitness_rows, {"rounds": 5}),
        "framework": (framework_rows, {"rounds": 2}),
        "memory": (memory_rows, {"n_candidates": 400}),
        "scale": (scale_rows, {"n_samples": 100_000, "n_records": 50}),
        "second start": (startup_row, {"rounds": 3}),
    }
    return {name: partial(measure, **(options if quick else {})) for name, (measure, options) in parts.items()}


def run_bench(quick: bool = False) -> list[Row]:
    """Measure everything, one part after the other, and return the rows of the table.

    quick: fewer repetitions, rougher figures.
    Raises ArmidError when armid cannot be called as a program.
    """
    rows: list[Row] = []
    for part in bench_parts(quick).values():
        found = part()
        rows += found if isinstance(found, list) else [found]
    return rows
