"""`armid check`: a user's own things keep the contract; `armid doctor`: armid works here; `armid bench`: how fast."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from importlib.metadata import requires, version
from itertools import chain, count
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import TYPE_CHECKING

import click

from armid.cli.options import command, completes, examples, give, of_studies, plugin_option, say
from armid.errors import ArmidError, refuse_unless_known
from armid.registry import Registry, load_plugin, load_registry

if TYPE_CHECKING:
    from armid.contract.trials import ContractPoint

# Time after which an alarm that was not heard is given once more [s].
ALARM_AGAIN_S = 1.0


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
        refuse_unless_known(on, registry.plants, f"--on '{on}' is not a plant")
        registry.plants = {on: registry.plants[on]}
    kind, name, points = points_of(thing, registry)
    tell_points(f"{kind}: {name}", limited(points, time_limit), kind=kind, name=name)


def tell_points(title: str, points: "Iterator[ContractPoint]", **about: str) -> None:
    # what cannot be tried at all is refused before anything is printed
    first = next(points)
    say(title)
    entries = []
    for point in chain([first], points):
        entries.append(asdict(point))
        say(f"  {'?   ' if point.unclear else 'ok  ' if point.passed else 'FAIL'} {point.name}: {point.sentence}")
    failed, unclear = sum(not point["passed"] for point in entries), sum(point["unclear"] for point in entries)
    text = f"{len(entries) - failed - unclear} of {len(entries)} points hold"
    say(f"{text}, {unclear} cannot be judged: look at it" if unclear else text)
    give(**about, passed=not failed, points=entries)
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
    signal.setitimer(signal.ITIMER_REAL, seconds, ALARM_AGAIN_S)
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
    kind, name, plugin = load_plugin(thing)
    return kind, name, check_thing(kind, name, plugin, registry.plants)


@command("bench", short_help="Measure speed, error and memory.", epilog=examples("armid bench --quick"))
@click.option("--quick", is_flag=True, help="Fewer repetitions: rougher figures in a few seconds.")
@plugin_option
def bench_command(quick: bool, plugins: tuple[str, ...]) -> None:
    """Measure speed, error and memory, with the programs in studies/bench of the repository (`pip install -e`).

    The engine against scipy and a plain loop, in one run, every ratio in one table: times in microseconds a
    simulation, errors in rad/s, memory in MB without what the results themselves take.
    """
    load_registry(plugins)
    rows = of_studies("bench.run").run_bench(quick=quick)
    say(*of_studies("bench.measure").bench_table(rows).splitlines())
    give(rows=[vars(row) for row in rows])


# Half widths of the 95 % interval within which the truth of the synthetic axis has to be found.
HALF_WIDTHS = 2.0


@command("doctor", short_help="Say whether armid works here.", epilog=examples("armid doctor"))
def doctor_command() -> None:
    """Say whether armid works here.

    Versions, the cache of compiled models, and one identification of synthetic records, whose model is compiled for it.
    Exit code 0 where all is well, 1 where something is not.
    """
    tell_points("armid doctor", doctor_points(), kind="doctor")


def doctor_points() -> "Iterator[ContractPoint]":
    """Yield each point when it is done; a failure is reported with its reason, and the rest is still tried."""
    from armid.contract.trials import ContractPoint

    for name, work in POINTS.items():
        begin = perf_counter()
        try:
            passed, sentence = work()
        except Exception as error:
            # whatever is wrong here is what this command is there to tell
            passed, sentence = False, f"{type(error).__name__}: {error}"
        yield ContractPoint(name, passed, f"{sentence} ({perf_counter() - begin:.1f} s)")


def versions() -> tuple[bool, str]:
    from packaging.requirements import Requirement

    needed = [r for r in map(Requirement, requires("armid") or ()) if r.marker is None or r.marker.evaluate()]
    wrong = [f"{r.name} {version(r.name)} ({r.specifier} expected)" for r in needed
             if not r.specifier.contains(version(r.name), prereleases=True)]  # fmt: skip
    return not wrong, ", ".join(wrong) or f"armid {version('armid')}; {len(needed)} packages as they should be"


def cache() -> tuple[bool, str]:
    from armid.engine.compile import cache_folder, unusable

    folder = cache_folder()
    why = unusable(folder)
    return not why, f"{folder} cannot be used ({why})" if why else f"{folder} can be written"


def identification() -> tuple[bool, str]:
    """Identify the synthetic axis of `armid new campaign`."""
    from armid.api import identify
    from armid.cli.new import INERTIA, campaign_text, synthetic_records
    from armid.record import write_campaign

    with TemporaryDirectory(prefix="armid-") as place:
        folder = write_campaign(f"{place}/axis", campaign_text("axis"), synthetic_records())
        inertia = identify(folder, effects=["viscous"], identifier="least_squares").to_dict()["parameters"]["inertia"]
    off = abs(inertia["value"] - INERTIA) / (inertia["high"] - inertia["value"])
    near = f"{off:.1f} half widths of its interval"
    return off <= HALF_WIDTHS, f"inertia {inertia['value']:.5g} kg m2 (true: {INERTIA:g}), {near}"


POINTS = {"versions": versions, "cache": cache, "identification": identification}
