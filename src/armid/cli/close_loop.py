"""`armid close-loop`: what the declared model lacks, from the records of a campaign."""

import sys
from pathlib import Path
from typing import Any

import click

from armid.cli.options import examples, opened, problem_options
from armid.cli.results import LOOP, refuse_unwritable, show_and_write
from armid.errors import ArmidError, nearest
from armid.model import Effect


@click.command("close-loop", short_help="Find the effects that the declared model lacks.", epilog=examples(
    "armid close-loop studies/campaigns/four_strokes --out results/four_strokes",
    "armid close-loop CAMPAIGN --out DIR --candidates coulomb,viscous,stribeck",
    "armid close-loop CAMPAIGN --out DIR --plugin mine.py:my_drag",
))  # fmt: skip
@problem_options
@click.option(
    "--out",
    required=True,
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder for report.html, report.md, report.json and the figures.",
)
@click.option("--candidates", default="", metavar="NAME,NAME", help="Effects to look for. [default: all that apply]")
@click.option("--without", default="", metavar="NAME,NAME", help="Effects not to look for.")
@click.option(
    "--seed",
    default=1,
    show_default=True,
    type=click.IntRange(0),
    help="Seed of everything random; searches here start from evenly spread points, so that nothing is.",
)
@click.option("--threads", default=2, show_default=True, type=click.IntRange(1), help="Threads of the simulations.")
def close_loop_command(
    campaign: Path, out: Path, effects: str, candidates: str, without: str, bounds: tuple[str, ...],
    fix: tuple[str, ...], window: str, seed: int, threads: int, plugins: tuple[str, ...],
) -> None:  # fmt: skip
    """Find the effects that the declared model lacks, and report the error before and after.

    Identifies the declared model on the train records, tells whether what remains is more than noise, names the effect
    that is missing (or says that it cannot), adds it and identifies again, until nothing earns its parameters. Records
    held out are simulated after the last decision. --bounds and --fix may name parameters of candidates too. Every
    verdict exits with 0.
    """
    from numpy.random import default_rng

    from armid.loop import close_loop, report_of
    from armid.loop.document import details_of
    from armid.loop.figures import figures_of

    given = opened(campaign, effects, plugins, window, bounds, fix)
    wanted = looked_for(given.registry.effects, candidates, without)
    refuse_unwritable(out)
    with Status() as status:
        found = close_loop(given.model, given.campaign, wanted, default_rng(seed), given.bounds, given.fixed,
                           threads=threads, told=status.tell)  # fmt: skip
    report, details = report_of(found), details_of(found)
    show_and_write(LOOP, report, details, out, figures_of(found, report, details))


def looked_for(effects: dict[str, Effect], candidates: str, without: str) -> dict[str, Effect]:
    """Return the effects that are candidates.

    Raises ArmidError with the nearest valid name for one that is not known.
    """
    chosen = names_of(candidates, "--candidates", effects) or list(effects)
    left_out = names_of(without, "--without", effects)
    return {n: effects[n] for n in chosen if n not in left_out}


def names_of(text: str, option: str, effects: dict[str, Effect]) -> list[str]:
    """Return the names in a list of names, each of a known effect."""
    names = [n.strip() for n in text.split(",") if n.strip()]
    for name in names:
        if name not in effects:
            raise ArmidError(f"{option}: effect '{name}' is not known: {nearest(name, effects)}")
    return names


class Status:
    """Show on a terminal what is being done and for how long, nothing elsewhere."""

    def __init__(self) -> None:
        self.bar: Any = None

    def __enter__(self) -> "Status":
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

            columns = SpinnerColumn(), TimeElapsedColumn(), TextColumn("{task.description}", markup=False)
            self.bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self.task = self.bar.add_task("identifying the declared model (compiling at first)", total=None)
            self.bar.start()
        return self

    def tell(self, sentence: str) -> None:
        """Show what is being done."""
        if self.bar is not None:
            self.bar.update(self.task, description=sentence)

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()
