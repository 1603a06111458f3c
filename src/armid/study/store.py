"""The store of a study: one SQLite file that holds what is planned, who is at it, and every finished run."""

import hashlib
import json
import sqlite3
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from armid.model import ArmidError
from armid.study.damage import description_of
from armid.study.kind import KINDS
from armid.study.outcome import FAILED, Outcome, Task
from armid.study.plan import Planned
from armid.study.process_identity import ProcessIdentity, is_gone, this_process
from armid.study.store_file import FILE_NAME, closed, opened, told, transaction

# Runs that this runner looks at, those of them that are not finished, and those that nobody is at.
CHOSEN = """
(p."case" = :case OR p."case" GLOB :case) AND (p.identifier = :identifier OR p.identifier GLOB :identifier)
"""
UNFINISHED = "NOT EXISTS (SELECT 1 FROM runs r WHERE r.run = p.run)"
UNCLAIMED = "NOT EXISTS (SELECT 1 FROM claims c WHERE c.run = p.run)"
NEXT = f"""
SELECT p.place, p.run, s.settings FROM plan p JOIN settings s USING (run)
WHERE p.place > :after AND {CHOSEN} AND {UNFINISHED} AND {UNCLAIMED} ORDER BY p.place LIMIT :n
"""
COUNTS = f"""
SELECT count(*), count(status), ifnull(sum(status = '{FAILED}'), 0),
ifnull(sum(CASE WHEN status IS NULL THEN budget END), 0) FROM plan p LEFT JOIN runs USING (run) WHERE {CHOSEN}
"""
FAILURES = f"FROM plan p JOIN runs r USING (run) WHERE {CHOSEN} AND r.status = '{FAILED}'"
OTHERS = f"""
SELECT DISTINCT c.pid FROM plan p JOIN claims c USING (run)
WHERE {CHOSEN} AND {UNFINISHED} AND c.place = :here AND c.pid != :pid
"""
VOID = "DELETE FROM claims WHERE place = ? AND pid = ? AND start = ?"


class Counts(NamedTuple):
    """Tell how far a study is: runs planned, done, failed, and the simulations that the missing ones may make."""

    planned: int
    done: int
    failed: int
    simulations_left: int

    @property
    def missing(self) -> int:
        """Runs that are neither done nor failed."""
        return self.planned - self.done - self.failed


class Store:
    """Write to the store of a study.

    folder: where study.sqlite is or will be. only: patterns of case and identifier that this runner looks at.
    Every finished run is one transaction. A run that is there already stays as it is, so that nothing is there twice.
    Raises ArmidError with one sentence for all that the disk refuses.
    """

    def __init__(self, folder: Path, only: tuple[str, str] = ("*", "*")) -> None:
        if folder.exists() and not folder.is_dir():
            raise ArmidError(f"{folder} is a file, a folder for the results is expected")
        self.path = folder / FILE_NAME
        self._process = this_process()
        self._chosen = {"case": only[0], "identifier": only[1]}
        self._place, self._plan = -1, ""
        self._connection = opened(self.path)

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        """Give back what was claimed and not finished, and close the file."""
        # where the disk is full, the claims end with this process
        with suppress(sqlite3.Error):
            self._connection.execute(VOID, self._process)
        closed(self._connection)

    def plan(self, description: Mapping[str, Any], planned: Iterable[Planned]) -> None:
        """Set what the study consists of now; finished runs stay, also those that it no longer asks for.

        Raises ArmidError when the file holds another study.
        """
        with told(self.path), transaction(self._connection):
            self._refuse_other(str(description["name"]))
            digest = hashlib.sha256()
            self._connection.execute("CREATE TEMP TABLE IF NOT EXISTS wanted AS SELECT * FROM plan LIMIT 0")
            self._connection.executemany(
                "INSERT INTO wanted VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", self._rows(planned, digest)
            )
            self._plan = digest.hexdigest()
            if self._plan != self._kept("plan"):
                self._replace_plan()
            self._connection.execute("DROP TABLE wanted")
            self._keep("plan", self._plan)
            self._keep("description", json.dumps(description, ensure_ascii=False))

    def _rows(self, planned: Iterable[Planned], digest: Any) -> Iterable[tuple[Any, ...]]:
        """Yield rows of the plan one by one, so that a large study needs no memory, and keep their settings."""
        for place, each in enumerate(planned):
            self._connection.execute("INSERT OR IGNORE INTO settings VALUES (?, ?)", (each.run, each.settings))
            row = (each.run, each.case, each.identifier, each.fitness, each.noise_deg_s, each.window, each.seed)
            digest.update(repr((place, row)).encode())
            yield (place, *row, each.budget)

    def _replace_plan(self) -> None:
        self._connection.execute("DELETE FROM plan")
        self._connection.execute("INSERT INTO plan SELECT * FROM wanted")
        kept = "SELECT run FROM plan UNION SELECT run FROM runs"
        self._connection.execute(f"DELETE FROM settings WHERE run NOT IN ({kept})")

    def _refuse_other(self, name: str) -> None:
        kept = self._kept("description")
        other = description_of(self.path, kept)["name"] if kept else name
        if other != name:
            raise ArmidError(f"{self.path} holds the study '{other}', another folder is expected for '{name}'")

    def _kept(self, key: str) -> str:
        row = self._connection.execute("SELECT value FROM study WHERE key = ?", (key,)).fetchone()
        return str(row[0]) if row else ""

    def _keep(self, key: str, value: str) -> None:
        self._connection.execute("INSERT OR REPLACE INTO study VALUES (?, ?)", (key, value))

    def forget_failed(self) -> None:
        """Take out the failed runs that this runner looks at, so that they are performed anew."""
        with told(self.path), transaction(self._connection):
            self._connection.execute(f"DELETE FROM runs WHERE run IN (SELECT p.run {FAILURES})", self._chosen)

    def claim(self, n: int) -> list[Task]:
        """Return up to n runs that nobody has finished or is at, and mark them as this process's.

        When there is none left, claims of processes that have ended are void, and those of other machines too: at worst
        a run is then made twice, and kept once.
        Raises ArmidError when another runner has changed the plan.
        """
        with told(self.path), transaction(self._connection):
            if self._kept("plan") != self._plan:
                raise ArmidError(f"{self.path} was given another plan by another runner: start again to go on with it")
            rows = self._next(n)
            if not rows:
                self._place = -1
                self._void_claims()
                rows = self._next(n)
            mine = [(run, *self._process) for _, run, _ in rows]
            self._connection.executemany("INSERT INTO claims VALUES (?, ?, ?, ?)", mine)
        self._place = rows[-1][0] if rows else -1
        return [Task(run, settings) for _, run, settings in rows]

    def _next(self, n: int) -> list[tuple[int, str, str]]:
        return self._connection.execute(NEXT, {**self._chosen, "after": self._place, "n": n}).fetchall()

    def _void_claims(self) -> None:
        """Delete the claims of processes that have ended, and of other machines."""
        rows = self._connection.execute("SELECT DISTINCT place, pid, start FROM claims").fetchall()
        for process in (ProcessIdentity(*row) for row in rows):
            if process.place != self._process.place or is_gone(process):
                self._connection.execute(VOID, process)

    def save(self, outcome: Outcome) -> bool:
        """Keep a finished run; tell whether it was not there yet."""
        versions = json.dumps(dict(outcome.versions), sort_keys=True)
        with told(self.path), transaction(self._connection):
            row = (outcome.run, outcome.status, outcome.error, outcome.seconds, outcome.started_at,
                   self._text(outcome.model), self._text(versions))  # fmt: skip
            cursor = self._connection.execute("INSERT OR IGNORE INTO runs VALUES (?, ?, ?, ?, ?, ?, ?)", row)
            is_new = cursor.rowcount == 1
            if is_new:
                self._save_rows(outcome)
            self._connection.execute("DELETE FROM claims WHERE run = ?", (outcome.run,))
        return is_new

    def _save_rows(self, outcome: Outcome) -> None:
        tables = {name: table for kind in KINDS.values() for name, table in kind.tables.items()}
        for name, rows in outcome.rows.items():
            marks = ", ".join("?" * (1 + len(tables[name].columns)))
            text = f"INSERT OR REPLACE INTO {name} VALUES ({marks})"
            self._connection.executemany(text, [(outcome.run, *row) for row in rows])

    def _text(self, text: str) -> str:
        """Keep a text once, and return its hash."""
        digest = hashlib.sha256(text.encode()).hexdigest()[:16]
        self._connection.execute("INSERT OR IGNORE INTO texts VALUES (?, ?)", (digest, text))
        return digest

    def counts(self) -> Counts:
        """Return how far the runs are that this runner looks at."""
        with told(self.path):
            planned, finished, failed, left = self._connection.execute(COUNTS, self._chosen).fetchone()
        return Counts(planned, finished - failed, failed, left)

    def first_error(self) -> str:
        """Return what the first failed run says, "" when none has failed."""
        with told(self.path):
            text = f"SELECT r.error {FAILURES} ORDER BY p.place LIMIT 1"
            row = self._connection.execute(text, self._chosen).fetchone()
        return str(row[0]) if row else ""

    def others(self) -> list[int]:
        """Return the processes of this machine that are at runs which this runner looks at."""
        here = {"here": self._process.place, "pid": self._process.pid}
        with told(self.path):
            rows = self._connection.execute(OTHERS, {**self._chosen, **here}).fetchall()
        return [int(row[0]) for row in rows]
