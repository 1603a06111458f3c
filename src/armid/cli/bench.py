"""`armid bench`: how fast, how right, how large."""

from typing import Annotated

import typer


def bench(
    quick: Annotated[bool, typer.Option("--quick", help="Fewer repetitions: rougher figures in a few seconds.")] = False,
) -> None:
    """Measure the engine against scipy and a plain loop, in one run, and print every ratio in one table."""
    from armid.bench import bench_table, run_bench  # noqa: PLC0415 - imports what it measures

    print(bench_table(run_bench(quick=quick)))
