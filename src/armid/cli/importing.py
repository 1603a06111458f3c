"""`armid import`: campaigns from public measured data."""

from pathlib import Path

import click

from armid.cli.options import examples, plugin_option
from armid.registry import load_registry


@click.group("import")
def import_group() -> None:
    """Make a campaign from public measured data.

    The data themselves are not part of this package.
    """


@import_group.command("emps", epilog=examples("armid import emps FOLDER --out studies/campaigns/emps"))
@click.argument("folder", required=False, type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="New folder to write.")
@plugin_option
def emps(folder: Path | None, out: Path, plugins: tuple[str, ...]) -> None:
    """Import EMPS (Janot, Gautier, Brunot 2019): a linear axis with its drive, train and holdout record.

    FOLDER holds DATA_EMPS.mat and DATA_EMPS_PULSES.mat; without it they are loaded through the package
    nonlinear_benchmarks (extra `measured`, needs the internet). Velocity is the encoder position through a zero-phase
    low-pass and central differences. Cite the authors.
    """
    from armid.record.importers import import_emps  # noqa: PLC0415 - scipy's filters, which other commands do not need

    load_registry(plugins)
    print(f"wrote {import_emps(folder, out)}")


@import_group.command("dfki", short_help="Import DFKI's torque-limited simple pendulum: a rotary axis that swings up.",
                      epilog=examples("armid import dfki FOLDER --out studies/campaigns/dfki"))  # fmt: skip
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="New folder to write.")
@click.option("--holdout", metavar="NAME", help="Record to hold out, ddp or direct_collocation; else both train.")
@plugin_option
def dfki(folder: Path, out: Path, holdout: str | None, plugins: tuple[str, ...]) -> None:
    """Import DFKI's torque-limited simple pendulum: a rotary axis that swings up, two records in pieces of 1 s.

    FOLDER holds ddp_measured.csv and direct_collocation_measured.csv of the set (its licence: BSD-3-Clause). Gravity
    and inertia are estimates from CAD and nothing is free, so that what the records show beyond them is an effect.
    """
    from armid.record.importers import import_dfki  # noqa: PLC0415 - as above

    load_registry(plugins)
    print(f"wrote {import_dfki(folder, out, holdout)}")
