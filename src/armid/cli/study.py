"""`armid study`: run what is missing of a study."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from armid.cli.options import examples, out_option, plugin_option

if TYPE_CHECKING:
    from armid.study.runner import Ending


MOST_NAMED = 300


@click.command("study", short_help="Run what is missing of a study.", epilog=examples(
    "armid study studies/table1_short.toml",
    "armid study studies/table1.toml --jobs 2 --only 'row 1/pso*'",
    "armid study mine.toml --plugin mine.py:my_search --out results/mine",
))  # fmt: skip
@click.argument("study", type=click.Path(path_type=Path))
@click.option("--jobs", type=click.IntRange(1), help="Worker processes. [default: as many as processors]")
@click.option("--dask", metavar="tcp://HOST:PORT", help="Scheduler of a Dask cluster, in place of own processes.")
@out_option("Folder of the results. [default: results/NAME]")
@click.option(
    "--time-limit", type=float, metavar="S", show_default="600",
    help="A run that takes longer is stopped and counts as failed, s.",
)  # fmt: skip
@click.option(
    "--only", default="*", metavar="CASE/IDENTIFIER",
    help="Run these only; * and ? stand for any letters, CASE alone for all identifiers.",
)  # fmt: skip
@click.option("--retry", is_flag=True, help="Perform failed runs anew.")
@plugin_option
def study_command(
    study: Path, jobs: int | None, dask: str | None, out: Path | None, time_limit: float | None, only: str, retry: bool,
    plugins: tuple[str, ...],
) -> None:  # fmt: skip
    """Run what is missing of STUDY, a TOML file of cases, identifiers, fitnesses and seeds, or of campaigns to close.

    Finished runs are kept in one SQLite file, whatever ends the program; the same command goes on where it was.
    Several may work on one study at once. A study whose file has changed keeps the runs whose settings have not. Ends
    with 0 also where runs have failed, which is told; 130 after Ctrl-C.
    """
    from armid.study.runner import TIME_LIMIT_S, ProgressBar, absolute, run
    from armid.study.tasks import read_study

    with ProgressBar() as watch:
        known = read_study(study, absolute(plugins))
        limit = TIME_LIMIT_S if time_limit is None else time_limit
        ending = run(known, study, jobs, dask, out, limit, only, retry, watch.update)
    for line in words(ending):
        print(line)
    if ending.interrupted:
        sys.exit(130)
    if ending.counts.done:
        show_table(ending.folder)


def show_table(folder: Path) -> None:
    from armid.report.terminal import show
    from armid.study.document import summary_of
    from armid.study.results import load_study

    show(summary_of(load_study(folder)))


def words(ending: "Ending") -> list[str]:
    """Return what a reader must know of how it ended, one sentence each."""
    from armid.study.runner import span

    counts, name = ending.counts, ending.study.name
    speed = f", {ending.simulations / ending.seconds:,.0f} simulations/s" if ending.simulations else ""
    lines = [f"{name}: {ending.finished} runs made in {span(ending.seconds)}{speed}; {counts.planned - counts.missing} "
             f"of {counts.planned} are in {ending.folder}"]  # fmt: skip
    if ending.interrupted:
        lines.append("interrupted: every finished run is kept, the same command goes on")
    elif counts.missing and ending.others:
        others = ", ".join(map(str, ending.others))
        lines.append(f"{counts.missing} runs are still with another runner (process {others})")
    if counts.failed:
        lines.append(f"{counts.failed} runs failed, the first: {ending.first_error[:MOST_NAMED]}")
    return lines
