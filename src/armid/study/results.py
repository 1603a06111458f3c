"""Stored results of a study as tidy tables."""

import json
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from armid.errors import ArmidError, StudyError, caused_by, refuse_unless_known
from armid.report.result import NewFiles, Shown
from armid.study.store import EVERY_RUN, FILE_NAME, TALLY, RunTrace, reading, unpacked

if TYPE_CHECKING:
    from armid.report.document import Document

RUNS_QUERY = """
SELECT p.run, p."case", p.identifier, p.fitness, p.noise_deg_s, p.window, p.seed, p.budget, i.used, i.n_failed, i.value,
i.stopped, r.status, r.error, r.seconds, i.train_rmse, i.train_s, i.train_s1, i.train_s2, i.holdout_rmse, r.started_at,
r.model, r.versions
FROM plan p JOIN runs r USING (run) LEFT JOIN identified i USING (run) ORDER BY p.place
"""
PARAMETERS = """
SELECT p."case", q.* FROM plan p JOIN parameters q USING (run) ORDER BY p.place, q.rowid
"""
LOOPS = """
SELECT p.run, p."case", l.verdict, r.seconds, l.cpu_seconds, l.report
FROM plan p JOIN runs r USING (run) JOIN loops l USING (run) ORDER BY p.place
"""
TRACES = "SELECT t.run, t.names, t.trace FROM plan p JOIN traces t USING (run)"
NUMERIC_COLUMNS = ("noise_deg_s", "value", "train_rmse", "train_s", "train_s1", "train_s2", "holdout_rmse", "seconds")
COUNTED = ("used", "n_failed")
NO_TRACE = RunTrace("", np.empty(0, np.int64), np.empty(0), np.empty((0, 0)), ())


@dataclass(frozen=True, eq=False, repr=False)
class StudyResults(Shown):
    """Hold what a study had found when it was loaded; traces are read from the store when they are asked for.

    It prints itself, and has `table`, `plot()`, `to_dict()`, `save(folder)`.

    Only runs that the study asks for count: settings that are no longer in its file are left out.
    study: name, question, kind, text (the TOML file as run), folder, cases (name, truth, published, bounds, units),
    identifiers (labels in order), published, versions, n_planned, n_done, n_failed and more.
    runs: one row a finished run. noise_deg_s: that the study added, NaN for records that are read. used, n_failed:
    simulations. value: best fitness. train_rmse, holdout_rmse: SI. status: "done" or "failed", with the reason in
    `error`. model, versions: hashes, see `text_of`. x_NAME: value of a parameter, SI; error_NAME: its relative error.
    parameters: one row a run and free parameter, SI. deviation: one sigma as in `armid.identify`, the Cramer-Rao bound
    at the solution where the fitness weighs records by their noise. relative_error: abs(value - truth)/abs(truth),
    NaN where the truth is not known.
    """

    path: Path
    study: dict[str, Any]
    runs: pd.DataFrame
    parameters: pd.DataFrame

    def document(self) -> "Document":
        """Return the answer and the main table; no trace is read."""
        document: Document = documents().summary_of(self)
        return document

    def to_dict(self) -> dict[str, Any]:
        """Return the answer, how far the study is, and one entry a run, SI; what is not known is None."""
        counts = {key: self.study[key] for key in ("name", "n_planned", "n_done", "n_failed")}
        runs = json.loads(self.runs.to_json(orient="records"))
        return {**counts, "question": self.study.get("question", ""), "answer": self.document().said, "runs": runs}

    def plot(self, name: str = "") -> Any:
        """Draw one figure of the report and return it, matplotlib's. name: which, "" for the first."""
        from armid.report.style import detached

        figures = {f.name: f.draw for f in documents().report_of(self).figures}
        name = name or next(iter(figures), "")
        refuse_unless_known(name, figures, f"the report has no figure '{name}'")
        return detached(figures[name]())

    def save(self, folder: str | Path) -> list[str]:
        """Write page, Markdown, tables and figures of the report to a folder, all or none, and return their names."""
        with NewFiles(Path(folder)) as files:
            documents().write_report(documents().report_of(self), files)
        return files.names

    @property
    def traces(self) -> pd.DataFrame:
        """One row an improvement: run, evaluation, value, and x_NAME for each parameter of the study."""
        return pd.concat([*map(self._frame, self.iter_traces())] or [self._frame(NO_TRACE)], ignore_index=True)

    def trace_of(self, run: str) -> pd.DataFrame:
        """Return the improvements of one run; ArmidError for one that is not there or has failed."""
        for trace in self._traces(f"{TRACES} WHERE p.run = ?", (run,)):
            return self._frame(trace)
        raise ArmidError(f"{self.path} holds no trace of run '{run}': the id of a finished run is expected")

    def iter_traces(self) -> Iterator[RunTrace]:
        """Yield the traces one after the other, in the order of `runs`; no more than one is in memory."""
        return self._traces(f"{TRACES} ORDER BY p.place", ())

    @property
    def loops(self) -> pd.DataFrame:
        """One row a campaign that was closed: run, case, verdict, seconds, cpu_seconds, report (a dict)."""
        with reading(self.path) as connection:
            loops = frame_of(connection, LOOPS)
            return loops.assign(report=[json.loads(text) for text in loops["report"]])

    def settings_of(self, run: str) -> dict[str, Any]:
        """Return all that decided a run."""
        settings: dict[str, Any] = json.loads(
            self._one("SELECT settings FROM settings WHERE run = ?", run, f"run '{run}'")
        )
        return settings

    def text_of(self, digest: str) -> str:
        """Return the text whose hash a run names: the equations of its model, or the versions (JSON) it ran on."""
        return self._one("SELECT text FROM texts WHERE hash = ?", digest, f"text of hash '{digest}'")

    def _one(self, query: str, value: str, what: str) -> str:
        with reading(self.path) as connection:
            row = connection.execute(query, (value,)).fetchone()
        if row is None:
            raise ArmidError(f"{self.path} holds no {what}")
        return str(row[0])

    def _traces(self, query: str, values: tuple[str, ...]) -> Iterator[RunTrace]:
        with reading(self.path) as connection:
            for run, names, content in connection.execute(query, values):
                yield unpacked(run, content, tuple(json.loads(names)))

    def _frame(self, trace: RunTrace) -> pd.DataFrame:
        """Return a trace as a table with a column for every parameter of the study."""
        frame = pd.DataFrame({"run": trace.run, "evaluation": trace.evaluations, "value": trace.values})
        candidates = pd.DataFrame(trace.X, columns=list(trace.names)).reindex(columns=self.study["parameters"])
        return frame.join(candidates.add_prefix("x_"))


def documents() -> Any:
    """Return armid.study.document, which builds on this file."""
    return import_module("armid.study.document")


@caused_by(StudyError)
def load_study(path: str | Path) -> StudyResults:
    """Read the stored results of a study; nothing is changed.

    Parameters
    ----------
    path : str or Path
        The folder that holds study.sqlite, or that file.

    Returns
    -------
    StudyResults

    Raises
    ------
    StudyError
        For what is not a store of a study.
    """
    file = Path(path) / FILE_NAME if Path(path).is_dir() else Path(path)
    if not file.is_file():
        raise ArmidError(f"there is no store {file}: a folder that `armid study` has written is expected")
    with reading(file) as connection:
        # one transaction: a runner that is at work changes nothing between the tables
        connection.execute("BEGIN")
        row = connection.execute("SELECT value FROM study WHERE key = 'description'").fetchone()
        if row is None:
            raise ArmidError(f"{file} holds no study yet: let `armid study` begin it")
        study = json.loads(row[0])
        planned, ended, failed = connection.execute(TALLY, EVERY_RUN).fetchone()
        study |= {"n_planned": planned, "n_done": ended - failed, "n_failed": failed}
        study |= {"versions": _versions(connection), "folder": str(file.parent)}
        study["parameters"] = list(dict.fromkeys(str(name) for case in study["cases"] for name in case["bounds"]))
        parameters = _parameters(connection, study)
        return StudyResults(file, study, _with_parameters(_runs(connection), parameters), parameters)


def frame_of(connection: sqlite3.Connection, query: str) -> pd.DataFrame:
    """Return the rows of a query; errors are those of SQLite, which pandas would wrap."""
    cursor = connection.execute(query)
    names = [column[0] for column in cursor.description]
    return pd.DataFrame.from_records(cursor.fetchall(), columns=names, coerce_float=True)


def _runs(connection: sqlite3.Connection) -> pd.DataFrame:
    runs = frame_of(connection, RUNS_QUERY)
    runs[list(NUMERIC_COLUMNS)] = runs[list(NUMERIC_COLUMNS)].astype(np.float64)
    runs[list(COUNTED)] = runs[list(COUNTED)].fillna(0).astype(np.int64)
    return runs.fillna({"stopped": ""})


def _with_parameters(runs: pd.DataFrame, parameters: pd.DataFrame) -> pd.DataFrame:
    """Return the runs with x_NAME, the value of each parameter, SI, and error_NAME, its relative error."""
    for prefix, column in (("x_", "value"), ("error_", "relative_error")):
        wide = parameters.pivot(index="run", columns="parameter", values=column).add_prefix(prefix)
        runs = runs.join(wide[[f"{prefix}{name}" for name in dict.fromkeys(parameters["parameter"])]], on="run")
    return runs


def _parameters(connection: sqlite3.Connection, study: dict[str, Any]) -> pd.DataFrame:
    parameters = frame_of(connection, PARAMETERS)
    truths = {(case["name"], name): v for case in study["cases"] for name, v in case["truth"].items()}
    keys = zip(parameters.pop("case"), parameters["parameter"], strict=True)
    truth = np.array([truths.get(key, np.nan) for key in keys], dtype=np.float64)
    for name in ("value", "low", "high", "deviation", "correlation_max"):
        parameters[name] = parameters[name].astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.abs(parameters["value"] - truth) / np.abs(truth)
    parameters.insert(4, "truth", truth)
    parameters.insert(7, "relative_error", error)
    return parameters.astype({"at_bound": bool})


def _versions(connection: sqlite3.Connection) -> dict[str, str]:
    query = "SELECT DISTINCT t.text FROM plan JOIN runs r USING (run) JOIN texts t ON t.hash = r.versions"
    of_runs: list[dict[str, str]] = [json.loads(text) for (text,) in connection.execute(query)]
    packages = dict.fromkeys(package for versions in of_runs for package in versions)
    return {package: ", ".join(sorted({v[package] for v in of_runs if package in v})) for package in packages}
