"""`armid import`: campaigns from public measured data."""

from pathlib import Path
from typing import Annotated

import typer

import_app = typer.Typer(help="Make a campaign from public measured data.", no_args_is_help=True, rich_markup_mode=None)


@import_app.callback()
def choose() -> None:
    """Make a campaign from public measured data; the data themselves are not part of this package."""


@import_app.command("emps")
def emps(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="New folder for the campaign.")],
    folder: Annotated[
        Path | None,
        typer.Argument(metavar="[FOLDER]", help="Folder with DATA_EMPS.mat and DATA_EMPS_PULSES.mat; without it they are "
                       "loaded through the package nonlinear_benchmarks (extra `measured`, needs the internet)."),
    ] = None,
) -> None:  # fmt: skip
    """Import EMPS (Janot, Gautier, Brunot 2019): a linear axis with its drive, train and holdout record.

    Velocity is the encoder position through a zero-phase low-pass and central differences. Cite the authors.
    """
    from armid.record.importers import import_emps  # noqa: PLC0415 - scipy's filters, which other commands do not need

    print(f"wrote {import_emps(folder, out)}")
