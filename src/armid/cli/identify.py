"""`armid identify`: parameters from the records of a campaign."""

import sys
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
    problem_options,
    value_of,
)
from armid.cli.results import IDENTIFICATION, refuse_unwritable, show_and_write


@click.command("identify", epilog=examples(
    "armid identify studies/campaigns/paper_arm --window 0:0.7 --out results/paper_arm",
    "armid identify CAMPAIGN --identifier pso+least_squares --fitness rmse --budget 3000",
    "armid identify CAMPAIGN --effects coulomb --bounds coulomb.level=0:80 --fix n=1.4",
))  # fmt: skip
@problem_options
@click.option(
    "--identifier",
    default="pso",
    show_default=True,
    help="Who searches: see `armid list identifiers`; multistart:LOCAL; or a chain such as pso+bobyqa.",
)
@click.option(
    "--option",
    "options",
    multiple=True,
    metavar="NAME=VALUE",
    help="Option of the identifier, such as velocity_limit=0.2 of pso; of a chain: share=0.5 (of the budget, "
    "0.5:0.3 for three phases), pso.velocity_limit=0.2. Repeatable.",
)
@click.option("--fitness", default="similarity", show_default=True, help="What is minimised: see `armid list fitness`.")
@click.option(
    "--budget",
    default=12_000,
    show_default=True,
    help="Simulations: one candidate through all train records counts as one.",
)
@click.option(
    "--target",
    type=float,
    help="Stop when reached: the similarity degree for a similarity, else the value of the fitness.",
)
@click.option(
    "--seed",
    default=1,
    show_default=True,
    type=click.IntRange(0),
    help="Seed of everything random; the same gives the same result.",
)
@click.option(
    "--out", type=click.Path(path_type=Path), metavar="DIR", help="Folder for report.html, result.json and the figures."
)
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
    from armid.estimation.identify_document import details_of, result_of
    from armid.estimation.identify_figures import figures_of
    from armid.problem.fitness import SIMILARITIES

    given = opened(campaign, effects, plugins, window, bounds, fix)
    space = given.space()
    distance: Any = chosen(fitness, given.registry.fitness, "fitness")
    searcher = given.registry.identifier_of(identifier)
    searcher = searcher.with_options({n: value_of(v) for n, v in assignments(options, "--option").items()})
    goal = 1.0 - target if target is not None and fitness in SIMILARITIES else target
    refuse_unwritable(out)
    with Progress(budget) as progress:
        found = run(given.campaign, given.model, space, distance, searcher, budget, seed, goal, accuracy_of(accuracy),
                    progress.update)  # fmt: skip
    show_and_write(IDENTIFICATION, result_of(found), details_of(found), out, figures_of(found))
    if found.stopped == INTERRUPTED:
        sys.exit(130)


class Progress:
    """Show a bar with rate and time left on a terminal, nothing elsewhere."""

    def __init__(self, budget: int) -> None:
        self.budget = budget
        self.bar: Any = None

    def __enter__(self) -> "Progress":
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

            self.bar = Progress(
                TextColumn("{task.completed:.0f}/{task.total:.0f} simulations"), BarColumn(),
                TextColumn("{task.fields[rate]:.0f}/s"), TimeRemainingColumn(),
                TextColumn("best {task.fields[best]:.6g}"), console=Console(stderr=True),
            )  # fmt: skip
            self.task = self.bar.add_task("", total=self.budget, best=float("inf"), rate=0.0)
            self.bar.start()
        return self

    def update(self, meter: Any) -> None:
        """Move the bar."""
        if self.bar is not None:
            # rich does not know a speed until it has seen two steps
            rate = self.bar.tasks[0].speed or 0.0
            self.bar.update(self.task, completed=meter.used, best=meter.best_f, rate=rate)

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()
