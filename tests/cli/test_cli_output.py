"""What every command prints: tables that fit, one JSON object, nothing, and whether all is well."""

import json
import logging
import warnings
from functools import partial
from threading import Event, Thread

import pytest

from armid.cli.main import show_warning
from armid.cli.options import command
from armid.progress import announced
from armid.record.campaign import warned_once
from armid.report import files, html, style
from armid.report.document import Column, Struck, Table, table
from armid.report.terminal import print_table
from commands import not_drawn

QUICK = ("--budget", "80", "--window", "0:0.4")
# A call of each command that needs no long work; OUT stands for a new folder, CAMPAIGN for a campaign of two records.
CALLS = (
    "simulate CAMPAIGN --out OUT",
    "identify CAMPAIGN --budget 80",
    "identifiability CAMPAIGN",
    "list identifiers",
    "list effects --long",
    "list fitness",
    "list plants",
    "list analyses",
    "check CAMPAIGN",
    "doctor",
    "new effect my_drag --out OUT",
    "new campaign my_axis --out OUT",
)
SLOW = ("report STUDY", "export ioh STUDY OUT", "close-loop CAMPAIGN --out OUT --candidates viscous")  # fmt: skip
WIDE = table(
    "Wide", ["name", Column("a", "largest median error", ".3g"), Column("b", "worst", ".3g"), "note", "last"],
    [("a long name of an identifier, with options", 4.32e-6, 1.24e-5, Struck("3.1 to 3.2"), "x" * 30)] * 2, name="wide",
)  # fmt: skip


@pytest.fixture
def called(run, small_folder, store, tmp_path, monkeypatch):
    """Return a function that runs each call with more words, no figure drawn: (its words, what it left)."""
    for module, name in ((files, "save"), (style, "save"), (html, "svg_text")):
        monkeypatch.setattr(module, name, not_drawn)

    def all_of(lines, *more):
        for i, line in enumerate(lines):
            words = [
                {"CAMPAIGN": small_folder, "STUDY": store, "OUT": tmp_path / f"{i}{more}"}.get(w, w)
                for w in line.split()
            ]
            yield line, run(*words, *more)

    return all_of


@pytest.mark.parametrize("lines", [pytest.param(CALLS, marks=pytest.mark.slow),
                                   pytest.param(SLOW, marks=pytest.mark.nightly)])  # fmt: skip
def test_no_table_is_wider_than_the_screen_and_nothing_in_it_is_cut(called, monkeypatch, lines):
    monkeypatch.setenv("COLUMNS", "80")
    for line, ran in called(lines):
        assert (ran.code, ran.err) == (0, ""), line
        assert "…" not in ran.out, line
        drawn = [text for text in ran.out.splitlines() if text[:1] in "┏┃┡│└┌"]
        assert max(map(len, drawn), default=0) <= 80, line


@pytest.mark.parametrize("width", [20, 40, 60, 80, 120, 300])
def test_a_number_is_whole_or_not_there(width):
    from rich.console import Console

    console = Console(width=width, record=True)
    print_table(WIDE, console)
    text = console.export_text()
    assert "…" not in text
    assert ("4.32e-06" in text) or width < 60
    assert ("x" * 30 in text) == (width >= 120) == ("in wide.csv" not in text)
    empty = Table("", "Empty", "", [], (Column("a", "a"), Column("b", "b", ".1f")))
    print_table(empty, console)


@pytest.mark.parametrize("lines", [CALLS, pytest.param(SLOW, marks=pytest.mark.nightly)])
def test_json_is_one_object_and_quiet_prints_nothing(called, lines):
    for line, ran in called(lines, "--json"):
        assert ran.code == 0, line
        assert isinstance(json.loads(ran.out), dict), line
    for line, ran in called(lines, "--quiet"):
        assert (ran.code, bool(ran.out)) == (0, line.startswith("list")), line


def test_what_takes_long_is_announced_in_a_pipe_too(capsys):
    log = logging.getLogger("armid")

    @command("slow")
    def slow():
        thread = Thread(target=log.info, args=("compiling it",))
        thread.start()
        thread.join()

    log.setLevel(logging.INFO)
    for words, told in (([], "armid: compiling it\n"), (["--json"], "armid: compiling it\n"), (["--quiet"], "")):
        slow.main(words, standalone_mode=False)
        assert capsys.readouterr() == ("", told)


def test_a_point_that_takes_too_long_ends_the_check_and_the_doctor_tells_what_is_wrong(run, monkeypatch, tmp_path):
    (tmp_path / "slow.py").write_text(
        "import time\n\n\ndef slow(measured, simulated):\n    time.sleep(5.0)\n    return simulated[:, 0]\n"
    )
    ran = run("check", f"{tmp_path}/slow.py:slow", "--time-limit", "0.3")
    assert ran.code == 1
    assert "FAIL time limit: point 1 takes longer than 0.3 s" in ran.out
    assert "3 of 3 points hold" in run("doctor").out
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("ARMID_CACHE", str(tmp_path / "file"))
    ran = run("doctor")
    assert ran.code == 1
    assert "FAIL cache: " in ran.out


def test_long_work_is_announced_again_and_again(caplog, monkeypatch):
    monkeypatch.setattr("armid.progress.SLOW_S", 0.01)
    monkeypatch.setattr("armid.progress.AGAIN_S", 0.01)
    caplog.set_level(logging.INFO, "armid")
    with announced("reading 3 records"):
        while len(caplog.messages) < 3:
            Event().wait(0.01)
    assert caplog.messages[:2] == ["reading 3 records", "reading 3 records (0 s)"]
    monkeypatch.setattr("armid.progress.SLOW_S", 60.0)
    caplog.clear()
    with announced("quick"):
        pass
    assert "quick" not in caplog.text


def test_options_of_every_identifier_have_a_meaning(run):
    told = json.loads(run("list", "identifiers", "--json").out)["identifiers"]
    said = run("list", "identifiers", "--long").out
    for name, identifier in told.items():
        assert identifier["note"], name
        for option, about in identifier["options"].items():
            assert about["meaning"], (name, option)
            assert f"--option {option}=" in said
    assert told["pso"]["options"]["velocity_limit"]["default"] == "literal"


def test_a_warning_of_no_record_is_told_once(capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = partial(show_warning, set())
        with warned_once(UserWarning):
            for _ in range(2):
                warnings.warn("tables are in pieces", stacklevel=1)
    assert capsys.readouterr().err == "armid: warning: tables are in pieces\n"
