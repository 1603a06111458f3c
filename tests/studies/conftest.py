"""How a program of the stand refuses, for all tests of it."""

import pytest


@pytest.fixture
def refuses(tmp_path, monkeypatch, capsys):
    """Return a function that calls a program of the stand: it has to refuse with one sentence and to write nothing."""
    (tmp_path / "file").write_text("mine")
    (tmp_path / "empty.toml").write_text("")
    (tmp_path / "wrong.toml").write_text("[suite]\ncontrols =")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))

    def refused(main, words, sentence):
        assert main(words) == 2, words
        said = capsys.readouterr()
        assert sentence in said.err
        assert (said.err.count("\n"), said.out) == (1, "")
        assert sorted(tmp_path.rglob("*")) == before

    return refused
