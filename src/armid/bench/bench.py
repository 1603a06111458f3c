"""Every ratio in one run."""

from collections.abc import Callable, Sequence
from functools import partial

from armid.bench.engine import effects_row, engine_rows, threads_row
from armid.bench.fitness import fitness_rows
from armid.bench.framework import framework_rows
from armid.bench.memory import memory_rows
from armid.bench.row import Row
from armid.bench.scale import scale_rows
from armid.bench.startup import ARMID, startup_row

Part = Callable[[], Row | list[Row]]


def bench_parts(quick: bool = False, command: Sequence[str] = ARMID) -> dict[str, Part]:
    """Return name -> measurement, in the order of the table."""
    if quick:
        return {
            "engine, scipy and the plain loop": partial(engine_rows, rounds=4, n_scipy=8),
            "effects": partial(effects_row, rounds=5),
            "threads": partial(threads_row, rounds=8, attempts=4),
            "fitness": partial(fitness_rows, rounds=5),
            "framework": partial(framework_rows, rounds=2),
            "memory": partial(memory_rows, n_candidates=400),
            "scale": partial(scale_rows, n_samples=100_000, n_records=50),
            "second start": partial(startup_row, rounds=3, command=command),
        }
    return {
        "engine, scipy and the plain loop": engine_rows,
        "effects": effects_row,
        "threads": threads_row,
        "fitness": fitness_rows,
        "framework": framework_rows,
        "memory": memory_rows,
        "scale": scale_rows,
        "second start": partial(startup_row, command=command),
    }


def run_bench(
    progress: Callable[[str], None] | None = None, quick: bool = False, command: Sequence[str] = ARMID
) -> list[Row]:
    """Measure everything, one part after the other, and return the rows of the table.

    progress: called with the name of each part before it starts. quick: fewer repetitions, rougher figures.
    command: how to call armid as a program.

    Raises ArmidError when the program cannot be called.
    """
    rows: list[Row] = []
    for name, part in bench_parts(quick, command).items():
        if progress:
            progress(name)
        found = part()
        rows += found if isinstance(found, list) else [found]
    return rows
