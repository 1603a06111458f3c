"""Commands on stored results and public data: `armid report`, one page; `armid export` and `armid import`."""

import json
import shlex
from pathlib import Path
from typing import Any

import click

from armid.cli.options import CommandGroup, command, examples, give, of_studies, out_option, plugin_option, present, say
from armid.errors import ArmidError
from armid.registry import load_registry
from armid.report.result import (
    IDENTIFIABILITY,
    IDENTIFICATION,
    LOOP,
    STUDY_FILE,
    Kind,
    NewFiles,
    Result,
    document_of,
    refuse_damaged,
    refuse_unwritable,
    write_pages,
)


def show_and_save(result: Result, out: Path | None) -> None:
    """Print the answer and the main tables of a result, then with a folder write its files, all or none."""
    document = result.document()
    present(document)
    files = [] if out is None else result.save(out, made_by())
    if files:
        say(f"wrote {', '.join(files)} to {out}")
    give(**result.to_dict(), answer=document.said, files=files)


def made_by() -> dict[str, Any]:
    """Return the command that is running, as a shell takes it, and the value of each of its options, for JSON."""
    context = click.get_current_context()
    words = [str(word) for word in context.find_root().obj or ()]
    settings = {name: json.loads(json.dumps(value, default=str)) for name, value in context.params.items()}
    return {"command": shlex.join(["armid", *words]), "settings": settings}


PAGE_FILE = "report.html"


@command("report", short_help="Write the page of stored results.", epilog=examples(
    "armid report out/table1_short", "armid report out/four_strokes",
))  # fmt: skip
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--key", type=click.Path(path_type=Path), metavar="FILE",
              help="Truth of blind campaigns, which studies/blind/score.py scores.")  # fmt: skip
@click.option("--format", "form", type=click.Choice(["page", "pdf"]), default="page", show_default=True,
              help="page with its files, or only the figures of a study as PDF for a paper.")  # fmt: skip
@click.option("--width", type=click.Choice(["single", "double"]), show_default="double",
              help="Columns of the paper that a PDF figure spans.")  # fmt: skip
@plugin_option
def report_command(folder: Path, key: Path | None, form: str, width: str | None, plugins: tuple[str, ...]) -> None:
    """Write report.html, one self-contained page, into the folder of stored results.

    DIR is a folder that `armid study`, `armid close-loop`, `armid identify` or `armid identifiability` (whose page is
    identifiability.html) has written. The same results give the same bytes, and nothing is simulated. The answer stands
    at the head of the page; the command that made the results has printed it. For a study, report.md, every table as
    CSV and LaTeX and every figure as PNG and SVG are written too. A study that is not complete is reported as far as it
    is, and says so. An analysis of your own, --plugin FILE.py:name, becomes a section; plug-ins of another kind may be
    named as for the study, and change nothing.
    """
    if width is not None and form != "pdf":
        raise ArmidError(f"--width {width} is given without --format pdf: a width of PDF figures alone is expected")
    kind = kind_in(folder)
    if kind is None:
        report_study(folder, key, width or "double" if form == "pdf" else "", plugins)
        return
    if form == "pdf":
        raise ArmidError(f"{folder} holds no study: --format pdf draws the figures of a study, leave it out here")
    refuse_unwritable(folder, kind.page)
    if key is not None:
        raise ArmidError(f"{folder} holds no study, and a key is the truth of a study's campaigns: none is expected")
    document = document_of(folder, kind, str(folder))
    with NewFiles(folder) as files, refuse_damaged(folder, kind):
        write_pages(document, kind, files)
    say(f"wrote {kind.page} ({(folder / kind.page).stat().st_size / 1e6:.1f} MB) and {kind.markdown} to {folder}")
    give(answer=document.said, folder=folder, files=files.names)


def report_study(folder: Path, key: Path | None, width: str, plugins: tuple[str, ...]) -> None:
    """Write page and files of a study, or with the width of a column its figures for a paper."""
    from armid.report.files import write_prints
    from armid.study.document import report_of, write_report
    from armid.study.results import load_study

    results = load_study(folder)
    analyses, place = load_registry(plugins).analyses, results.path.parent
    refuse_unwritable(place, PAGE_FILE)
    document = report_of(results, key, analyses, made_by()["command"])
    if document.warning:
        say(document.warning)
    with NewFiles(place) as files:
        if width:
            write_prints(document, width, files.path)
            made = f"{len(files.names)} figures as PDF to {place}"
        else:
            write_report(document, files)
            made = f"report.md and {len(files.names) - 2} tables and figures to {place}, all on one page in {PAGE_FILE}"
    say(f"wrote {made}")
    give(answer=document.said, folder=place, files=files.names)


def kind_in(folder: Path) -> Kind | None:
    """Return the kind of result that a folder holds, None for a study, whose store may be named itself."""
    if folder.name == STUDY_FILE or (folder / STUDY_FILE).is_file():
        return None
    kinds = [kind for kind in (LOOP, IDENTIFICATION, IDENTIFIABILITY) if (folder / kind.file).is_file()]
    if kinds[:2] == [LOOP, IDENTIFICATION]:
        raise ArmidError(f"{folder} holds {LOOP.file} and {IDENTIFICATION.file}, which two commands wrote: one of them "
                         "is expected")  # fmt: skip
    if kinds:
        return kinds[0]
    names = f"{STUDY_FILE} of `armid study`, {LOOP.file} of `{LOOP.command}` or {IDENTIFICATION.file}"
    raise ArmidError(f"{folder} holds no result: {names} of `{IDENTIFICATION.command}` is expected")


@click.group("import", cls=CommandGroup, short_help="Make a campaign from public measured data.")
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


@click.group("export", cls=CommandGroup, short_help="Write stored results for other programs.")
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
