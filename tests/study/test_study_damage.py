"""A store that was tampered with or damaged: one sentence, never a traceback."""

import shutil
import sqlite3
from pathlib import Path

import pytest

from armid.cli.main import main
from armid.study.results import StudyResults
from armid.study.store import FILE_NAME

DAMAGES = {
    "UPDATE study SET value = 'garbage' WHERE key = 'description'": "the description of the study cannot be read",
    "UPDATE study SET value = '[]' WHERE key = 'description'": "the description of the study lacks 'name'",
    "UPDATE study SET value = '{\"name\": \"small\"}' WHERE key = 'description'": "lacks 'cases'",
    "UPDATE traces SET trace = x'00112233'": "the trace of run",
    "UPDATE traces SET names = 'p0, k'": "the trace of run",
}


def refused(folder: Path, capsys) -> str:
    """Return the one sentence with which a report of a folder is refused."""
    with pytest.raises(SystemExit) as ended:
        main(["report", str(folder)])
    said = capsys.readouterr().err
    assert ended.value.code == 2, said
    assert said.count("\n") == 1
    return str(said)


@pytest.mark.parametrize("damage", DAMAGES)
def test_damage_is_one_sentence(damage: str, undisturbed: StudyResults, tmp_path: Path, capsys) -> None:
    folder = tmp_path / "out"
    shutil.copytree(undisturbed.path.parent, folder)
    connection = sqlite3.connect(folder / FILE_NAME)
    connection.execute(damage)
    connection.commit()
    connection.close()
    said = refused(folder, capsys)
    assert f"{folder / FILE_NAME} is damaged: " in said
    assert DAMAGES[damage] in said


def test_a_page_of_rubbish_is_one_sentence(undisturbed: StudyResults, tmp_path: Path, capsys) -> None:
    folder = tmp_path / "out"
    shutil.copytree(undisturbed.path.parent, folder)
    file = folder / FILE_NAME
    content = bytearray(file.read_bytes())
    content[4096 : len(content) // 2] = b"\xa5" * (len(content) // 2 - 4096)
    file.write_bytes(content)
    assert str(file) in refused(folder, capsys)
