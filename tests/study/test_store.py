"""The store: one process at a time, files that are no store, and damaged ones."""

import os
import signal
import sqlite3
import threading
from contextlib import closing

import pytest

from armid.errors import ArmidError
from armid.study.results import load_study
from armid.study.store import DONE, FILE_NAME, Outcome, Planned, Store, connected, opened, transaction, translate_errors

DESCRIPTION = {"name": "made", "cases": []}


def planned(n, case="a"):
    return [Planned(f"{case}{i}", "{}", case, "pso", "rmse", 0.0, "whole", i, 10) for i in range(n)]


@pytest.fixture
def store(tmp_path):
    with Store(tmp_path) as store:
        store.plan(DESCRIPTION, planned(4))
        yield store


def runs(store):
    return [each.run for each in store.missing()]


def test_what_is_missing_comes_in_order_and_once(store, monkeypatch):
    monkeypatch.setattr("armid.study.store.PAGE_OF_ROWS", 3)
    missing = store.missing()
    assert next(missing).run == "a0"
    assert store.save(Outcome("a0", DONE))
    assert [each.run for each in missing] == ["a1", "a2", "a3"]
    assert runs(store) == ["a1", "a2", "a3"]


def test_one_process_at_a_time_keeps_each_run_once_of_one_study_and_one_format(store, tmp_path):
    with pytest.raises(ArmidError, match="another process is at the runs of"):
        Store(tmp_path)
    assert store.save(Outcome("a0", DONE))
    assert len(load_study(tmp_path).runs) == 1
    first, second = Outcome("a1", DONE, seconds=1.0), Outcome("a1", DONE, seconds=2.0)
    assert store.save(first)
    assert not store.save(second)
    assert store.counts() == (4, 2, 0)
    assert load_study(store.path).runs["seconds"].tolist() == [0.0, 1.0]
    with pytest.raises(ArmidError, match="holds the study 'made', another folder is expected"):
        store.plan({"name": "other", "cases": []}, planned(1, "b"))
    assert runs(store) == ["a2", "a3"]
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as connection:
        connection.execute("PRAGMA user_version = 99")
    with pytest.raises(ArmidError, match="is a store of format 99, 1 is expected"):
        load_study(tmp_path)


@pytest.mark.parametrize("content", [b"no database at all, but long enough to look like one" * 99, None])
def test_a_file_of_another_program_is_left_alone(tmp_path, content):
    file = tmp_path / FILE_NAME
    if content is None:
        with closing(sqlite3.connect(file)) as connection, connection:
            connection.execute("CREATE TABLE theirs (a)")
    else:
        file.write_bytes(content)
    before = file.read_bytes()
    for use in (Store, load_study):
        with pytest.raises(ArmidError, match="is not a store of a study"):
            use(tmp_path)
    assert file.read_bytes() == before


ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT"


def test_a_signal_ends_a_query(tmp_path):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    try:
        with (
            closing(connected(tmp_path / FILE_NAME)) as connection,
            pytest.raises(KeyboardInterrupt), translate_errors(tmp_path), transaction(connection),
        ):  # fmt: skip
            connection.execute(f"{ENDLESS} count(*) FROM n")
    finally:
        timer.join()
        signal.signal(signal.SIGINT, before)


def test_a_store_waits_for_another_runner_that_is_about_to_write(tmp_path):
    """SQLite waits for nobody where a log is to be made: it tells at once that the file is locked."""
    path = tmp_path / "made.sqlite"
    opened(path).close()
    with closing(sqlite3.connect(path, isolation_level=None, check_same_thread=False)) as other:
        other.execute("PRAGMA journal_mode = DELETE")
        other.execute("BEGIN IMMEDIATE")
        soon = threading.Timer(0.3, lambda: other.execute("COMMIT"))
        soon.start()
        opened(path).close()
        soon.join()
