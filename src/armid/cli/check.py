"""`armid check`: whether a user's own things keep the contract; `armid bench`: how fast and how right the engine is."""

import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import click

from armid.cli.options import examples, plugin_option
from armid.errors import ArmidError
from armid.registry import Registry, load_plugin, load_registry

if TYPE_CHECKING:
    from armid.contract.trials import ContractPoint


@click.command("check", epilog=examples("armid check mine.py:my_drag", "armid check studies/campaigns/paper_arm"))
@click.argument("thing", metavar="FILE.py:attribute|CAMPAIGN")
@plugin_option
def check_command(thing: str, plugins: tuple[str, ...]) -> None:
    """Run the contract on your own things.

    A plant, an effect, a fitness, an identifier or an analysis in a Python file, which is run; an effect is tried on
    every plant that offers its ports, those of --plugin included. A campaign is read, and its model simulated through
    each record. Every point is printed. Exit code 0 when all hold, 1 when one does not, 2 when there is nothing to try.
    """
    kind, name, findings = findings_of(thing, load_registry(plugins))
    print(f"{kind}: {name}")
    for finding in findings:
        print(f"  {'ok  ' if finding.passed else 'FAIL'} {finding.name}: {finding.sentence}")
    failed = sum(not f.passed for f in findings)
    print(f"{len(findings) - failed} of {len(findings)} points hold")
    if failed:
        sys.exit(1)


def findings_of(thing: str, registry: Registry) -> tuple[str, str, "list[ContractPoint]"]:
    # simulations and pymoo, which other commands do not need
    from armid.contract.check import check_campaign, check_thing
    from armid.record import read_campaign

    if Path(thing).is_dir() or (":" not in thing and Path(thing).suffix != ".py"):
        campaign = read_campaign(thing, registry.plants, registry.effects)
        return "campaign", campaign.name, check_campaign(campaign, registry.effects)
    kind, name, found = load_plugin(thing)
    return kind, name, check_thing(kind, name, found, registry.plants)


@click.command("bench", short_help="Measure speed, error and memory.", epilog=examples("armid bench --quick"))
@click.option("--quick", is_flag=True, help="Fewer repetitions: rougher figures in a few seconds.")
@plugin_option
def bench_command(quick: bool, plugins: tuple[str, ...]) -> None:
    """Measure speed, error and memory, with the programs in studies/bench of the project.

    The engine against scipy and a plain loop, in one run, every ratio in one table: times in microseconds a
    simulation, errors in rad/s, memory in MB beside what the results themselves take.
    """
    roots = (Path.cwd(), Path(__file__).parents[3])
    studies = next((root / "studies" for root in roots if (root / "studies" / "bench" / "__main__.py").is_file()), None)
    if studies is None:
        raise ArmidError("there is no studies/bench here: the root of armid's source, which holds it, is expected")
    sys.path.insert(0, str(studies))
    import_module("bench.__main__").main(quick, plugins)
