"""Run what is missing of a study."""

import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armid.errors import ArmidError, nearest
from armid.estimation.identify import ctrl_c_waits
from armid.study.cases import clean_records
from armid.study.kind import KINDS, function
from armid.study.outcome import Outcome
from armid.study.plan import case_settings
from armid.study.pool import Crew, LocalCrew, Workplace
from armid.study.store import Counts, Store
from armid.study.study import AnyStudy, Study, read_study

if TYPE_CHECKING:
    from armid.study.results import StudyResults


TIME_LIMIT_S = 600.0
RESULTS = Path("results")
# How long to listen for finished runs before Ctrl-C is looked for [s].
LISTEN_S = 0.25


@dataclass(frozen=True)
class Ending:
    """Tell how a runner ended: where the store is, how far its study is, and what this runner did of it.

    others: processes that are still at runs of the study.
    """

    study: AnyStudy
    folder: Path
    counts: Counts
    finished: int
    simulations: int
    seconds: float
    interrupted: bool
    first_error: str
    others: tuple[int, ...]


Told = Callable[[Counts, Outcome | None], None]


def run_study(
    path: str | Path,
    jobs: int | None = None,
    dask: str | None = None,
    out: str | Path | None = None,
    plugins: Iterable[str] = (),
    time_limit: float = TIME_LIMIT_S,
    only: str = "*",
    retry: bool = False,
) -> "StudyResults":
    """Run what is missing of a study and return all that its store holds.

    path: the TOML file. jobs: worker processes (None: as many as processors). dask: address of a scheduler instead.
    out: folder of the store (None: results/NAME). plugins: `FILE.py:attribute` of your own things, whose code is run.
    time_limit: seconds after which a run is stopped and has failed. only: CASE/IDENTIFIER, patterns with * and ?.
    retry: perform failed runs anew.

    Raises ArmidError for a study that cannot be run, KeyboardInterrupt after Ctrl-C; finished runs are kept then.
    """
    from armid.study.results import load_study

    study = read_study(path, absolute(plugins))
    ending = run(study, path, jobs, dask, out, time_limit, only, retry)
    if ending.interrupted:
        raise KeyboardInterrupt
    return load_study(ending.folder)


def run(
    study: AnyStudy,
    file: str | Path,
    jobs: int | None = None,
    dask: str | None = None,
    out: str | Path | None = None,
    time_limit: float = TIME_LIMIT_S,
    only: str = "*",
    retry: bool = False,
    told: Told = lambda counts, outcome: None,
) -> Ending:
    """Run what is missing of a study that was read; arguments and errors as `run_study`.

    file: the study's, as the command named it. told: called with the counts at the start once, then with each finished
    run. Ctrl-C ends it without an error.
    """
    began = time.monotonic()
    chosen = pattern_of(only, study)
    check_numbers(jobs, dask, time_limit)
    kind = KINDS[study.kind]
    if kind.checked_by:
        function(kind.checked_by)(study)
    folder = RESULTS / study.name if out is None else Path(out)
    with Store(folder, chosen) as store, ctrl_c_waits() as interrupted:
        described = function(kind.described_by)(study, folder) | {"file": file_as_told(Path(file))}
        store.plan(described, function(kind.planned_by)(study))
        if retry:
            store.forget_failed()
        counts = store.counts()
        told(counts, None)
        finished = simulations = 0
        if counts.missing:
            workplace = Workplace(study.kind, study.known.plugins, study.folder, time_limit)
            crew = crew_of(jobs, dask, workplace, counts.missing)
            try:
                for outcome in performed(store, crew, interrupted):
                    finished, simulations = finished + 1, simulations + outcome.used
                    told(counts, outcome)
            finally:
                crew.close()
        return Ending(
            study, folder, store.counts(), finished, simulations, time.monotonic() - began, interrupted(),
            store.first_error(), tuple(store.others()),
        )  # fmt: skip


def performed(store: Store, crew: Crew, interrupted: Callable[[], bool]) -> Iterable[Outcome]:
    """Let the crew perform what is missing and keep each run as it comes; yield those that were new."""
    is_all_given = False
    while not interrupted():
        wanted = 0 if is_all_given else crew.wanted()
        if wanted:
            tasks = store.claim(wanted)
            is_all_given = not tasks
            crew.give(tasks)
        if not crew.held:
            # a runner that has ended meanwhile may have left something
            left = store.claim(1)
            if not left:
                return
            is_all_given = False
            crew.give(left)
        for outcome in crew.wait(LISTEN_S):
            if store.save(outcome):
                yield outcome


def crew_of(jobs: int | None, dask: str | None, workplace: Workplace, n_runs: int) -> Crew:
    """Return who performs the runs."""
    if dask is not None:
        from armid.study.dask_pool import DaskCrew

        return DaskCrew(dask, workplace)
    from joblib import cpu_count

    return LocalCrew(min(jobs or cpu_count(), n_runs), workplace)


def check_numbers(jobs: int | None, dask: str | None, time_limit: float) -> None:
    """Refuse what no crew can work with."""
    if jobs is not None and jobs < 1:
        raise ArmidError(f"jobs is {jobs}, a whole number of processes above 0 is expected")
    if jobs is not None and dask is not None:
        raise ArmidError("both jobs and a Dask cluster are given, one of them is expected")
    if not 0.0 < time_limit < 1e9:
        raise ArmidError(f"the time limit is {time_limit:g}, a number of seconds above 0 is expected")


def check_motion(study: Study) -> None:
    """Simulate each case's truth once, before anything is written: the model is compiled and the machine moves.

    Raises ArmidError for a truth at which it does not.
    """
    for case in study.cases:
        if case.source is None:
            try:
                clean_records(case_settings(study, case), case.model)
            except ArmidError as error:
                raise ArmidError(f"case '{case.name}', {error}") from error


def pattern_of(only: str, study: AnyStudy) -> tuple[str, str]:
    """Return the patterns of case and identifier; CASE alone means all identifiers.

    Raises ArmidError for a pattern that meets nothing.
    """
    case, _, identifier = only.partition("/")
    patterns = (case or "*", identifier or "*")
    names = (study.case_names, study.labels)
    for what, pattern, known in zip(("case", "identifier"), patterns, names, strict=True):
        if not any(name == pattern or fnmatchcase(name, pattern) for name in known):
            raise ArmidError(f"only '{only}': no {what} is called '{pattern}', {nearest(pattern, known)}")
    return patterns


def absolute(plugins: Iterable[str]) -> tuple[str, ...]:
    """Return plug-ins with whole paths, so that workers in other folders find them."""
    split = (plugin.rpartition(":") for plugin in plugins)
    return tuple(f"{Path(file).resolve()}:{attribute}" if file else attribute for file, _, attribute in split)


def file_as_told(path: Path) -> str:
    """Return the study's file as the command named it; of a path on this machine alone the name."""
    return path.name if path.is_absolute() else path.as_posix()


class Watch:
    """Count runs and simulations, and show a bar with rate and time left on a terminal, nothing elsewhere."""

    def __init__(self) -> None:
        self.finished, self.simulations = 0, 0
        self._began = time.monotonic()
        self._bar: Any = None

    def __enter__(self) -> "Watch":
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn

            self._bar = Progress(
                TextColumn("{task.completed:.0f}/{task.total:.0f} runs"), BarColumn(),
                TextColumn("{task.fields[rate]}"), TextColumn("{task.fields[left]}"),
                console=Console(stderr=True), refresh_per_second=4,
            )  # fmt: skip
            self._task = self._bar.add_task("", total=1, visible=False, rate="", left="")
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def update(self, counts: Counts, outcome: Outcome | None) -> None:
        """Move the bar: counts at the start, and a run that has finished since."""
        if outcome is None:
            self._began = time.monotonic()
        else:
            self.finished, self.simulations = self.finished + 1, self.simulations + outcome.used
        if self._bar is not None:
            seconds = max(time.monotonic() - self._began, 1e-9)
            missing = counts.missing - self.finished
            left = f"{span(seconds / self.finished * missing)} left" if self.finished else "starting"
            told = {"completed": counts.planned - missing, "rate": self.rate(seconds), "left": left}
            self._bar.update(self._task, total=counts.planned, visible=True, **told)

    def rate(self, seconds: float) -> str:
        """Return simulations a second, or finished runs a minute where no run counts its simulations."""
        if self.simulations or not self.finished:
            return f"{self.simulations / seconds:,.0f} simulations/s"
        return f"{60.0 * self.finished / seconds:.3g} runs/min"


def span(seconds: float) -> str:
    """Return a length of time with as much detail as anyone wants: 40 s, 12 min, 3.2 h."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400.0 else f"{seconds / 3600:.1f} h"
