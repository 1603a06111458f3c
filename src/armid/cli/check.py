"""`armid check`: does a user's own plant, effect, fitness or identifier keep the contract?"""

from typing import Annotated

import typer

from armid.registry import load_plugin


def check(
    plugin: Annotated[str, typer.Argument(metavar="FILE.py:attribute", help="What to check; runs the file's code.")],
) -> None:
    """Run the contract on your own plant, effect, fitness or identifier; exit code 1 when a point does not hold."""
    from armid.contract import check_thing  # noqa: PLC0415 - simulations and pymoo, which other commands do not need

    kind, name, thing = load_plugin(plugin)
    print(f"{kind}: {name}")
    findings = check_thing(kind, name, thing)
    for finding in findings:
        print(f"  {'ok  ' if finding.passed else 'FAIL'} {finding.name}: {finding.sentence}")
    failed = sum(not f.passed for f in findings)
    print(f"{len(findings) - failed} of {len(findings)} points hold")
    if failed:
        raise typer.Exit(1)
