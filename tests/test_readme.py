"""What the README says can be done, as it says it."""

import os
import re
import shlex
import subprocess
import sys
import tomllib

import pytest

from armid.cli.main import app, main
from armid.record import read_campaign

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
TOUR = re.compile(r"^## A tour in five steps\n.*?(?=^## |\Z)", re.MULTILINE | re.DOTALL)
# What takes long, or data that are not ours to pass on.
LEFT_OUT = ("armid bench", "armid import", "studies/campaigns/emps", "results/table1", "studies/table1", "close-loop")


@pytest.fixture(scope="module")
def readme(root):
    return (root / "README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def blocks(readme):
    """Language and text of each block; the tour has a test of its own."""
    return FENCE.findall(TOUR.sub("", readme))


@pytest.fixture(scope="module")
def commands(blocks):
    """Every line of a block without a language."""
    return [line for language, text in blocks if not language for line in text.splitlines() if line]


@pytest.fixture
def elsewhere(root, tmp_path, monkeypatch):
    """A working folder in which the repository's studies can be found."""
    (tmp_path / "studies").symlink_to(root / "studies")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def blocks_of(blocks, language):
    return [text for name, text in blocks if name == language]


def test_begins_with_two_commands_to_copy(blocks):
    first, second = (text.strip().splitlines() for language, text in blocks[:2] if not language)
    assert len(first) == len(second) == 1
    assert "armid study studies/table1_short.toml" in first[0]
    assert second[0].endswith("python -m pytest -q -n 2")
    for line in (*first, *second):
        assert line.startswith("python3 -m venv .venv && .venv/bin/pip install -q -e ")


def test_what_the_first_command_names_is_in_the_repository(blocks, root):
    words = shlex.split(blocks[0][1])
    assert (root / words[words.index("study") + 1]).is_file()


def test_continuous_integration_runs_the_readme_s_test_command(blocks, root):
    script = (root / ".ci" / "run").read_text()
    pattern = re.search(r"grep -m 1 '([^']+)' README\.md", script).group(1)
    found = next(line for line in (root / "README.md").read_text().splitlines() if pattern in line)
    assert found == blocks[1][1].strip()
    assert os.access(root / ".ci" / "run", os.X_OK)


def test_every_option_exists(commands):
    ours = [line[line.index("armid ") :] for line in commands if re.search(r"(^|/)armid ", line)]
    assert len(ours) >= 6
    for line in ours:
        words = shlex.split(line)[1:]
        command = app.commands[words[0]]
        command = command.commands[words[1]] if words[0] in ("import", "export") else command
        known = {name for parameter in command.params for name in parameter.opts}
        assert {word for word in words if word.startswith("--")} <= known, line


def test_the_commands_run(commands, blocks, elsewhere, capsys):
    (elsewhere / "mine.py").write_text(blocks_of(blocks, "python")[0])
    ours = [line for line in commands if line.startswith("armid ") and not any(part in line for part in LEFT_OUT)]
    assert {line.split()[1] for line in ours} >= {"simulate", "identify"}
    for line in ours:
        words = shlex.split(line)[1:] + ["--budget", "160"] * (" identify " in line)
        with pytest.raises(SystemExit) as left:
            main(words)
        captured = capsys.readouterr()
        assert (left.value.code, captured.err) == (0, ""), line
        assert captured.out


def test_the_python_examples_run(blocks, elsewhere):
    for text in blocks_of(blocks, "python"):
        ran = subprocess.run([sys.executable, "-W", "error", "-c", text], check=False, capture_output=True, text=True)
        assert ran.returncode == 0, ran.stderr
    assert re.match(r"\{'p0': .*'n': ", ran.stdout)


def test_the_campaign_file_is_read(blocks, elsewhere, root):
    text = blocks_of(blocks, "toml")[0]
    assert tomllib.loads(text)["records"]
    (elsewhere / "campaign.toml").write_text(text)
    (elsewhere / "lower.csv").write_text((root / "studies/campaigns/paper_arm/lower.csv").read_text())
    assert [r.file for r in read_campaign(elsewhere).train] == ["lower.csv"]


def test_files_that_it_names_are_there(readme, root):
    for name in re.findall(r"`(studies/[\w/.]+)`", readme):
        assert (root / name).exists(), name
