"""What README, tour and CONTRIBUTING say can be done, as they say it; what they show is there, and nothing else is."""

import os
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

from armid.cli.main import app, main
from armid.record import read_campaign

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
IMAGE = re.compile(r"!\[[^\]]*\]\(([^)]+)\)")
LINK = re.compile(r"\]\(([^)#]+)\)")
TOUR = "studies/tour/README.md"
GUIDES = ("README.md", TOUR, "studies/your_own_machine/README.md")
# Pages of which every link is followed, but for those to pages that are still to be written.
LINKED, UNWRITTEN = (*GUIDES, ".github/CONTRIBUTING.md"), ("src/armid/README.md",)
# What takes long, or data that are not ours to pass on.
LEFT_OUT = ("armid bench", "armid import", "out/campaigns", "out/table1", "studies/table1", "close-loop")
TEST_COMMAND = '.venv/bin/python -m pytest -q -n 2 -m "not slow and not browser"'
# Megabytes of results/, and lines of a page.
MOST_MB, MOST_LINES = 5.0, {"README.md": 160, ".github/CONTRIBUTING.md": 120, "studies/make_results.py": 150}


@pytest.fixture(scope="module")
def readme(root):
    return (root / "README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def blocks(readme):
    """Language and text of each block of the README; the tour has a test of its own."""
    return FENCE.findall(readme)


@pytest.fixture(scope="module")
def commands(blocks):
    """Every line of a block without a language."""
    return [line for language, text in blocks if not language for line in text.splitlines() if line]


@pytest.fixture(scope="module")
def recipes(root):
    """The recipes of studies/make_results.py."""
    return runpy.run_path(str(root / "studies" / "make_results.py"))["RECIPES"]


@pytest.fixture
def elsewhere(root, tmp_path, monkeypatch):
    """A working folder in which the repository's studies can be found."""
    (tmp_path / "studies").symlink_to(root / "studies")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def blocks_of(blocks, language):
    return [text for name, text in blocks if name == language]


def committed(root, folder):
    """Return the files of a folder that git knows; all of it where there is no git."""
    listed = subprocess.run(["git", "ls-files", "-z", folder], check=False, capture_output=True, text=True, cwd=root)
    names = [name for name in listed.stdout.split("\0") if name]
    return [root / name for name in names] or [path for path in (root / folder).rglob("*") if path.is_file()]


def test_begins_with_two_commands_to_copy(blocks):
    first, second = (text.strip().splitlines() for language, text in blocks[:2] if not language)
    assert len(first) == len(second) == 1
    assert "armid study studies/table1_short.toml" in first[0]
    assert second[0].endswith(f" && {TEST_COMMAND}")
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
    assert '-m "slow or browser"' in script
    assert os.access(root / ".ci" / "run", os.X_OK)


@pytest.mark.parametrize("page", GUIDES)
def test_every_option_exists_and_all_is_written_to_out(page, root):
    found = FENCE.findall((root / page).read_text(encoding="utf-8"))
    lines = [part for text in blocks_of(found, "") for line in text.splitlines() for part in line.split(" && ")]
    ours = [line[line.index("armid ") :] for line in lines if re.search(r"(^|/)armid ", line)]
    assert len(ours) >= 3
    for line in ours:
        words = shlex.split(line)[1:]
        command = app.commands[words[0]]
        command = command.commands[words[1]] if words[0] in ("import", "export") else command
        known = {name for parameter in command.params for name in parameter.opts}
        assert {word for word in words if word.startswith("--")} <= known, line
        places = [after for word, after in pairwise(words) if word == "--out"]
        assert all(place.split("/")[0] == "out" for place in places), line
        assert places or words[0] not in ("study", "new", "import", "close-loop", "simulate"), line


def test_the_commands_run(commands, blocks, elsewhere, capsys):
    ours = [line for line in commands if line.startswith("armid ") and not any(part in line for part in LEFT_OUT)]
    assert {line.split()[1] for line in ours} >= {"check", "identify"}
    for line in ours:
        words = shlex.split(line)[1:] + ["--budget", "160"] * (" identify " in line)
        with pytest.raises(SystemExit) as left:
            main(words)
        captured = capsys.readouterr()
        assert (left.value.code, captured.err) == (0, ""), line
        assert captured.out
    assert {path.name for path in elsewhere.iterdir()} == {"studies", "out"}


def test_what_commands_write_is_ignored_by_git(root):
    assert "out/" in (root / ".gitignore").read_text().splitlines()


def test_the_python_examples_run(blocks, elsewhere):
    for text in blocks_of(blocks, "python"):
        ran = subprocess.run([sys.executable, "-W", "error", "-c", text], check=False, capture_output=True, text=True)
        assert ran.returncode == 0, ran.stderr
    assert re.match(r"\{'p0': .*'n': ", ran.stdout)


def test_the_campaign_file_is_read(elsewhere, root):
    found = FENCE.findall((root / TOUR).read_text(encoding="utf-8"))
    text = next(text for text in blocks_of(found, "toml") if 'plant = "shell_transfer_arm"\n[[records]]' in text)
    assert tomllib.loads(text)["records"]
    (elsewhere / "campaign.toml").write_text(text)
    (elsewhere / "lower.csv").write_text((root / "studies/campaigns/paper_arm/lower.csv").read_text())
    assert [r.file for r in read_campaign(elsewhere).train] == ["lower.csv"]


@pytest.mark.parametrize("page", GUIDES)
def test_files_that_it_names_are_there(page, root):
    text = (root / page).read_text(encoding="utf-8")
    for name in re.findall(r"`((?:studies|results)/[a-z][\w/.]+)`", text):
        assert (root / name).exists(), name


@pytest.mark.parametrize("page", LINKED)
def test_links_lead_somewhere(page, root):
    for link in set(LINK.findall((root / page).read_text(encoding="utf-8"))) - set(UNWRITTEN):
        assert "//" in link or (root / page).parent.joinpath(link).resolve().exists(), link


@pytest.mark.parametrize("page", sorted(MOST_LINES))
def test_pages_stay_short(page, root):
    assert len((root / page).read_text(encoding="utf-8").splitlines()) <= MOST_LINES[page]


def test_results_hold_what_is_read_and_are_small(root, recipes):
    files = committed(root, "results")
    assert {path.suffix for path in files} <= {".csv", ".md", ".json", ".png"}
    assert sum(path.stat().st_size for path in files) <= MOST_MB * 1e6
    assert {path.relative_to(root / "results").parts[0] for path in files} <= set(recipes)


def test_every_committed_figure_is_shown_and_has_a_recipe(root, recipes):
    figures = {path.resolve() for path in committed(root, "results") if path.suffix == ".png"}
    shown = {
        (root / page).parent.joinpath(name).resolve()
        for page in GUIDES
        for name in IMAGE.findall((root / page).read_text(encoding="utf-8"))
    }
    made = {root / "results" / name / f"{figure}.png" for name, recipe in recipes.items() for figure in recipe.figures}
    assert figures == shown == {path.resolve() for path in made}


def test_a_page_of_results_names_only_what_is_there(root):
    pages = [path for path in committed(root, "results") if path.suffix == ".md"]
    assert len(pages) > 10
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert all((page.parent / name).is_file() for name in IMAGE.findall(text)), page
        told = text.count(f"Made by `python studies/make_results.py {page.parent.name}`")
        assert told == (page.name == "report.md"), page


def test_a_page_loses_the_figures_that_are_not_kept(root):
    clean = runpy.run_path(str(root / "studies" / "make_results.py"))["page"]
    one, two = (f"### {name}\n\n![{name}]({name}.png)\n\nOf {name}.\n\n" for name in ("one", "two"))
    text = f"# s\n\nMade from the stored results by `armid report`.\n\n## A\n\n{one}{two}## B\n\n{two}## C\n\nEnd.\n"
    told = "Made by `python studies/make_results.py s`; figures and the page report.html are then in out/s."
    assert clean(text, "s", {"one.png"}) == f"# s\n\n{told}\n\n## A\n\n{one}## C\n\nEnd.\n"
    loop = "# s\n\n| a |\n\n## Figures\n\n![a.png](a.png)\n\n![b.png](b.png)\n"
    assert clean(loop, "s", {"b.png"}) == f"# s\n\n| a |\n\n## Figures\n\n![b.png](b.png)\n\n{told}\n"
    assert clean(loop, "s", set()) == f"# s\n\n| a |\n\n{told}\n"
    assert clean("# note\n\nWords.\n", "s", set()) == "# note\n\nWords.\n"


@pytest.mark.parametrize("name", ["advised", "blind", "table1", "rocking_shell", "emps_identified"])
def test_the_recipes_name_commands_that_exist(name, root, recipes):
    recipe = recipes[name]
    for command in (*(command for _, command in recipe.before), *recipe.commands):
        program, first, *rest = shlex.split(command)
        if program == "python":
            assert (root / first).is_file()
            continue
        known = app.commands[first].commands[rest[0]] if first == "export" else app.commands[first]
        assert {word for word in rest if word.startswith("--")} <= {n for p in known.params for n in p.opts}
        assert all(Path(root / word).exists() for word in rest if word.startswith("studies/") and "blind" not in word)
