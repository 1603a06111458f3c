"""`armid close-loop`: what the declared model lacks, from the records of a campaign."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from armid.cli.options import (
    NewFiles,
    campaign_argument,
    effects_option,
    examples,
    fixed_values,
    intervals,
    made_by,
    opened,
    plugin_option,
    refuse_unwritable,
)
from armid.errors import ArmidError, nearest
from armid.model import Effect

if TYPE_CHECKING:
    from armid.loop import ClosedLoop


@click.command("close-loop", short_help="Find the effects that the declared model lacks.", epilog=examples(
    "armid close-loop studies/campaigns/four_strokes --out results/four_strokes",
    "armid close-loop CAMPAIGN --out DIR --candidates coulomb,viscous,stribeck",
    "armid close-loop CAMPAIGN --out DIR --plugin mine.py:my_drag",
))  # fmt: skip
@campaign_argument
@click.option(
    "--out",
    required=True,
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder for report.html, report.md, report.json and the figures.",
)
@effects_option
@click.option("--candidates", default="", metavar="NAME,NAME", help="Effects to look for. [default: all that apply]")
@click.option("--without", default="", metavar="NAME,NAME", help="Effects not to look for.")
@click.option(
    "--bounds",
    multiple=True,
    metavar="NAME=LOW:HIGH",
    help="Free a parameter, of the model or of a candidate, between bounds, SI. Repeatable.",
)
@click.option("--fix", multiple=True, metavar="NAME=VALUE", help="Fix a parameter, SI. Repeatable.")
@click.option("--window", default="", metavar="A:B", help="What is seen of every record, s.")
@click.option(
    "--seed",
    default=1,
    show_default=True,
    type=click.IntRange(0),
    help="Seed of everything random; searches here start from evenly spread points, so that nothing is.",
)
@click.option("--threads", default=2, show_default=True, type=click.IntRange(1), help="Threads of the simulations.")
@plugin_option
def close_loop_command(
    campaign: Path, out: Path, effects: str, candidates: str, without: str, bounds: tuple[str, ...],
    fix: tuple[str, ...], window: str, seed: int, threads: int, plugins: tuple[str, ...],
) -> None:  # fmt: skip
    """Find the effects that the declared model lacks, and report the error before and after.

    Identifies the declared model on the train records, tells whether what remains is more than noise, names the effect
    that is missing (or says that it cannot), adds it and identifies again, until nothing earns its parameters. Records
    held out are simulated after the last decision. Every verdict exits with 0.
    """
    from numpy.random import default_rng

    from armid.loop import close_loop

    registry, read, model = opened(campaign, effects, plugins, window)
    wanted = looked_for(registry.effects, candidates, without)
    overrides = intervals(bounds, "--bounds"), fixed_values(fix, model)
    refuse_unwritable(out)
    with Status() as status:
        found = close_loop(model, read, wanted, default_rng(seed), *overrides, threads=threads, told=status.tell)
    report(found)
    write(found, out)


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


def report(found: "ClosedLoop") -> None:
    """Print the table of steps, the parameters, and remarks."""
    from rich.console import Console
    from rich.table import Table

    from armid.loop.document import error_rows, parameter_rows, remarks, report_error_headers, step_headers, step_rows

    console = Console(width=None if sys.stdout.isatty() else 140)
    tables: list[tuple[str, list[str], list[list[str]]]] = [
        ("Steps", step_headers(found), step_rows(found)),
        ("Parameters", ["parameter", "before", "after", "trusted"], parameter_rows(found)),
        ("Errors", report_error_headers(found), error_rows(found)),
    ]
    for title, headers, rows in tables:
        if rows:
            shown = Table(*headers, title=title)
            for row in rows:
                shown.add_row(*row)
            console.print(shown)
    console.print(f"verdict: {found.verdict}", highlight=False)
    for remark in remarks(found):
        console.print(f"- {remark}", highlight=False, markup=False)


def write(found: "ClosedLoop", out: Path) -> None:
    """Write report.html, report.md, report.json, details.json and the figures, all or none."""
    from armid.cli.report import LOOP, write_page
    from armid.loop import report_of
    from armid.loop.document import (
        details_of,
        markdown,
    )
    from armid.loop.figures import (
        figures_of,
        residual_figure,
    )

    figures = figures_of(found)
    with NewFiles(out) as files:
        files.path("report.json").write_text(json.dumps(report_of(found), indent=2, allow_nan=False) + "\n")
        files.path("report.md").write_text(markdown(found, list(figures)))
        files.path("details.json").write_text(json.dumps(details_of(found, made_by()), allow_nan=False) + "\n")
        for name, draw in figures.items():
            draw(found, files.path(name))
            if draw is not residual_figure:
                # the page draws residuals itself, with layers; as SVG they would be large
                draw(found, files.path(str(Path(name).with_suffix(".svg"))))
        write_page(files, LOOP, out)
    print(f"wrote {', '.join(files.names)} to {out}")


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
