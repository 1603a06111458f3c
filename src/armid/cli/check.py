"""`armid check`: whether a user's own things keep the contract; `armid bench`: how fast and how right the engine is."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING

import click

from armid.cli.options import command, completes, examples, give, plugin_option, say
from armid.errors import ArmidError, nearest
from armid.registry import Registry, load_plugin, load_registry

if TYPE_CHECKING:
    from armid.contract.trials import ContractPoint

# Time after which an alarm that was not heard is given once more [s].
AGAIN_S = 1.0


@command("check", epilog=examples(
    "armid check mine.py:my_drag --on driven_axis", "armid check studies/campaigns/paper_arm",
))  # fmt: skip
@click.argument("thing", metavar="FILE.py:attribute|CAMPAIGN")
@click.option(
    "--on",
    metavar="PLANT",
    shell_complete=completes("plants"),
    help="Try an effect on this plant alone. [default: all that take it]",
)
@click.option("--time-limit", default=60.0, show_default=True, metavar="S",
              help="Longest time of one point, s; kept where the system has alarms, as all but Windows.")  # fmt: skip
@plugin_option
def check_command(thing: str, on: str | None, time_limit: float, plugins: tuple[str, ...]) -> None:
    """Run the contract on your own things.

    A plant, an effect, a fitness or an identifier in a Python file, which is run; an effect is tried on
    every plant that offers its ports, those of --plugin included. A campaign is read, and its model simulated through
    each record. Every point is printed when it is done; where one takes too long, those after it are not tried. Exit
    code 0 when all hold, 1 when one does not, 2 when there is nothing to try.
    """
    if not time_limit > 0.0:
        raise ArmidError(f"--time-limit is {time_limit:g}, a number of seconds above 0 is expected")
    registry = load_registry(plugins)
    if on is not None:
        if on not in registry.plants:
            raise ArmidError(f"--on '{on}' is no plant: {nearest(on, registry.plants)}")
        registry.plants = {on: registry.plants[on]}
    kind, name, points = points_of(thing, registry)
    tell_points(f"{kind}: {name}", limited(points, time_limit), kind=kind, name=name)


def tell_points(title: str, points: "Iterator[ContractPoint]", **about: str) -> None:
    # what cannot be tried at all is refused before anything is printed
    first = next(points)
    say(title)
    told = []
    for point in chain([first], points):
        told.append({"name": point.name, "passed": point.passed, "sentence": point.sentence})
        say(f"  {'ok  ' if point.passed else 'FAIL'} {point.name}: {point.sentence}")
    failed = sum(not point["passed"] for point in told)
    say(f"{len(told) - failed} of {len(told)} points hold")
    give(**about, passed=not failed, points=told)
    if failed:
        sys.exit(1)


def limited(points: "Iterator[ContractPoint]", seconds: float) -> "Iterator[ContractPoint]":
    """Yield the points; where one takes longer, yield one that says so in its place, and no more."""
    from armid.contract.trials import ContractPoint

    for place in count(1):
        try:
            with alarm(seconds):
                point = next(points)
        except StopIteration:
            return
        except TimeoutError:
            text = f"point {place} takes longer than {seconds:g} s, what had to be compiled counted"
            yield ContractPoint("time limit", False, f"{text}; those after it were not tried; --time-limit gives more")
            return
        yield point


@contextmanager
def alarm(seconds: float) -> Iterator[None]:
    if not hasattr(signal, "setitimer"):
        yield
        return

    def over(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, over)
    # again and again: what is raised while the compiler calls back is lost
    signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def points_of(thing: str, registry: Registry) -> tuple[str, str, "Iterator[ContractPoint]"]:
    # simulations and pymoo, which other commands do not need
    from armid.contract.check import check_campaign, check_thing
    from armid.record import read_campaign

    if Path(thing).is_dir() or (":" not in thing and Path(thing).suffix != ".py"):
        campaign = read_campaign(thing, registry.plants, registry.effects)
        return "campaign", campaign.name, check_campaign(campaign, registry.effects)
    kind, name, found = load_plugin(thing)
    return kind, name, check_thing(kind, name, found, registry.plants)


@command("bench", short_help="Measure speed, error and memory.", epilog=examples("armid bench --quick"))
@click.option("--quick", is_flag=True, help="Fewer repetitions: rougher figures in a few seconds.")
@plugin_option
def bench_command(quick: bool, plugins: tuple[str, ...]) -> None:
    """Measure speed, error and memory, with the programs in studies/bench of the repository.

    The engine against scipy and a plain loop, in one run, every ratio in one table: times in microseconds a
    simulation, errors in rad/s, memory in MB beside what the results themselves take.
    """
    sys.path.insert(0, str(Path(__file__).parents[3] / "studies"))
    load_registry(plugins)
    rows = import_module("bench.run").run_bench(quick=quick)
    say(*import_module("bench.measure").bench_table(rows).splitlines())
    give(rows=[vars(row) for row in rows])
