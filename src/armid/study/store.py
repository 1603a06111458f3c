"""Runs as they are planned, handed out and performed, and the store of a study: one SQLite file that holds them."""

import hashlib
import json
import os
import shutil
import sqlite3
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError

DONE, FAILED = "done", "failed"
# Hexadecimal digits of a run's id: two of a million runs share theirs with a probability of 1e-8.
ID_LENGTH = 16
# Little-endian on every machine; the values of a trace have few equal bytes, so that a higher level gains nothing.
COUNTS, VALUES, LEVEL = "<i8", "<f8", 1


class Planned(NamedTuple):
    """A run: its id, its settings (JSON), and the words under which it is reported.

    noise_deg_s: None for records that are read; they keep the noise that they have.
    """

    run: str
    settings: str
    case: str
    identifier: str
    fitness: str
    noise_deg_s: float | None
    window: str
    seed: int
    budget: int


def planned(settings: Mapping[str, Any], *words: Any) -> Planned:
    """Return a run whose id is a hash of all that decides its result; words: the fields of Planned after settings."""
    text = json.dumps(settings, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return Planned(hashlib.sha256(text.encode()).hexdigest()[:ID_LENGTH], text, *words)


class MissingRun(NamedTuple):
    """A run that is to be performed: its id, and its settings as the store keeps them (JSON)."""

    run: str
    settings: str


@dataclass(frozen=True)
class Outcome:
    """What a run gave, as plain values that a store can keep.

    status: "done", or "failed" with the reason in `error`. used: simulations. seconds: of the wall clock. started_at:
    for people; nothing depends on it. model: its equations. rows: table of the store -> rows of it without their run.
    """

    run: str
    status: str
    error: str = ""
    used: int = 0
    seconds: float = 0.0
    started_at: str = ""
    model: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    rows: Mapping[str, Sequence[tuple[Any, ...]]] = field(default_factory=dict)


Array = NDArray[np.float64]


class RunTrace(NamedTuple):
    """The improvements of one run: counts from 1 and best fitness, (n,); X: candidates, SI, (n, n_parameters)."""

    run: str
    evaluations: NDArray[np.int64]
    values: Array
    X: Array
    names: tuple[str, ...]


def packed(evaluations: NDArray[np.int64], values: Array, X: Array) -> bytes:
    """Return a trace as compressed bytes: all evaluations, then all values, then X row by row."""
    parts = (evaluations.astype(COUNTS), values.astype(VALUES), np.ascontiguousarray(X, VALUES))
    return zlib.compress(b"".join(p.tobytes() for p in parts), LEVEL)


def unpacked(run: str, content: bytes, names: tuple[str, ...]) -> RunTrace:
    """Return a trace out of its bytes."""
    raw = zlib.decompress(content)
    n = len(raw) // (8 * (2 + len(names)))
    evaluations = np.frombuffer(raw, COUNTS, n)
    values = np.frombuffer(raw, VALUES, n, 8 * n)
    X = np.frombuffer(raw, VALUES, n * len(names), 16 * n).reshape(n, len(names))
    return RunTrace(run, evaluations.astype(np.int64), values.astype(np.float64), X.astype(np.float64), names)


FILE_NAME = "study.sqlite"
# "armd" in ASCII: a file of another program is recognised before anything is written to it.
APPLICATION, FORMAT = 0x61726D64, 1
WAIT_S = 60.0
# Steps of SQLite between two looks for a signal, a few milliseconds.
PROGRESS_STEPS = 100_000

# The last four hold what a run gave: one that identifies fills three, one that closes the loop the fourth.
SCHEMA = """
CREATE TABLE IF NOT EXISTS study (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID, STRICT;
CREATE TABLE IF NOT EXISTS settings (run TEXT PRIMARY KEY, settings TEXT NOT NULL) WITHOUT ROWID, STRICT;
CREATE TABLE IF NOT EXISTS plan (
    place INTEGER PRIMARY KEY, run TEXT NOT NULL UNIQUE, "case" TEXT NOT NULL, identifier TEXT NOT NULL,
    fitness TEXT NOT NULL, noise_deg_s REAL, window TEXT NOT NULL, seed INTEGER NOT NULL, budget INTEGER NOT NULL
) STRICT;
CREATE TABLE IF NOT EXISTS runs (
    run TEXT PRIMARY KEY, status TEXT NOT NULL, error TEXT NOT NULL, seconds REAL NOT NULL, started_at TEXT NOT NULL,
    model TEXT NOT NULL, versions TEXT NOT NULL
) WITHOUT ROWID, STRICT;
CREATE TABLE IF NOT EXISTS texts (hash TEXT PRIMARY KEY, text TEXT NOT NULL) WITHOUT ROWID, STRICT;
CREATE TABLE IF NOT EXISTS identified (
    run TEXT NOT NULL PRIMARY KEY, used INTEGER, n_failed INTEGER, value REAL, stopped TEXT, train_rmse REAL,
    train_s REAL, train_s1 REAL, train_s2 REAL, holdout_rmse REAL
) STRICT;
CREATE TABLE IF NOT EXISTS parameters (
    run TEXT NOT NULL, parameter TEXT NOT NULL, unit TEXT, value REAL, low REAL, high REAL, deviation REAL,
    correlation_max REAL, at_bound INTEGER, PRIMARY KEY (run, parameter)
) STRICT;
CREATE TABLE IF NOT EXISTS traces (run TEXT NOT NULL PRIMARY KEY, names TEXT, trace BLOB) STRICT;
CREATE TABLE IF NOT EXISTS loops (
    run TEXT NOT NULL PRIMARY KEY, verdict TEXT NOT NULL, cpu_seconds REAL NOT NULL, report TEXT NOT NULL
) STRICT;
"""


# Between identifier and fitness where tables name both.
ON = " on "
# Runs that this runner looks at, and those of them that are not finished.
CHOSEN = f"""
(p."case" = :case OR p."case" GLOB :case) AND (p.identifier = :identifier OR p.identifier GLOB :identifier
OR p.identifier || '{ON}' || p.fitness GLOB :identifier)
"""
EVERY_RUN = {"case": "*", "identifier": "*"}
MISSING = f"""
SELECT p.place, p.run, s.settings FROM plan p JOIN settings s USING (run)
WHERE p.place > :after AND {CHOSEN} AND NOT EXISTS (SELECT 1 FROM runs r WHERE r.run = p.run) ORDER BY p.place LIMIT :n
"""
# How many missing runs are fetched at a time.
PAGE_OF_ROWS = 256
TALLY = f"""
SELECT count(*), count(status), ifnull(sum(status = '{FAILED}'), 0) FROM plan p LEFT JOIN runs USING (run)
WHERE {CHOSEN}
"""
FAILURES = f"FROM plan p JOIN runs r USING (run) WHERE {CHOSEN} AND r.status = '{FAILED}'"


class Counts(NamedTuple):
    planned: int
    done: int
    failed: int

    @property
    def missing(self) -> int:
        return self.planned - self.done - self.failed


class Store:
    """Write to the store of a study, one process at a time; only: patterns of case and identifier that it looks at.

    Every finished run is one transaction. A run that is there already stays as it is, so that nothing is there twice.
    Raises ArmidError with one sentence for all that the disk refuses, and where another process is at the store.
    """

    def __init__(self, folder: Path, only: tuple[str, str] = ("*", "*")) -> None:
        if folder.exists() and not folder.is_dir():
            raise ArmidError(f"{folder} is a file, a folder for the results is expected")
        self.path = folder / FILE_NAME
        self._chosen = {"case": only[0], "identifier": only[1]}
        self._connection = opened(self.path)
        try:
            self._lock = locked(folder)
        except BlockingIOError as error:
            closed(self._connection)
            raise ArmidError(f"another process is at the runs of {self.path}: let it end, the same command goes on "
                             "then") from error  # fmt: skip

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        closed(self._connection)
        os.close(self._lock)

    def plan(self, description: Mapping[str, Any], planned: Iterable[Planned]) -> None:
        """Set what the study consists of now; finished runs stay, also those that it no longer asks for."""
        with translate_errors(self.path), transaction(self._connection):
            name = str(description["name"])
            before = self._connection.execute("SELECT value FROM study WHERE key = 'description'").fetchone()
            other = json.loads(before[0])["name"] if before else name
            if other != name:
                raise ArmidError(f"{self.path} holds the study '{other}', another folder is expected for '{name}'")
            self._connection.execute("DELETE FROM plan")
            self._connection.executemany("INSERT INTO plan VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", self._rows(planned))
            kept = "SELECT run FROM plan UNION SELECT run FROM runs"
            self._connection.execute(f"DELETE FROM settings WHERE run NOT IN ({kept})")
            row = "description", json.dumps(description, ensure_ascii=False)
            self._connection.execute("INSERT OR REPLACE INTO study VALUES (?, ?)", row)

    def _rows(self, planned: Iterable[Planned]) -> Iterable[tuple[Any, ...]]:
        """Yield rows of the plan one by one, so that a large study needs no memory, and keep their settings."""
        for place, each in enumerate(planned):
            self._connection.execute("INSERT OR IGNORE INTO settings VALUES (?, ?)", (each.run, each.settings))
            yield (place, each.run, *each[2:])

    def forget_failed(self) -> None:
        """Take out the failed runs that this runner looks at, so that they are performed anew."""
        with translate_errors(self.path), transaction(self._connection):
            self._connection.execute(f"DELETE FROM runs WHERE run IN (SELECT p.run {FAILURES})", self._chosen)

    def missing(self) -> Iterator[MissingRun]:
        """Yield the runs that are not finished, in the order of the plan."""
        place = -1
        while rows := self._selected(MISSING, after=place, n=PAGE_OF_ROWS):
            place = rows[-1][0]
            yield from (MissingRun(run, settings) for _, run, settings in rows)

    def _selected(self, query: str, **further: object) -> list[Any]:
        """Return rows of the runs that this runner looks at."""
        with translate_errors(self.path):
            return self._connection.execute(query, self._chosen | further).fetchall()

    def save(self, outcome: Outcome) -> bool:
        """Keep a finished run; tell whether it was not there yet."""
        versions = json.dumps(dict(outcome.versions), sort_keys=True)
        with translate_errors(self.path), transaction(self._connection):
            row = (outcome.run, outcome.status, outcome.error, outcome.seconds, outcome.started_at,
                   self._text(outcome.model), self._text(versions))  # fmt: skip
            cursor = self._connection.execute("INSERT OR IGNORE INTO runs VALUES (?, ?, ?, ?, ?, ?, ?)", row)
            is_new = cursor.rowcount == 1
            for table, rows in outcome.rows.items() if is_new else ():
                for values in rows:
                    marks = ", ".join("?" * (1 + len(values)))
                    self._connection.execute(f"INSERT OR REPLACE INTO {table} VALUES ({marks})", (outcome.run, *values))
        return is_new

    def _text(self, text: str) -> str:
        digest = hashlib.sha256(text.encode()).hexdigest()[:16]
        self._connection.execute("INSERT OR IGNORE INTO texts VALUES (?, ?)", (digest, text))
        return digest

    def counts(self) -> Counts:
        ((planned, finished, failed),) = self._selected(TALLY)
        return Counts(planned, finished - failed, failed)

    def first_error(self) -> str:
        """Return what the first failed run says, "" when none has failed."""
        rows = self._selected(f"SELECT r.error {FAILURES} ORDER BY p.place LIMIT 1")
        return str(rows[0][0]) if rows else ""


def locked(folder: Path) -> int:
    """Return a handle that locks a folder until it is closed or the process ends; BlockingIOError for a locked one.

    Some network file systems have no such lock. There two processes may make a run twice; it is kept once.
    """
    from fcntl import LOCK_EX, LOCK_NB, flock

    handle = os.open(folder, os.O_RDONLY)
    try:
        flock(handle, LOCK_EX | LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise
    except OSError:
        pass
    return handle


@contextmanager
def translate_errors(path: Path) -> Iterator[None]:
    """Turn what SQLite cannot do into one sentence."""
    try:
        yield
    except sqlite3.Error as error:
        if getattr(error, "sqlite_errorname", "") == "SQLITE_INTERRUPT":
            raise KeyboardInterrupt from error
        raise ArmidError(f"{path} cannot be used: {str(error)[:120]}; what was finished before is kept") from error
    except UnicodeDecodeError as error:
        # SQLite quotes what is damaged in its message
        raise ArmidError(f"{path} is damaged: what SQLite says of it cannot be read as text") from error
    except OSError as error:
        raise ArmidError(f"{error.filename or path} cannot be used: {error.strerror or error}") from error


def connected(database: str | Path, **options: Any) -> sqlite3.Connection:
    """Return a connection whose queries end by a signal, however long they are: `translate_errors` raises it again."""
    connection: sqlite3.Connection = sqlite3.connect(database, isolation_level=None, **options)
    # Python looks for signals when it calls this
    connection.set_progress_handler(lambda: 0, PROGRESS_STEPS)
    return connection


def opened(path: Path) -> sqlite3.Connection:
    """Return a connection that writes, to a new file or to one of ours.

    A write-ahead log is kept: a process that is killed at any moment leaves every finished transaction and no half one.
    """
    with translate_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        connection = connected(path, timeout=WAIT_S)
        try:
            check_format(connection, path, may_be_new=True)
            keep_log(connection)
            connection.execute("PRAGMA synchronous = NORMAL")
            with transaction(connection):
                for statement in filter(str.strip, SCHEMA.split(";")):
                    connection.execute(statement)
                if not connection.execute("PRAGMA user_version").fetchone()[0]:
                    connection.execute(f"PRAGMA application_id = {APPLICATION}")
                    connection.execute(f"PRAGMA user_version = {FORMAT}")
        except BaseException:
            connection.close()
            raise
    return connection


@contextmanager
def reading(path: Path) -> Iterator[sqlite3.Connection]:
    """Give a connection that cannot write, and tell in one sentence what cannot be read.

    A store whose runner was killed has a log in its folder. In a read-only folder both are copied to be read.
    """
    with translate_errors(path), ExitStack() as stack:
        uri = f"{path.resolve().as_uri()}?mode=ro"
        connection = stack.enter_context(closing(connected(uri, uri=True, timeout=WAIT_S)))
        try:
            check_format(connection, path)
        except sqlite3.OperationalError as error:
            if not error.sqlite_errorname.startswith(("SQLITE_CANTOPEN", "SQLITE_READONLY")):
                raise
            copies = stack.enter_context(TemporaryDirectory(prefix="armid-"))
            for file in path.parent.glob(f"{path.name}*"):
                shutil.copy(file, copies)
            connection = stack.enter_context(closing(connected(Path(copies) / path.name)))
            check_format(connection, path)
        try:
            yield connection
        except (ValueError, TypeError, KeyError, AttributeError, zlib.error) as error:
            if isinstance(error, ArmidError):
                raise
            raise ArmidError(
                f"{path} is damaged: what it holds cannot be read, what armid wrote is expected"
            ) from error


def keep_log(connection: sqlite3.Connection) -> None:
    """Make a store keep a write-ahead log; SQLite waits for no other process that does so in the same moment."""
    until = time.monotonic() + WAIT_S
    while True:
        try:
            connection.execute("PRAGMA journal_mode = WAL")
            return
        except sqlite3.OperationalError as error:
            if error.sqlite_errorname != "SQLITE_BUSY" or time.monotonic() > until:
                raise
        time.sleep(0.05)


def check_format(connection: sqlite3.Connection, path: Path, may_be_new: bool = False) -> None:
    try:
        # first: another runner may make the tables meanwhile, and they come in one transaction with the two numbers
        is_empty = not connection.execute("SELECT count(*) FROM sqlite_schema").fetchone()[0]
        numbers = [connection.execute(f"PRAGMA {word}").fetchone()[0] for word in ("application_id", "user_version")]
    except sqlite3.DatabaseError as error:
        if error.sqlite_errorname != "SQLITE_NOTADB":
            raise
        raise ArmidError(f"{path} is not a store of a study: another file has its name") from error
    if numbers == [APPLICATION, FORMAT] or (may_be_new and is_empty):
        return
    if numbers[0] != APPLICATION:
        raise ArmidError(f"{path} is not a store of a study: another program's data, or nothing, is in it")
    raise ArmidError(f"{path} is a store of format {numbers[1]}, {FORMAT} is expected: another version of armid "
                     "wrote it")  # fmt: skip


@contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """Do all or nothing; other writers wait from the beginning on."""
    with connection:
        connection.execute("BEGIN IMMEDIATE")
        yield


def closed(connection: sqlite3.Connection) -> None:
    """Close a connection; the last one leaves a single file that can be read in any place, also a read-only one."""
    with suppress(sqlite3.Error), closing(connection):
        connection.execute("PRAGMA busy_timeout = 0")
        connection.execute("PRAGMA journal_mode = DELETE")
