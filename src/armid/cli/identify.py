"""`armid identify`: parameters from the records of a campaign."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from armid.cli.options import (
    accuracy_of,
    accuracy_option,
    assignments,
    chosen,
    examples,
    opened,
    out_option,
    problem_options,
    seed_option,
    value_of,
)
from armid.cli.report import IDENTIFICATION, refuse_unwritable, show_and_write


@click.command("identify", epilog=examples(
    "armid identify studies/campaigns/paper_arm --window 0:0.7 --out results/paper_arm",
    "armid identify CAMPAIGN --identifier pso+least_squares --fitness rmse --budget 3000",
    "armid identify CAMPAIGN --effects coulomb --bounds coulomb.level=0:80 --fix n=1.4",
))  # fmt: skip
@problem_options
@click.option(
    "--identifier", default="pso", show_default=True,
    help="Who searches: see `armid list identifiers`; multistart:LOCAL; or a chain such as pso+bobyqa.",
)  # fmt: skip
@click.option(
    "--option", "options", multiple=True, metavar="NAME=VALUE",
    help="Option of the identifier, such as velocity_limit=0.2 of pso; of a chain: share=0.5 (of the budget, "
    "0.5:0.3 for three phases), pso.velocity_limit=0.2. Repeatable.",
)  # fmt: skip
@click.option("--fitness", default="similarity", show_default=True, help="What is minimised: see `armid list fitness`.")
@click.option(
    "--budget", default=12_000, show_default=True,
    help="Simulations: one candidate through all train records counts as one.",
)  # fmt: skip
@click.option(
    "--target", type=float,
    help="Stop when reached: the similarity degree for a similarity, else the value of the fitness.",
)  # fmt: skip
@seed_option
@out_option("Folder for report.html, result.json and the figures.")
@accuracy_option
def identify_command(
    campaign: Path, identifier: str, options: tuple[str, ...], fitness: str, effects: str, bounds: tuple[str, ...],
    fix: tuple[str, ...], window: str, budget: int, target: float | None, seed: int, out: Path | None, accuracy: str,
    plugins: tuple[str, ...],
) -> None:  # fmt: skip
    """Identify parameters from the train records.

    The result is judged on train and holdout. Prints parameters with 95 % intervals (from sensitivities and measured
    noise), warnings in words, and errors. Without --out nothing is written. Ctrl-C ends the search, judges the best so
    far, and exits with 130.
    """
    from armid.estimation.identify import INTERRUPTED
    from armid.estimation.identify import identify as run
    from armid.estimation.identify_document import details_of, figures_of, result_of
    from armid.problem.fitness import SIMILARITIES

    given = opened(campaign, effects, plugins, window, bounds, fix)
    space = given.space()
    distance = chosen(fitness, given.registry.fitness, "fitness")
    searcher = given.registry.identifier_of(identifier)
    searcher = searcher.with_options({n: value_of(v) for n, v in assignments(options, "--option").items()})
    goal = 1.0 - target if target is not None and fitness in SIMILARITIES else target
    refuse_unwritable(out)
    with progress_bar(budget) as update:
        found = run(given.campaign, given.model, space, distance, searcher, budget, seed, goal, accuracy_of(accuracy),
                    update)  # fmt: skip
    show_and_write(IDENTIFICATION, result_of(found), details_of(found), out, figures_of(found))
    if found.stopped == INTERRUPTED:
        sys.exit(130)


@contextmanager
def progress_bar(budget: int) -> Iterator[Callable[[Any], None]]:
    """Yield what shows the state of a search, with rate and time left, on a terminal; nothing is shown elsewhere."""
    if not sys.stderr.isatty():
        yield lambda meter: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.completed:.0f}/{task.total:.0f} simulations"), BarColumn(),
               TextColumn("{task.fields[rate]:.0f}/s"), TimeRemainingColumn(),
               TextColumn("best {task.fields[best]:.6g}"))  # fmt: skip
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("", total=budget, best=float("inf"), rate=0.0)
        # rich does not know a speed until it has seen two steps
        yield lambda m: bar.update(task, completed=m.used, best=m.best_f, rate=bar.tasks[0].speed or 0.0)
