"""How a program of the stand refuses, for all tests of it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., None]:
    """Return a function that calls a program of the stand: it has to refuse with one sentence and to write nothing."""
    (tmp_path / "file").write_text("mine")
    (tmp_path / "empty.toml").write_text("")
    (tmp_path / "wrong.toml").write_text("[suite]\ncontrols =")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))

    def refused(main: Callable[[list[str]], Any], words: list[str], sentence: str) -> None:
        assert main(words) == 2, words
        said = capsys.readouterr()
        assert sentence in said.err
        assert (said.err.count("\n"), said.out) == (1, "")
        assert sorted(tmp_path.rglob("*")) == before

    return refused
