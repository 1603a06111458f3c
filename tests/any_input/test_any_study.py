"""A study's TOML of any values, or any text: a study or one sentence, and nothing is run for it."""

import shutil
import tempfile
import tomllib
from pathlib import Path

from hypothesis import example, given
from hypothesis import strategies as st
from reading_whatever import edited, edits, many, mutated, outcome, toml_of

from armid.study.tasks import Study, read_study

FROZEN = Path(__file__).parents[1] / "frozen"
STUDY = (FROZEN / "study.toml").read_text(encoding="utf-8")
TABLE = tomllib.loads(STUDY)


def study_of(content: bytes) -> bool:
    """Read a study of these bytes beside campaigns; tell whether it was one."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(FROZEN / "campaigns", folder / "campaigns")
        (folder / "study.toml").write_bytes(content)
        return outcome(lambda: checked(folder / "study.toml")) is not None


def checked(file: Path) -> Study:
    study = read_study(file)
    assert study.description()["name"] == study.name
    assert next(iter(study.plan())).run
    return study


def test_the_original_is_a_study():
    assert study_of(STUDY.encode())
    assert study_of(toml_of(TABLE))


@many(80)
@given(mutated(TABLE))
def test_any_value(table):
    study_of(toml_of(table))


@many(60)
@given(edits)
def test_edited_text(changes):
    study_of(edited(STUDY, changes))


@many(40)
@given(st.binary(max_size=200))
@example(b"\xef\xbb\xbf")
def test_any_bytes_for_a_study(content):
    study_of(content)
