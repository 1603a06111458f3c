"""The file of a store: its tables, how it is opened, and how its errors reach the user."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from armid.model import ArmidError
from armid.study.kind import KINDS, Table

FILE_NAME = "study.sqlite"
# "armd" in ASCII: a file of another program is recognised before anything is written to it.
APPLICATION, FORMAT = 0x61726D64, 1
WAIT_S = 60.0

TABLES = """
CREATE TABLE study (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE settings (run TEXT PRIMARY KEY, settings TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE plan (
    place INTEGER PRIMARY KEY, run TEXT NOT NULL UNIQUE, "case" TEXT NOT NULL, identifier TEXT NOT NULL,
    fitness TEXT NOT NULL, noise_deg_s REAL, window TEXT NOT NULL, seed INTEGER NOT NULL, budget INTEGER NOT NULL
);
CREATE TABLE runs (
    run TEXT PRIMARY KEY, status TEXT NOT NULL, error TEXT NOT NULL, seconds REAL NOT NULL, started_at TEXT NOT NULL,
    model TEXT NOT NULL, versions TEXT NOT NULL
) WITHOUT ROWID;
CREATE TABLE texts (hash TEXT PRIMARY KEY, text TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE claims (
    run TEXT PRIMARY KEY, place TEXT NOT NULL, pid INTEGER NOT NULL, start TEXT NOT NULL
) WITHOUT ROWID;
"""


def table_text(name: str, table: Table) -> str:
    """Return the SQL that makes a table of a kind."""
    key = f"PRIMARY KEY (run, {table.rows_by})" if table.rows_by else "PRIMARY KEY (run)"
    return f"CREATE TABLE {name} (run TEXT NOT NULL, {', '.join(table.columns)}, {key})"


def store_path(path: str | Path) -> Path:
    """Return the file that a folder of results or the file itself stands for."""
    return Path(path) / FILE_NAME if Path(path).is_dir() else Path(path)


@contextmanager
def told(path: Path) -> Iterator[None]:
    """Turn what SQLite cannot do into one sentence."""
    try:
        yield
    except sqlite3.Error as error:
        raise ArmidError(f"{path} cannot be used: {error}; what was finished before is kept") from error
    except OSError as error:
        raise ArmidError(f"{error.filename or path} cannot be used: {error.strerror or error}") from error


def opened(path: Path) -> sqlite3.Connection:
    """Return a connection that writes, to a new file or to one of ours.

    A write-ahead log is kept: a process that is killed at any moment leaves every finished transaction and no half one.

    Raises ArmidError for a file of another program or of a newer version.
    """
    with told(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        connection = sqlite3.connect(path, timeout=WAIT_S, isolation_level=None)
        try:
            check_format(connection, path, may_be_new=True)
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = NORMAL")
            make_tables(connection)
        except BaseException:
            connection.close()
            raise
    return connection


def check_format(connection: sqlite3.Connection, path: Path, may_be_new: bool = False) -> None:
    """Refuse a file that is no store of this version."""
    try:
        # first: another runner may make the tables meanwhile, and they come in one transaction with the two numbers
        is_empty = not connection.execute("SELECT count(*) FROM sqlite_schema").fetchone()[0]
        found = [connection.execute(f"PRAGMA {word}").fetchone()[0] for word in ("application_id", "user_version")]
    except sqlite3.DatabaseError as error:
        if error.sqlite_errorname != "SQLITE_NOTADB":
            raise
        raise ArmidError(f"{path} is no store of a study: another file has its name") from error
    if found == [APPLICATION, FORMAT] or (may_be_new and is_empty):
        return
    if found[0] != APPLICATION:
        raise ArmidError(f"{path} is no store of a study: another program's data, or nothing, is in it")
    raise ArmidError(f"{path} is a store of format {found[1]}, {FORMAT} is expected: another version of armid wrote it")


def make_tables(connection: sqlite3.Connection) -> None:
    """Make what is missing, whole or not at all."""
    with transaction(connection):
        there = {row[0] for row in connection.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")}
        if not there:
            for statement in filter(str.strip, TABLES.split(";")):
                connection.execute(statement)
            connection.execute(f"PRAGMA application_id = {APPLICATION}")
            connection.execute(f"PRAGMA user_version = {FORMAT}")
        for kind in KINDS.values():
            for name, table in kind.tables.items():
                if name not in there:
                    connection.execute(table_text(name, table))


@contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """Do all or nothing; other writers wait from the beginning on."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        connection.execute("COMMIT")
    except BaseException:
        # SQLite has rolled back by itself after some errors, such as a full disk
        with suppress(sqlite3.Error):
            connection.execute("ROLLBACK")
        raise


def closed(connection: sqlite3.Connection) -> None:
    """Close a connection; the last one leaves a single file that can be read in any place, also a read-only one."""
    with suppress(sqlite3.Error):
        connection.execute("PRAGMA busy_timeout = 0")
        connection.execute("PRAGMA journal_mode = DELETE")
    with suppress(sqlite3.Error):
        connection.close()
