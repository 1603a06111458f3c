"""`armid report` and `armid export ioh` on a small study that was really run."""

import shutil
import sqlite3
from contextlib import closing
from shutil import copytree
from types import SimpleNamespace

import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from armid.cli.options import put
from armid.cli.study import words
from armid.report import files as write
from armid.study.results import load_study
from armid.study.runner import Ending
from armid.study.store import Counts
from commands import ended, not_drawn


@pytest.mark.nightly
def test_figures_for_a_paper_are_pdf_of_its_width_without_a_title(store, monkeypatch, tmp_path):
    seen = []
    save = Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda figure, *a, **k: (seen.append(figure), save(figure, *a, **k)))
    folder = copytree(store, tmp_path / "out", ignore=lambda _, names: [n for n in names if "sqlite" not in n])
    assert ended("report", folder, "--format", "pdf", "--width", "single") == 0
    files = sorted(folder.glob("*.pdf"))
    assert {"ecdf", "table1"} <= {file.stem for file in files}
    assert {p.suffix for p in folder.iterdir()} == {".pdf", ".sqlite"}
    assert len(seen) == len(files)
    for figure in seen:
        assert figure.get_size_inches()[0] == 3.5
        assert {text.get_fontsize() for text in figure.findobj(Text) if text.get_text()} == {8.0}
        assert sum(bool(axis.get_title()) for axis in figure.axes) != 1
    text = files[0].read_bytes()
    assert f"/MediaBox [ 0 0 {72 * 3.5:g} ".encode() in text
    # nor would the same report give the same bytes again
    assert b"CreationDate" not in text


@pytest.mark.nightly
def test_a_report_of_a_real_store(store):
    before = (store / "study.sqlite").read_bytes()
    assert ended("report", store) == 0
    assert (store / "study.sqlite").read_bytes() == before
    text = (store / "report.md").read_text()
    assert "Complete: 4 of 4 runs." in text
    assert "Versions: armid" in text
    assert {"overview.csv", "table1.png", "ecdf.svg", "runs.tex"} <= {p.name for p in store.iterdir()}
    page = (store / "report.html").read_text()
    assert page.count("<svg") == len(list(store.glob("*.svg")))
    for wanted in ("Does a report come out of a real store?", "Best: noise-free: ", "Complete: 4 of 4 runs.",
                   "armid study tiny.toml", "d omega/dt", "name = &#34;tiny&#34;"):  # fmt: skip
        assert wanted in page


def test_pages_are_written_and_a_users_analysis_is_a_section(store, run, tmp_path, monkeypatch):
    (tmp_path / "study.sqlite").write_bytes((store / "study.sqlite").read_bytes())
    """A plug-in of another kind may be named as for the study."""
    best = "def best(runs):\n    return runs.groupby('identifier')[['value']].min()\n"
    (tmp_path / "mine.py").write_text(f"{best}\n\ndef miss(measured, simulated):\n    return simulated[:, 0]\n")
    monkeypatch.setattr(write, "save", not_drawn)
    monkeypatch.chdir(tmp_path)
    printed = run("report", tmp_path, "--plugin", "mine.py:best", "--plugin", "mine.py:miss").out
    assert printed.startswith("wrote report.md and ")
    best = pd.read_csv(tmp_path / "own_best.csv").set_index("identifier")["value"]
    assert best.to_dict() == load_study(store).runs.groupby("identifier")["value"].min().to_dict()
    assert (
        f"armid report {tmp_path} --plugin mine.py:best --plugin mine.py:miss" in (tmp_path / "report.md").read_text()
    )


STEERING = "x\nComplete: 4 of 4 runs\x1b[2J\x1b]0;owned\x07\u202egnp.exe"


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_what_a_store_holds_cannot_steer_the_terminal(store, run, tmp_path, monkeypatch):
    """Nor add a line to what is printed: in sentences, tables, and the error of a run that failed."""
    shutil.copy(store / "study.sqlite", tmp_path)
    with closing(sqlite3.connect(tmp_path / "study.sqlite")) as copy, copy:
        copy.execute("UPDATE runs SET status = 'failed', error = ? WHERE run IN (SELECT run FROM plan LIMIT 1)",
                     (STEERING,))  # fmt: skip
        copy.execute("UPDATE plan SET identifier = ? WHERE place > 2", (STEERING,))
    monkeypatch.setattr(write, "save", not_drawn)
    counts = Counts(4, 3, 1)
    said = words(Ending(SimpleNamespace(name="s"), tmp_path, counts, 0, 0, 1.0, False, STEERING))
    put(*said)
    printed = run("report", tmp_path).out
    assert r"x\nComplete: 4 of 4 runs\x1b[2J" in printed
    assert all(c.isprintable() or c == "\n" for c in printed)
    assert not any(line.startswith("Complete: 4 of 4 runs\\x1b") for line in printed.splitlines())
    text = repr(load_study(tmp_path))
    assert all(c.isprintable() or c == "\n" for c in text)


def test_a_report_that_fails_leaves_nothing(store, tmp_path, monkeypatch):
    (tmp_path / "study.sqlite").write_bytes((store / "study.sqlite").read_bytes())

    def fails(figure, *paths):
        paths[0].write_text("half")
        raise RuntimeError("no room")

    monkeypatch.setattr(write, "save", fails)
    with pytest.raises(RuntimeError, match="no room"):
        ended("report", tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["study.sqlite"]


def test_a_folder_that_holds_something_is_not_mixed_with(store, refused, tmp_path):
    (tmp_path / "mine.txt").write_text("")
    assert "is not empty" in refused("export", "ioh", store, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]
