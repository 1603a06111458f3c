"""Every ratio in one run."""

import argparse
from collections.abc import Callable
from functools import partial

from armid.registry import load_registry
from bench.engine import effects_row, engine_rows, fitness_rows, threads_row
from bench.framework import framework_rows
from bench.measure import Row, bench_table
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


def run_bench(progress: Callable[[str], None] | None = None, quick: bool = False) -> list[Row]:
    """Measure everything, one part after the other, and return the rows of the table.

    progress: called with the name of each part before it starts. quick: fewer repetitions, rougher figures.
    Raises ArmidError when armid cannot be called as a program.
    """
    rows: list[Row] = []
    for name, part in bench_parts(quick).items():
        if progress:
            progress(name)
        found = part()
        rows += found if isinstance(found, list) else [found]
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m bench", description="Measure speed, error and memory.")
    parser.add_argument("--quick", action="store_true", help="fewer repetitions: rougher figures in a few seconds")
    options = parser.parse_args()
    load_registry()
    print(bench_table(run_bench(quick=options.quick)))
