"""Run what is missing of a study."""

import json
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import closing, contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from armid.errors import ArmidError, StudyError, caused_by, located, nearest
from armid.estimation.identify import ctrl_c_waits
from armid.progress import announced, console
from armid.report.result import refuse_unwritable
from armid.study.pool import DaskPool, LocalPool, WorkerSetup, performed_apart
from armid.study.store import FILE_NAME, Counts, Outcome, Store
from armid.study.tasks import Task, read_study

if TYPE_CHECKING:
    from armid.study.results import StudyResults


TIME_LIMIT_S = 600.0
# Where results go without another word: what git ignores.
OUT = Path("out")
# How long to listen for finished runs before Ctrl-C is looked for [s].
LISTEN_S = 0.25
# Runs handed out for each that is performed: while one is performed, the next lies ready.
AHEAD = 3
Progress = Callable[[Counts, Outcome | None], None]


@dataclass(frozen=True)
class Ending:
    """How a runner ended: how far its study is, and what it did."""

    study: Task
    folder: Path
    counts: Counts
    finished: int
    simulations: int
    seconds: float
    interrupted: bool
    first_error: str


@caused_by(StudyError)
def run_study(
    path: str | Path,
    jobs: int | None = None,
    dask: str | None = None,
    out: str | Path | None = None,
    plugins: Iterable[str] = (),
    time_limit: float = TIME_LIMIT_S,
    only: str = "*",
    retry: bool = False,
    progress: bool = False,
) -> "StudyResults":
    """Perform the runs that the store of a study lacks, and return all runs of the store.

    Parameters
    ----------
    path
        The TOML file.
    jobs
        Worker processes; None: as many as processors.
    dask
        Address of a scheduler, in place of worker processes.
    out
        Folder of the store; None: out/NAME.
    plugins
        `FILE.py:attribute` of your own things, whose code is run.
    time_limit
        Time after which a run is stopped and has failed [s].
    only
        CASE/IDENTIFIER, patterns with * and ?.
    retry
        Whether failed runs are performed anew.
    progress
        Show a bar, in a terminal or a notebook.

    Returns
    -------
    StudyResults
        All runs that the store holds.

    Raises
    ------
    StudyError
        For a study that cannot be run.
    KeyboardInterrupt
        After Ctrl-C; finished runs are kept.
    """
    from armid.study.results import load_study

    with progress_bar(progress) as shown:
        study = read_study(path, absolute(plugins))
        ending = run(study, path, jobs, dask, out, time_limit, only, retry, shown)
    if ending.interrupted:
        raise KeyboardInterrupt
    return load_study(ending.folder)


def run(
    study: Task,
    file: str | Path,
    jobs: int | None = None,
    dask: str | None = None,
    out: str | Path | None = None,
    time_limit: float = TIME_LIMIT_S,
    only: str = "*",
    retry: bool = False,
    progress: Progress = lambda counts, outcome: None,
    command: str = "",
) -> Ending:
    """Run what is missing of a study that was read; arguments and errors as `run_study`.

    file: the study's, as the command named it. progress: called with the counts at the start once, then with each
    finished run. command: the line that runs it, for its report. Ctrl-C ends it without an error.
    """
    from joblib import cpu_count

    began = time.monotonic()
    chosen = _patterns(only, study)
    if jobs is not None and jobs < 1:
        raise ArmidError(f"jobs is {jobs}, a whole number of processes above 0 is expected")
    if jobs is not None and dask is not None:
        raise ArmidError("both jobs and a Dask cluster are given, one of them is expected")
    if not 0.0 < time_limit < 1e9:
        raise ArmidError(f"the time limit is {time_limit:g}, a number of seconds above 0 is expected")
    setup = WorkerSetup(study.kind, study.registry.plugins, study.folder, time_limit)
    with located(file):
        study.check(partial(performed_apart, setup))
    folder, named = OUT / study.name if out is None else Path(out), Path(file)
    # a whole path says something on this machine alone
    told = named.name if named.is_absolute() else named.as_posix()
    description = study.description(folder) | {"file": told, "command": command}
    json.dumps(description, ensure_ascii=False).encode()  # what no store can hold is refused before there is one
    is_new = not (folder / FILE_NAME).exists()
    if is_new:
        refuse_unwritable(folder, FILE_NAME)
    with Store(folder, chosen) as store:
        with announced(f"planning {study.n_runs:,} runs"):
            store.plan(description, study.plan())
        if retry:
            store.forget_failed()
        with ctrl_c_waits() as interrupted:
            counts = store.counts()
            progress(counts, None)
            finished = simulations = 0
            if counts.missing and not is_new:
                # a study that is complete needs no room
                refuse_unwritable(folder, FILE_NAME)
            if counts.missing:
                width = min(jobs or cpu_count(), counts.missing)
                pool = LocalPool(width, setup) if dask is None else DaskPool(dask, setup)
                with closing(pool):
                    for outcome in _performed(store, pool, interrupted):
                        finished, simulations = finished + 1, simulations + outcome.used
                        progress(counts, outcome)
            return Ending(
                study, folder, store.counts(), finished, simulations, time.monotonic() - began, interrupted(),
                store.first_error(),
            )  # fmt: skip


def _performed(store: Store, pool: "LocalPool | DaskPool", interrupted: Callable[[], bool]) -> Iterator[Outcome]:
    """Let the pool perform what is missing and keep each run as it comes; yield those that were new."""
    missing, pending = store.missing(), set[Future[Outcome]]()
    while not interrupted():
        pending |= {pool.submit(run) for run in islice(missing, max(0, AHEAD * pool.width - len(pending)))}
        if not pending:
            return
        finished, pending = wait(pending, LISTEN_S, FIRST_COMPLETED)
        for future in finished:
            try:
                outcome = future.result()
            except ArmidError:
                raise
            except Exception as error:
                words = f"{type(error).__name__}: {error}"
                raise ArmidError(f"a worker has gone ({words[:200]}): start again to go on") from error
            if store.save(outcome):
                yield outcome


def _patterns(only: str, study: Task) -> tuple[str, str]:
    """Return the patterns of case and identifier; CASE alone means all identifiers."""
    case, _, identifier = only.partition("/")
    patterns = (case or "*", identifier or "*")
    names = (study.case_names, study.shown)
    for what, pattern, known in zip(("case", "identifier"), patterns, names, strict=True):
        if not any(name == pattern or fnmatchcase(name, pattern) for name in known):
            raise ArmidError(f"only '{only}': no {what} is called '{pattern}', {nearest(pattern, known)}")
    return patterns


def absolute(plugins: Iterable[str]) -> tuple[str, ...]:
    """Return plug-ins with whole paths, so that workers in other folders find them."""
    split = (plugin.rpartition(":") for plugin in plugins)
    return tuple(f"{Path(file).resolve()}:{attribute}" if file else attribute for file, _, attribute in split)


@contextmanager
def progress_bar(is_shown: bool) -> Iterator[Progress]:
    """Yield what shows how far a study is, with rate and time left; nothing where no bar can be drawn."""
    drawn_on = console() if is_shown else None
    if drawn_on is None:
        yield lambda counts, outcome: None
        return
    from rich.progress import BarColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = "{task.completed:.0f}/{task.total:.0f} runs", BarColumn(), "{task.fields[rate]}", TimeRemainingColumn()
    with Bar(*columns, console=drawn_on, refresh_per_second=4) as bar:
        task = bar.add_task("", total=1, visible=False, rate="")
        began = simulations = 0.0

        def update(counts: Counts, outcome: Outcome | None) -> None:
            nonlocal began, simulations
            if outcome is None:
                began, simulations = time.monotonic(), 0.0
                ended = counts.planned - counts.missing
                bar.update(task, total=counts.planned, completed=ended, visible=True, rate="starting")
                return
            simulations += outcome.used
            speed = simulations / max(time.monotonic() - began, 1e-9)
            # closed loops count no simulations
            bar.update(task, advance=1, rate=f"{speed:,.0f} simulations/s" if speed else "")

        yield update


def span(seconds: float) -> str:
    """Return a length of time with as much detail as anyone wants: 40 s, 12 min, 3.2 h."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400.0 else f"{seconds / 3600:.1f} h"
