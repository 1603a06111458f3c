"""`armid study`: run what is missing of a study; `armid tune`: set the options of its identifiers."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from armid.cli.options import command, examples, give, out_option, plugin_option, present, say, speaks, tell
from armid.cli.report import made_by
from armid.errors import INTERRUPTED, ArmidError
from armid.units import counted

if TYPE_CHECKING:
    from armid.study.runner import Ending


MOST_LETTERS_NAMED = 300
jobs_option = click.option(
    "--jobs", type=click.IntRange(1), help="Worker processes. [default: as many as processors]"
)  # fmt: skip
dask_option = click.option(
    "--dask", metavar="tcp://HOST:PORT", help="Scheduler of a Dask cluster, in place of own processes."
)


@command("study", short_help="Run what is missing of a study.", epilog=examples(
    "armid study studies/table1_short.toml --out out/table1_short",
    "armid study studies/table1.toml --jobs 2 --only 'row 1/pso*' --out out/table1",
    "armid study mine.toml --plugin mine.py:my_search --out out/mine",
))  # fmt: skip
@click.argument("study", type=click.Path(path_type=Path))
@jobs_option
@dask_option
@out_option("Folder of the results. [default: out/NAME]")
@click.option(
    "--time-limit", type=float, metavar="S", show_default="600",
    help="A run that takes longer is stopped and counts as failed, s.",
)  # fmt: skip
@click.option(
    "--only", default="*", metavar="CASE/IDENTIFIER",
    help="Run these only, by their names in tables; * and ? stand for any letters, CASE alone for all identifiers.",
)  # fmt: skip
@click.option("--retry", is_flag=True, help="Perform failed runs anew.")
@plugin_option
def study_command(
    study: Path, jobs: int | None, dask: str | None, out: Path | None, time_limit: float | None, only: str, retry: bool,
    plugins: tuple[str, ...],
) -> None:  # fmt: skip
    """Run what is missing of STUDY, a TOML file of cases, identifiers, fitnesses and seeds, or of campaigns to close.

    Finished runs are kept in one SQLite file, whatever ends the program; the same command goes on where it was.
    One process at a time works on a folder; --dask shares the runs among machines. A study whose file has changed keeps
    the runs whose settings have not. Failed runs are reported and leave the exit code 0; Ctrl-C gives 130.
    """
    from armid.study.runner import TIME_LIMIT_S, absolute, progress_bar, run
    from armid.study.tasks import Study, read_study

    with progress_bar(speaks()) as show_progress:
        known = read_study(study, absolute(plugins))
        if isinstance(known, Study) and speaks():
            tell(f"{known.name}: {known.cost()}; what is finished already is kept")
        limit = TIME_LIMIT_S if time_limit is None else time_limit
        ending = run(known, study, jobs, dask, out, limit, only, retry, show_progress, made_by()["command"])
    answer: list[str] = []
    if ending.counts.done:
        from armid.study.document import summary_of
        from armid.study.results import load_study

        document = summary_of(load_study(ending.folder))
        present(document)
        answer = document.said
    say(*words(ending))
    counts = {key: getattr(ending.counts, key) for key in ("planned", "done", "failed", "missing")}
    give(study=known.name, folder=ending.folder, answer=answer, **counts, interrupted=ending.interrupted)
    if ending.interrupted:
        sys.exit(INTERRUPTED)


def words(ending: "Ending") -> list[str]:
    """Return what a reader must know of how it ended, one sentence each."""
    from armid.study.runner import span

    counts, name = ending.counts, ending.study.name
    speed = f", {ending.simulations / ending.seconds:,.0f} simulations/s" if ending.simulations else ""
    made = f"{counted(ending.finished, 'run')} made in {span(ending.seconds)}{speed}"
    lines = [f"{name}: {made}; {counts.planned - counts.missing} of {counts.planned} are in {ending.folder}"]
    if ending.interrupted:
        lines.append("interrupted: every finished run is kept, the same command goes on")
    if counts.failed:
        lines.append(f"{counted(counts.failed, 'run')} failed, the first: {ending.first_error[:MOST_LETTERS_NAMED]}")
    return lines


@command("tune", short_help="Tune the identifiers of a study on other instances.", epilog=examples(
    "armid tune studies/suite/suite.toml --out out/tuned",
    "armid study out/tuned/tuned.toml --out out/suite_tuned",
))  # fmt: skip
@click.argument("study", type=click.Path(path_type=Path))
@click.option("--configurations", type=click.IntRange(1), default=20, show_default=True, help="Tried of each.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of proposals and searches.")
@jobs_option
@dask_option
@out_option("Folder of the tuned study. [default: out/NAME_tuned]")
@plugin_option
def tune_command(
    study: Path, configurations: int, seed: int, jobs: int | None, dask: str | None, out: Path | None,
    plugins: tuple[str, ...],
) -> None:  # fmt: skip
    """Write STUDY again with each identifier as it is and, where that is better, tuned.

    Every identifier gets the same number of configurations, its defaults among them, judged by the area over the
    convergence curve on the instances that [suite] calls train; the study itself is run on others. Finished runs are
    kept in the folder `training` of the results, whatever ends the program; the same command goes on where it was. A
    configuration that fails counts as area 0. Ends with 130 after Ctrl-C. Needs Optuna.
    """
    from armid.report.result import NewFiles
    from armid.study.runner import OUT, absolute, progress_bar
    from armid.study.tasks import Study, read_study
    from armid.study.tune import training, tune, tuned_document, tuned_study

    with progress_bar(speaks()) as show_progress:
        known = read_study(study, absolute(plugins))
        if not isinstance(known, Study):
            raise ArmidError(f"study '{known.name}' closes loops, armid tune expects one that identifies")
        first = training(known, seed)
        if speaks():
            whole = replace(first, entries=first.entries * configurations)
            tell(f"{known.name}: {len(first.entries)} identifiers, {configurations} configurations of each on "
                 f"{len(first.cases)} instances: {whole.cost()}; what is finished already is kept")  # fmt: skip
        folder = OUT / f"{known.name}_tuned" if out is None else out
        tunings, ending = tune(first, study, folder / "training", configurations, jobs, dask, show_progress)
    answer: list[str] = []
    if tunings:
        with NewFiles(folder) as files:
            files.path("tuned.toml").write_text(tuned_study(known, tunings), encoding="utf-8")
        document = tuned_document(known, tunings)
        present(document)
        say(f"wrote tuned.toml to {folder}")
        answer = document.said
    say(*words(ending))
    give(study=known.name, folder=folder, answer=answer, tuned={tuning.label: tuning.options for tuning in tunings},
         areas={tuning.label: {"default": tuning.default, "tuned": tuning.tuned} for tuning in tunings},
         interrupted=ending.interrupted)  # fmt: skip
    if ending.interrupted:
        sys.exit(INTERRUPTED)
