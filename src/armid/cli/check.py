"""`armid check`: whether a user's own plant, effect, fitness or identifier keeps the contract."""

import sys

import click

from armid.cli.options import plugin_option
from armid.registry import load_plugin, load_registry


@click.command("check")
@click.argument("thing", metavar="FILE.py:attribute")
@plugin_option
def check_command(thing: str, plugins: tuple[str, ...]) -> None:
    """Run the contract on your own things.

    A plant, an effect, a fitness or an identifier; an effect is tried on every plant that offers its ports, those of
    --plugin included. Exit code 1 when a point does not hold.
    """
    from armid.contract import check_thing  # noqa: PLC0415 - simulations and pymoo, which other commands do not need

    registry = load_registry(plugins)
    kind, name, found = load_plugin(thing)
    print(f"{kind}: {name}")
    findings = check_thing(kind, name, found, registry.plants)
    for finding in findings:
        print(f"  {'ok  ' if finding.passed else 'FAIL'} {finding.name}: {finding.sentence}")
    failed = sum(not f.passed for f in findings)
    print(f"{len(findings) - failed} of {len(findings)} points hold")
    if failed:
        sys.exit(1)
