"""`armid bench`: how fast, how right, how large."""

import click

from armid.cli.options import examples, plugin_option
from armid.registry import load_registry


@click.command("bench", epilog=examples("armid bench --quick"))
@click.option("--quick", is_flag=True, help="Fewer repetitions: rougher figures in a few seconds.")
@plugin_option
def bench_command(quick: bool, plugins: tuple[str, ...]) -> None:
    """Measure speed, error and memory.

    The engine against scipy and a plain loop, in one run, every ratio in one table: times in microseconds a
    simulation, errors in rad/s, memory in MB beside what the results themselves take.
    """
    from armid.bench import bench_table, run_bench  # noqa: PLC0415 - imports what it measures

    load_registry(plugins)
    print(bench_table(run_bench(quick=quick)))
