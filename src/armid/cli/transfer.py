"""`armid import`: campaigns from public measured data; `armid export`: stored results for other programs."""

from pathlib import Path

import click

from armid.cli.options import Group, examples, give, of_studies, out_option, plugin_option, say
from armid.errors import ArmidError
from armid.registry import load_registry
from armid.report.result import NewFiles, refuse_unwritable


@click.group("import", cls=Group, short_help="Make a campaign from public measured data.")
def import_group() -> None:
    """Make a campaign from public measured data, by studies/measured of the repository (`pip install -e`).

    The data themselves are not part of this package.
    """


def told(folder: Path) -> None:
    say(f"wrote {folder}")
    give(folder=folder)


@import_group.command("emps", epilog=examples("armid import emps FOLDER --out studies/campaigns/emps"))
@click.argument("folder", required=False, type=click.Path(path_type=Path))
@out_option("New folder to write.", required=True)
@plugin_option
def emps(folder: Path | None, out: Path, plugins: tuple[str, ...]) -> None:
    """Import EMPS (Janot, Gautier, Brunot 2019): a linear axis with its drive, train and holdout record.

    FOLDER holds DATA_EMPS.mat and DATA_EMPS_PULSES.mat; without it they are loaded through the package
    nonlinear_benchmarks (extra `measured`, needs the internet). Velocity is the encoder position through a zero-phase
    low-pass and central differences. Cite the authors.
    """
    load_registry(plugins)
    told(of_studies("measured.importers").import_emps(folder, out))


@import_group.command("dfki", short_help="Import DFKI's torque-limited simple pendulum: a rotary axis that swings up.",
                      epilog=examples("armid import dfki FOLDER --out studies/campaigns/dfki"))  # fmt: skip
@click.argument("folder", type=click.Path(path_type=Path))
@out_option("New folder to write.", required=True)
@click.option("--holdout", metavar="NAME", help="Record to hold out, ddp or direct_collocation; else both train.")
@plugin_option
def dfki(folder: Path, out: Path, holdout: str | None, plugins: tuple[str, ...]) -> None:
    """Import DFKI's torque-limited simple pendulum: a rotary axis that swings up, two records in pieces of 1 s.

    FOLDER holds ddp_measured.csv and direct_collocation_measured.csv of the set (its licence: BSD-3-Clause). Gravity
    and inertia are estimates from CAD and nothing is free, so that what the records show beyond them is an effect.
    """
    load_registry(plugins)
    told(of_studies("measured.importers").import_dfki(folder, out, holdout))


@click.group("export", cls=Group, short_help="Write stored results for other programs.")
def export_group() -> None:
    """Write stored results in the formats of other programs."""


@export_group.command("ioh", epilog=examples("armid export ioh out/table1 out/ioh"))
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.argument("out", metavar="OUT", type=click.Path(path_type=Path))
def ioh_command(folder: Path, out: Path) -> None:
    """Write the traces of a study as IOHprofiler files.

    DIR holds study.sqlite; OUT is a new or an empty folder, for iohinspector (`DataManager.add_folder`) and
    IOHanalyzer. Algorithm: the identifier, and its fitness where it ran on several. Function: a case under one noise,
    window and fitness. Instance: the seed. The fitness is minimised; each run starts at evaluation 1 and logs its last.
    """
    from armid.study.export import export_ioh
    from armid.study.results import load_study

    if out.is_dir() and any(out.iterdir()):
        raise ArmidError(f"{out} is not empty: a new folder is expected, since all that is in it would be loaded")
    refuse_unwritable(out)
    with NewFiles(out) as files:
        n_runs = export_ioh(load_study(folder), files.path)
        if not n_runs:
            raise ArmidError(f"{folder} holds no trace of a finished run: nothing can be exported")
    say(f"wrote {n_runs} runs in {len(files.names)} files to {out}")
    give(folder=out, runs=n_runs, files=files.names)


@export_group.command("reports")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.argument("out", metavar="OUT", type=click.Path(path_type=Path))
def reports_command(folder: Path, out: Path) -> None:
    """Write the report.json of every campaign that a study has closed, as OUT/CAMPAIGN/report.json.

    DIR holds study.sqlite of a study of kind close_loop. Files are the same as those of `armid close-loop`.
    """
    from armid.study.export import export_reports
    from armid.study.results import load_study
    from armid.study.spec import CLOSES_LOOP

    results = load_study(folder)
    if results.study["kind"] != CLOSES_LOOP:
        raise ArmidError(f"{folder} holds a study of kind '{results.study['kind']}', '{CLOSES_LOOP}' is expected")
    with NewFiles(out) as files:
        n_reports = export_reports(results, files.path)
    say(f"wrote {n_reports} reports to {out}")
    give(folder=out, files=files.names)
