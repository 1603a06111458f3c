"""The tour, step by step: every file that it shows is written, every command run, every output compared."""

import os
import re
import shlex
import subprocess

import pytest

from armid.cli.main import main

TOUR = "studies/tour/README.md"
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
# Of a number in an output, whose last digits are the processor's.
NUMBER = re.compile(r"-?\d[\d,]*(\.\d+)?(e[+-]?\d+)?")
STEPS = ("Table I", "fitness", "effect", "identifier", "machine")


@pytest.fixture(scope="module")
def tour(root):
    """The tour's text, or that of the draft that ARMID_TOUR names."""
    return (root / os.environ.get("ARMID_TOUR", TOUR)).read_text(encoding="utf-8")


@pytest.fixture
def elsewhere(root, tmp_path, monkeypatch):
    """A working folder in which the repository's studies can be found."""
    (tmp_path / "studies").symlink_to(root / "studies")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def shape(text):
    """Return the words of each line, numbers as #, without what only frames them."""
    lines = (re.sub(r"[─━┃│┏┓┗┛┡┩└┘┳┻┴╇┌┐]", " ", NUMBER.sub("#", line)).split() for line in text.splitlines())
    return [line for line in lines if line]


def is_part_of(shown, printed):
    """Tell whether the lines that are shown come one after the other in what was printed; `...` leaves some out."""
    left = iter(printed)
    return all(line == ["..."] or line in left for line in shown)


def ran(line, capsys):
    """Run one line of a block; return what it printed."""
    if not line.startswith("armid "):
        return subprocess.run(line, shell=True, check=True, capture_output=True, text=True).stdout
    with pytest.raises(SystemExit) as left:
        main(shlex.split(line, comments=True)[1:])
    captured = capsys.readouterr()
    errors = [text for text in captured.err.splitlines() if "irregular sampling" not in text]
    assert (left.value.code, errors) == (0, []), line
    return captured.out


def test_there_are_five_steps(tour):
    headings = re.findall(r"^## \d\. (.*)$", tour, re.MULTILINE)
    assert len(headings) == len(STEPS)
    for word, heading in zip(STEPS, headings, strict=True):
        assert word in heading


@pytest.mark.filterwarnings("ignore::armid.record.IrregularSamplingWarning")
def test_every_snippet_runs_and_every_output_is_true(tour, elsewhere, capsys):
    printed, seen = "", {"file": 0, "command": 0, "output": 0}
    for language, text in FENCE.findall(tour):
        if language in ("python", "toml"):
            file = elsewhere / re.match(r"# (\S+)\n", text)[1]
            file.parent.mkdir(exist_ok=True)
            file.write_text(text, encoding="utf-8")
            seen["file"] += 1
        elif language == "text":
            assert is_part_of(shape(text), shape(printed)), f"shown:\n{text}\nprinted:\n{printed}"
            seen["output"] += 1
        else:
            printed = "".join(ran(line, capsys) for line in text.splitlines() if line)
            seen["command"] += len(text.splitlines())
    assert min(seen.values()) >= len(STEPS) - 1, seen


def test_the_sizes_that_it_promises(tour):
    files = {re.match(r"# (\S+)\n", text)[1]: text for language, text in FENCE.findall(tour) if language == "python"}
    lines = sorted(len(text.strip().splitlines()) for text in files.values())
    assert lines[0] <= lines[1] <= 10
    assert lines[-1] <= 20
