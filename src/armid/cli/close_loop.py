"""`armid close-loop`: what the declared model lacks, from the records of a campaign."""

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import click

from armid.cli.options import examples, opened, out_option, problem_options, seed_option
from armid.cli.report import LOOP, refuse_unwritable, show_and_write
from armid.errors import ArmidError, nearest
from armid.model import Effect


@click.command("close-loop", short_help="Find the effects that the declared model lacks.", epilog=examples(
    "armid close-loop studies/campaigns/four_strokes --out results/four_strokes",
    "armid close-loop CAMPAIGN --out DIR --candidates coulomb,viscous,stribeck",
    "armid close-loop CAMPAIGN --out DIR --plugin mine.py:my_drag",
))  # fmt: skip
@problem_options
@out_option("Folder for report.html, report.md, report.json and the figures.", required=True)
@click.option("--candidates", default="", metavar="NAME,NAME", help="Effects to look for. [default: all that apply]")
@click.option("--without", default="", metavar="NAME,NAME", help="Effects not to look for.")
@seed_option
@click.option("--threads", default=2, show_default=True, type=click.IntRange(1), help="Threads of the simulations.")
def close_loop_command(
    campaign: Path, out: Path, effects: str, candidates: str, without: str, bounds: tuple[str, ...],
    fix: tuple[str, ...], window: str, seed: int, threads: int, plugins: tuple[str, ...],
) -> None:  # fmt: skip
    """Find the effects that the declared model lacks, and report the error before and after.

    Identifies the declared model on the train records, tells whether what remains is more than noise, names the effect
    that is missing (or says that it cannot), adds it and identifies again, until nothing earns its parameters. Records
    held out are simulated after the last decision. --bounds and --fix may name parameters of candidates too; searches
    start from evenly spread points, so that nothing is random. Every verdict exits with 0.
    """
    from numpy.random import default_rng

    from armid.loop import close_loop, report_of
    from armid.loop.document import details_of
    from armid.loop.figures import figures_of

    given = opened(campaign, effects, plugins, window, bounds, fix)
    effects_known = given.registry.effects
    named = names_of(candidates, "--candidates", effects_known) or list(effects_known)
    left_out = names_of(without, "--without", effects_known)
    wanted = {name: effects_known[name] for name in named if name not in left_out}
    refuse_unwritable(out)
    with status_line() as tell:
        found = close_loop(given.model, given.campaign, wanted, default_rng(seed), given.bounds, given.fixed,
                           threads=threads, told=tell)  # fmt: skip
    report, details = report_of(found), details_of(found)
    show_and_write(LOOP, report, details, out, figures_of(found, report, details))


def names_of(text: str, option: str, effects: Mapping[str, Effect]) -> list[str]:
    """Return the names in a list of names, each of a known effect."""
    names = [n.strip() for n in text.split(",") if n.strip()]
    for name in names:
        if name not in effects:
            raise ArmidError(f"{option}: effect '{name}' is not known: {nearest(name, effects)}")
    return names


@contextmanager
def status_line() -> Iterator[Callable[[str], None]]:
    """Yield what shows a sentence and the time on a terminal; nothing is shown elsewhere."""
    if not sys.stderr.isatty():
        yield lambda sentence: None
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TimeElapsedColumn(), TextColumn("{task.description}", markup=False)
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("identifying the declared model (compiling at first)", total=None)
        yield lambda sentence: bar.update(task, description=sentence)
