"""Read a store without changing it, wherever it lies."""

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from armid.model import ArmidError
from armid.study.store_file import WAIT_S, check_format, store_path, told


@contextmanager
def reading(path: Path) -> Iterator[sqlite3.Connection]:
    """Give a connection that cannot write.

    A store whose runner was killed has a log beside it, which cannot be read in a read-only folder: it is copied then.
    Raises ArmidError for what is no store.
    """
    with told(path):
        connection = connected(path)
        if connection is not None:
            try:
                yield connection
            finally:
                connection.close()
            return
    with told(path), TemporaryDirectory(prefix="armid-") as beside:
        for file in path.parent.glob(f"{path.name}*"):
            shutil.copy(file, beside)
        copied = sqlite3.connect(Path(beside) / path.name, isolation_level=None)
        try:
            check_format(copied, path)
            yield copied
        finally:
            copied.close()


def connected(path: Path) -> sqlite3.Connection | None:
    """Return a connection that only reads, None where the log beside the file cannot be read in its place."""
    connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, timeout=WAIT_S, isolation_level=None)
    try:
        check_format(connection, path)
    except sqlite3.OperationalError as error:
        connection.close()
        if error.sqlite_errorname.startswith(("SQLITE_CANTOPEN", "SQLITE_READONLY")):
            return None
        raise
    except BaseException:
        connection.close()
        raise
    return connection


def existing_store(path: str | Path) -> Path:
    """Return the file of a store that is there.

    Raises ArmidError when there is none.
    """
    file = store_path(path)
    if not file.is_file():
        raise ArmidError(f"there is no store {file}: a folder that `armid study` has written is expected")
    return file
