"""`armid export`: stored results in the formats of others."""

from pathlib import Path

import click

from armid.cli.new_files import NewFiles, refuse_unwritable
from armid.cli.options import examples
from armid.model import ArmidError


@click.group("export")
def export_group() -> None:
    """Write stored results in the formats of other programs."""


@export_group.command("ioh", epilog=examples("armid export ioh results/table1 results/ioh"))
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.argument("out", metavar="OUT", type=click.Path(path_type=Path))
def ioh_command(folder: Path, out: Path) -> None:
    """Write the traces of a study as IOHprofiler files.

    DIR holds study.sqlite; OUT is a new or an empty folder, for iohinspector (`DataManager.add_folder`) and
    IOHanalyzer. Algorithm: the identifier, and its fitness where it ran on several. Function: a case under one noise,
    window and fitness. Instance: the seed. The fitness is minimised; each run starts at evaluation 1 and logs its last.
    """
    from armid.study.export import export_ioh  # noqa: PLC0415 - pandas takes time to import
    from armid.study.results import load_study  # noqa: PLC0415

    if out.is_dir() and any(out.iterdir()):
        raise ArmidError(f"{out} is not empty: a new folder is expected, since all that is in it would be loaded")
    refuse_unwritable(out)
    with NewFiles(out) as files:
        n_runs = export_ioh(load_study(folder), files.path)
        if not n_runs:
            raise ArmidError(f"{folder} holds no trace of a finished run: nothing can be exported")
    print(f"wrote {n_runs} runs in {len(files.names)} files to {out}")


@export_group.command("reports")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.argument("out", metavar="OUT", type=click.Path(path_type=Path))
def reports_command(folder: Path, out: Path) -> None:
    """Write the report.json of every campaign that a study has closed, as OUT/CAMPAIGN/report.json.

    DIR holds study.sqlite of a study of kind close_loop. Files are the same as those of `armid close-loop`.
    """
    from armid.study.export import export_reports  # noqa: PLC0415 - pandas takes time to import
    from armid.study.kind import CLOSES_LOOP  # noqa: PLC0415
    from armid.study.results import load_study  # noqa: PLC0415

    results = load_study(folder)
    if results.study["kind"] != CLOSES_LOOP:
        raise ArmidError(f"{folder} holds a study of kind '{results.study['kind']}', '{CLOSES_LOOP}' is expected")
    with NewFiles(out) as files:
        n_reports = export_reports(results, files.path)
    print(f"wrote {n_reports} reports to {out}")
