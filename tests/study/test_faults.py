"""Full disks, folders that cannot be written, and identifiers that take their worker with them."""

import errno
import shutil
import subprocess
import sys
import time

import pytest
from small_study import RUNS_A_SEED, beside_cost, same_results

from armid.errors import ArmidError, MachineError
from armid.study.results import load_study
from armid.study.runner import run_study
from armid.study.store import FILE_NAME, MissingRun
from armid.study.tasks import Study, perform
from commands import python, remount

SEEDS = 6
READER = """
import sqlite3, sys, time
store = sqlite3.connect(sys.argv[1])
store.execute("pragma journal_mode = wal").fetchone()
store.execute("select count(*) from sqlite_master").fetchone()
print("open", flush=True)
time.sleep(600)
"""
CHAIN = 'name = "pso+least_squares"'


@pytest.fixture
def small_disk(disk):
    return disk("4m")


def ended_with_one_sentence(process):
    out, err = process.communicate(timeout=600)
    err = beside_cost(err)
    assert (process.returncode, out) == (2, "")
    assert err.startswith("armid: ")
    assert err.count("\n") == 1
    return err


@pytest.mark.nightly
def test_a_full_disk_is_told_and_harms_nothing(start, write_study, tmp_path, small_disk, undisturbed):
    file, out = write_study(SEEDS), small_disk / "out"

    def fill(left):
        (small_disk / "filler").write_bytes(b"f" * (shutil.disk_usage(small_disk).free - left))

    fill(2_000_000)
    err = ended_with_one_sentence(start(file, "--out", out, "--jobs", 1))
    assert "study.sqlite: 2.0 MB are left on its disk, at least 3 MB are expected" in err
    assert not out.exists()
    (small_disk / "filler").unlink()
    # one of which nothing is missing needs no room
    shutil.copytree(undisturbed.path.parent, out)
    fill(800_000)
    process = start(file, "--out", out, "--jobs", 1)
    assert process.wait() == 0, process.communicate()
    shutil.rmtree(out)
    (small_disk / "filler").unlink()
    process = start(file, "--out", out, "--jobs", 1)
    while not (out / "study.sqlite").exists():
        assert process.poll() is None
        time.sleep(0.01)
    fill(300_000)
    err = ended_with_one_sentence(process)
    assert "database or disk is full; what was finished before is kept" in err
    kept = load_study(out)
    assert 0 < len(kept.runs) < SEEDS * RUNS_A_SEED
    remount(small_disk, "size=20m")
    assert start(file, "--out", out, "--jobs", 1).wait() == 0
    assert same_results(load_study(out), undisturbed)


@pytest.mark.slow
def test_a_read_only_folder_can_be_read_and_is_told_when_written(write_study, small_disk, undisturbed):
    remount(small_disk, "size=20m")
    shutil.copytree(undisturbed.path.parent, small_disk / "out")
    remount(small_disk, "ro")
    assert same_results(load_study(small_disk / "out"), undisturbed)
    with pytest.raises(ArmidError, match=rf"{FILE_NAME}.*attempt to write a readonly database"):
        run_study(write_study(7), jobs=1, out=small_disk / "out")


@pytest.mark.slow
def test_a_log_left_in_a_read_only_folder_is_read(write_study, small_disk):
    remount(small_disk, "size=20m")
    out = small_disk / "out"
    run_study(write_study(1), jobs=1, out=out, only="row 1/random")
    # Who has the store open when the runner ends, and is killed then, leaves the log behind.
    reader = subprocess.Popen([sys.executable, "-c", READER, str(out / FILE_NAME)], stdout=subprocess.PIPE, text=True)
    assert reader.stdout.readline() == "open\n"
    run_study(write_study(2), jobs=1, out=out, only="row 1/random")
    reader.kill()
    reader.communicate()
    n = len(load_study(out).runs)
    assert any(p.name.endswith("-wal") for p in out.iterdir())
    remount(small_disk, "ro")
    assert len(load_study(out).runs) == n > 0


@pytest.mark.nightly
def test_identifiers_that_misbehave_fail_alone(write_study, tmp_path, bad_identifiers, undisturbed):
    """Each with its error, and the other runs are what they were."""
    errors = {
        "raises": "ZeroDivisionError: nothing to divide by",
        "leaves": "SystemExit: 3",
        "segfaults": "the worker process ended by SIGSEGV, 2 times",
        "interrupts": "the worker process ended with code 130, 2 times",
        "writes": "the worker process sent what is not a message of ours",
        "hangs": "stopped at the time limit of 3 s",
    }
    bad = "\n[[identifiers]]\n".join(f'name = "{name}"\nnoise_deg_s = 0.3' for name in errors)
    plugins = [f"{bad_identifiers}:{name}" for name in errors]
    options = {"jobs": 2, "out": tmp_path / "out", "plugins": plugins, "only": "row 1", "time_limit": 3.0}
    found = run_study(write_study(1, change=(CHAIN, bad)), **options)
    failed = found.runs[found.runs["status"] == "failed"].set_index("identifier")["error"]
    assert {name: words for name, words in errors.items() if words in failed[name]} == errors
    done = found.runs[found.runs["status"] == "done"]["run"]
    assert len(done) == RUNS_A_SEED / 2 - 2
    assert set(done) < set(undisturbed.runs["run"])
    assert found.study["n_failed"] == len(errors)
    # they have failed, and are not tried again unless someone asks for it
    assert run_study(write_study(1, change=(CHAIN, bad)), **options).runs.equals(found.runs)


@pytest.mark.parametrize(("name", "words"), [
    pytest.param("hangs", "stopped at the time limit of 2 s", marks=pytest.mark.slow),
    ("raises", "ZeroDivisionError: division by zero"),
    ("segfaults", "the worker process ended by SIGSEGV, 2 times"),
])  # fmt: skip
def test_what_a_factory_does_harms_no_runner(write_study, tmp_path, bad_identifiers, name, words):
    file = write_study(1, change=(CHAIN, f'name = "{name}_when_built"'))
    with pytest.raises(ArmidError, match=rf"identifier '{name}_when_built': it cannot be built: .*{words}"):
        run_study(file, 1, out=tmp_path / "out", plugins=[f"{bad_identifiers}:{name}_when_built"], time_limit=2.0)
    assert not (tmp_path / "out").exists()


def test_a_damaged_page_is_told(undisturbed, tmp_path):
    whole = undisturbed.path.read_bytes()
    schema = whole.index(b"CREATE TABLE study")
    for content in (whole[: 5 * 4096] + bytes(4 * 4096) + whole[9 * 4096 :],
                    whole[:schema] + b"CREATE TAB\xccE" + whole[schema + 12 :],
                    whole[:4096] + b"\xa5" * (len(whole) // 2 - 4096) + whole[len(whole) // 2 :]):  # fmt: skip
        (tmp_path / FILE_NAME).write_bytes(content)
        with pytest.raises(ArmidError, match=r"study\.sqlite (is damaged|cannot be used)"):
            load_study(tmp_path)


@pytest.mark.nightly
def test_failed_runs_are_made_anew_on_request_and_when_the_plug_in_has_changed(write_study, tmp_path, bad_identifiers):
    mine = tmp_path / "mine.py"
    shutil.copy(bad_identifiers, mine)
    file = write_study(1, change=(CHAIN, 'name = "raises"'))
    told = {"jobs": 1, "out": tmp_path / "out", "plugins": [f"{mine}:raises"], "only": "row 1/ra*"}
    first = run_study(file, **told)
    retried = run_study(file, **told, retry=True)
    assert list(retried.runs["run"]) == list(first.runs["run"])
    kept = first.runs["status"] == "done"
    assert retried.runs[kept].equals(first.runs[kept])
    assert not retried.runs["started_at"].equals(first.runs["started_at"]) or retried.runs["seconds"].iloc[-1] > 0
    with open(mine, "a", encoding="utf-8") as text:
        text.write("\n# mended\n")
    from armid.study.spec import study_registry

    assert study_registry(told["plugins"]).digests_of("identifiers", "raises+bobyqa") != {}
    changed = run_study(file, **told)
    same = set(changed.runs["run"]) & set(first.runs["run"])
    assert same == set(first.runs[kept]["run"])


@pytest.mark.parametrize(("error", "of_the_machine"), [
    (OSError(errno.ENOSPC, "No space left on device"), True), (MemoryError("no room"), True),
    (OSError(errno.ENOENT, "No such file"), False), (ValueError("a bad value"), False),
])  # fmt: skip
def test_a_fault_of_the_machine_marks_no_run(error, of_the_machine, monkeypatch):
    def failing(settings, cache):
        raise error

    monkeypatch.setattr(Study, "perform", staticmethod(failing))
    run = MissingRun("r", '{"kind": "identify"}')
    if of_the_machine:
        with pytest.raises(MachineError, match="the machine, not a run, is at fault"):
            perform(run, None)
    else:
        assert perform(run, None).status == "failed"


def test_a_worker_that_cannot_start_is_told(write_study, tmp_path, monkeypatch):
    monkeypatch.setattr("sys.executable", "/bin/false")
    with pytest.raises(ArmidError, match="a worker process cannot start: it ended with code 1"):
        run_study(write_study(), jobs=1, out=tmp_path / "out")


@pytest.mark.slow
def test_a_script_without_a_main_guard_runs_a_study(write_study, tmp_path):
    script = tmp_path / "script.py"
    called = f"run_study({str(write_study(1))!r}, 1, out={str(tmp_path / 'out')!r}, only='row 1/random')"
    script.write_text(f"import armid\nprint(len(armid.{called}.runs))\n", encoding="utf-8")
    done = python(script)
    assert (done.stdout, done.stderr) == ("2\n", "")
