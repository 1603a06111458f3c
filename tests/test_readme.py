"""What README, the guide and CONTRIBUTING say can be done, as they say it; what they show is there, nothing else is.

Of the pages in RUN every file is written, every command run, every output compared.
"""

import os
import re
import runpy
import shlex
import subprocess
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest
from pandas import read_csv

import armid
from armid.cli.main import app, main
from armid.record import read_campaign
from commands import python

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
IMAGE = re.compile(r"!\[[^\]]*\]\(([^)]+)\)")
LINK = re.compile(r"\]\(([^)#]+)\)")
PAGES = "studies/guide/pages"
TOUR, START = f"{PAGES}/tour.md", f"{PAGES}/getting_started.md"
CHOICE = f"{PAGES}/which_identifier.md"
RUN = (TOUR, START, CHOICE, f"{PAGES}/paper.md")
# The pages that .ci/run tries; the others are tried each night.
SHORT = (START,)
# Minutes and more.
LONG = ("studies/table1", "out/table1")
GUIDES = ("README.md", TOUR, START, f"{PAGES}/your_machine.md", f"{PAGES}/suite.md")
RESULTS = "results/README.md"
# Pages of which every link is followed, but for those to pages that the site makes from the code.
LINKED, UNWRITTEN = (*GUIDES, RESULTS, ".github/CONTRIBUTING.md"), ("src/armid/README.md", "reference/keys.md")
# What takes long, or data that are not ours to pass on.
LEFT_OUT = ("armid bench", "armid import", "out/campaigns", "out/table1", "studies/table1", "close-loop")
TEST_COMMAND = '.venv/bin/python -m pytest -q -n 2 -m "not slow and not browser"'
# Megabytes of results/, and lines of a page.
MOST_MB = 5.0
MOST_LINES = {"README.md": 160, "CHANGELOG.md": 60, ".github/CONTRIBUTING.md": 120, "studies/make_results.py": 160}
# Words of README outside tables and code.
MOST_WORDS = 900

# Of a number in an output, whose last digits are the processor's, and how near it has to come; speeds are left out.
NUMBER = re.compile(r"-?\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?")
NEAR, OF_SPEED = 0.01, "simulations/s"


@pytest.fixture(scope="module")
def readme(root):
    return (root / "README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def blocks(readme):
    """Language and text of each block of the README; the tour has a test of its own."""
    return FENCE.findall(readme)


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


def test_begins_with_two_commands_to_copy_and_is_short(blocks, root, readme):
    first, second = (text.strip().splitlines() for language, text in blocks[:2] if not language)
    assert len(first) == len(second) == 1
    assert "armid study studies/table1_short.toml" in first[0]
    assert second[0].endswith(f" && {TEST_COMMAND}")
    for line in (*first, *second):
        assert line.startswith("python3 -m venv .venv && .venv/bin/pip install -q -e ")
    words = shlex.split(first[0])
    assert (root / words[words.index("study") + 1]).is_file()
    prose = [line for line in FENCE.sub("", readme).splitlines() if not line.startswith("|")]
    assert len(LINK.sub("]", " ".join(prose)).split()) <= MOST_WORDS


def test_continuous_integration_runs_the_readme_s_test_command(blocks, root):
    script = (root / ".ci" / "run").read_text()
    pattern = re.search(r"grep -m 1 '([^']+)' README\.md", script).group(1)
    found = next(line for line in (root / "README.md").read_text().splitlines() if pattern in line)
    assert found == blocks[1][1].strip()
    assert '-m "(slow or browser) and not nightly"' in script
    assert "--fail-under=95" in (root / ".ci" / "nightly").read_text()
    assert all(os.access(root / ".ci" / name, os.X_OK) for name in ("run", "nightly"))


@pytest.mark.parametrize("page", GUIDES)
def test_every_option_exists_and_all_is_written_to_out(page, root):
    found = FENCE.findall((root / page).read_text(encoding="utf-8"))
    lines = [part for text in blocks_of(found, "") for line in text.splitlines() for part in line.split(" && ")]
    ours = [line[line.index("armid ") :] for line in lines if re.search(r"(^|/)armid ", line)]
    assert len(ours) >= 3
    for line in ours:
        words = shlex.split(line)[1:]
        command = app.get_command(None, words[0])
        command = command.commands[words[1]] if words[0] in ("import", "export") else command
        known = {name for parameter in command.params for name in parameter.opts}
        assert {word for word in words if word.startswith("--")} <= known, line
        places = [after for word, after in pairwise(words) if word == "--out"]
        assert all(place.split("/")[0] == "out" for place in places), line
        assert places or words[0] not in ("study", "new", "import", "close-loop", "simulate"), line


def test_the_commands_run_and_git_ignores_what_they_write(blocks, root, elsewhere, capsys):
    commands = [line for text in blocks_of(blocks, "") for line in text.splitlines()]
    ours = [line for line in commands if line.startswith("armid ") and not any(part in line for part in LEFT_OUT)]
    assert {line.split()[1] for line in ours} >= {"check", "identify"}
    for line in ours:
        assert ran(line + " --budget 160" * (" identify " in line), capsys)
    assert {path.name for path in elsewhere.iterdir()} == {"studies", "out"}
    assert "out/" in (root / ".gitignore").read_text().splitlines()


@pytest.mark.slow
def test_the_python_examples_run(blocks, elsewhere):
    for text in blocks_of(blocks, "python"):
        ran = python("-W", "error", "-c", text)
        assert ran.returncode == 0, ran.stderr
    assert re.match(r"\{'p0': .*'n': ", ran.stdout)


def test_files_that_pages_name_are_there_links_lead_somewhere_and_the_campaign_file_is_read(root, elsewhere):
    for page in {*LINKED, *MOST_LINES}:
        text = (root / page).read_text(encoding="utf-8")
        for name in re.findall(r"`((?:studies|results)/[a-z][\w/.]+)`", text) if page in GUIDES else ():
            assert (root / name).exists(), name
        for link in set(LINK.findall(text)) - set(UNWRITTEN) if page in LINKED else ():
            assert "//" in link or (root / page).parent.joinpath(link).resolve().exists(), (page, link)
        assert len(text.splitlines()) <= MOST_LINES.get(page, 10**6), page
    found = FENCE.findall((root / TOUR).read_text(encoding="utf-8"))
    text = next(text for text in blocks_of(found, "toml") if 'plant = "shell_transfer_arm"\n[[records]]' in text)
    assert tomllib.loads(text)["records"]
    (elsewhere / "campaign.toml").write_text(text)
    (elsewhere / "lower.csv").write_text((root / "studies/campaigns/paper_arm/lower.csv").read_text())
    assert [r.file for r in read_campaign(elsewhere).train] == ["lower.csv"]


def test_results_hold_what_is_read_are_small_and_every_figure_is_shown_and_has_a_recipe(root, recipes):
    files = committed(root, "results")
    assert {path.suffix for path in files} <= {".csv", ".md", ".json", ".png"}
    assert sum(path.stat().st_size for path in files) <= MOST_MB * 1e6
    folders = {path.relative_to(root / "results").parts[0] for path in files if path != root / RESULTS}
    assert folders <= set(recipes)
    assert folders == {link.split("/")[0] for link in LINK.findall((root / RESULTS).read_text()) if "." in link}
    figures = {path.resolve() for path in committed(root, "results") if path.suffix == ".png"}
    shown = {
        (root / page).parent.joinpath(name).resolve()
        for page in GUIDES
        for name in IMAGE.findall((root / page).read_text(encoding="utf-8"))
    }
    made = {root / "results" / name / f"{figure}.png" for name, recipe in recipes.items() for figure in recipe.figures}
    assert figures == shown == {path.resolve() for path in made}


def test_the_recipes_name_commands_that_exist(root, recipes):
    chosen = [recipes[name] for name in ("advised", "blind", "table1", "rocking_shell", "emps_identified")]
    for command in (c for recipe in chosen for c in (*(command for _, command in recipe.before), *recipe.commands)):
        program, first, *rest = shlex.split(command)
        if program == "python":
            assert (root / first).is_file()
            continue
        known = app.get_command(None, first)
        known = known.commands[rest[0]] if first == "export" else known
        assert {word for word in rest if word.startswith("--")} <= {n for p in known.params for n in p.opts}
        assert all(Path(root / word).exists() for word in rest if word.startswith("studies/") and "blind" not in word)


def shape(text):
    """Return the words of each line, numbers as #, without what only frames them; and the numbers."""
    lines = [(re.sub(r"[─━┃│┏┓┗┛┡┩└┘┳┻┴╇┌┐]", " ", NUMBER.sub("#", line)).split(), line) for line in text.splitlines()]
    return [(words, [] if OF_SPEED in line else [float(n.replace(",", "")) for n in NUMBER.findall(line)])
            for words, line in lines if words]  # fmt: skip


def is_part_of(shown, printed):
    """Tell whether the lines that are shown come one after the other in what was printed; `...` leaves some out."""
    left = iter(printed)
    return all(
        words == ["..."] or any(words == other and numbers == pytest.approx(known, rel=NEAR) for other, known in left)
        for words, numbers in shown
    )


def ran(line, capsys):
    """Run one line of a block; return what it printed."""
    if not line.startswith("armid "):
        return subprocess.run(line, shell=True, check=True, capture_output=True, text=True).stdout
    with pytest.raises(SystemExit) as left:
        main(shlex.split(line, comments=True)[1:])
    captured = capsys.readouterr()
    known = ("irregular sampling", "what is finished already is kept")
    errors = [text for text in captured.err.splitlines() if not any(words in text for words in known)]
    assert (left.value.code, errors) == (0, []), line
    return captured.out


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::armid.record.IrregularSamplingWarning")
@pytest.mark.parametrize("page", [p if p in SHORT else pytest.param(p, marks=pytest.mark.nightly) for p in RUN])
def test_every_snippet_runs_and_every_output_is_true(page, root, elsewhere, capsys):
    printed, seen = "", {"file": 0, "command": 0, "output": 0}
    for language, text in FENCE.findall((root / os.environ.get("ARMID_TOUR", page)).read_text(encoding="utf-8")):
        named = re.match(r"# (\S+)\n", text)
        if language == "python" and not named:
            done = python("-c", text)
            assert done.returncode == 0, done.stderr
            printed = done.stdout
        elif language == "toml" and not named:
            assert tomllib.loads(text), "lines to put into a file"
        elif language in ("python", "toml"):
            file = elsewhere / named[1]
            file.parent.mkdir(exist_ok=True)
            file.write_text(text, encoding="utf-8")
            seen["file"] += 1
        elif language == "text":
            assert is_part_of(shape(text), shape(printed)), f"shown:\n{text}\nprinted:\n{printed}"
            seen["output"] += 1
        else:
            lines = [line for line in text.splitlines() if line and not any(part in line for part in LONG)]
            printed = "".join(ran(line, capsys) for line in lines)
            seen["command"] += len(lines)
    assert min(seen.values()) >= 4 or page != TOUR, seen
    assert min(seen["command"], seen["output"]) >= 1, seen


def test_table_1_is_that_of_the_committed_csv(readme, root):
    """Mean and median of every row and parameter, to the digits that are shown."""
    of = read_csv(root / "results" / "table1" / "overview.csv")
    variants = {"the paper's": "the paper's pso", "velocity limit": "pso, literal limit, 12,000",
                "limit 0.2": "pso, limit 0.2, 12,000", "cmaes": "cmaes on rmse",
                "pso+least": "pso+least_squares"}  # fmt: skip
    rows = [line.split("|")[1:-1] for line in readme.partition("## Table I")[2].splitlines() if "%" in line][:5]
    for (start, variant), (name, _, *cells) in zip(variants.items(), rows, strict=True):
        assert start in name
        row = of[(of["variant"] == variant) & (of["setting"] != "0.3 deg/s")].iloc[0]
        for parameter, cell in zip(("p0", "k", "eta3", "n"), cells, strict=True):
            for shown, kind in zip(cell.replace("%", "").split("/"), ("mean", "median"), strict=True):
                digits = len(re.sub(r"e.*|\.", "", shown.strip()).lstrip("0"))
                value = 100.0 * row[f"{parameter}_{kind}"]
                assert float(shown) == pytest.approx(value, rel=10.0 ** (1 - digits)), (variant, parameter, kind)


def test_measured_machines_are_those_of_the_committed_table(readme, root):
    """Errors before and after, as studies/measured/run.py printed them."""
    lines = (root / "results" / "measured" / "table.md").read_text(encoding="utf-8").splitlines()[2:]
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    table = {name: (before, after) for name, _, _, before, after, *_ in cells}
    order = ("emps", "dfki", "dfki_without_ddp", "dfki_without_direct_collocation", "quarter_drone",
             "quanser_flexible_link", "bam_xl330", "cluj_bldc")  # fmt: skip
    assert set(order) == set(table)
    rows = [line.split("|")[2:4] for line in readme.partition("## Measured machines")[2].splitlines() if "|" in line]
    for name, row in zip(order, rows[2:], strict=True):
        for shown, wanted in zip(row, table[name], strict=True):
            assert [float(x) for x in shown.split(",")] == [float(x) for x in wanted.split()], name


def test_the_package_says_who_made_it_where_it_runs_and_its_workflows_call_ci(readme, root):
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (author,) = project["authors"]
    assert f"author = {{{{{author['name']}}}}}" in readme
    assert f"version = {{{project['version']}}}" in readme
    assert f"## {project['version']}" in (root / "CHANGELOG.md").read_text(encoding="utf-8")
    assert author["name"] in (root / "LICENSE").read_text(encoding="utf-8")
    assert "Operating System :: POSIX :: Linux" in project["classifiers"]
    assert "**Platforms.** Tested on Linux" in readme
    workflows = {path.name: path.read_text(encoding="utf-8") for path in (root / ".github/workflows").iterdir()}
    assert "- run: .ci/run\n" in workflows["tests.yml"]
    assert "- run: .ci/nightly\n" in workflows["nightly.yml"]
    assert "mkdocs build --strict -f studies/guide/mkdocs.yml" in workflows["site.yml"]
    assert "[test,notebook,suite,nested,docs,dev]" in (root / ".ci/run").read_text(encoding="utf-8")


def test_figures_behind_advice_are_those_of_the_results(root):
    """Every number in the last columns of a row stands in the report that the row names."""
    rows = re.findall(r"^\|.*\| `(results/\w+)` \|$", (root / CHOICE).read_text(encoding="utf-8"), re.MULTILINE)
    assert len(rows) >= 5
    for line in (root / CHOICE).read_text(encoding="utf-8").splitlines():
        source = re.search(r"\| `(results/\w+)` \|$", line)
        told = (root / source[1] / "report.md").read_text(encoding="utf-8") if source else ""
        for number in NUMBER.findall(" ".join(line.split("|")[3:5])) if source else ():
            assert re.search(rf"(?<![\d.]){re.escape(number)}(?![\d.]*\d)", told), (line, number)


@pytest.mark.slow
def test_the_site_builds_strictly(root, tmp_path):
    pytest.importorskip("mkdocstrings", reason="mkdocs is not installed: pip install -e '.[docs]'")
    words = ("build", "--strict", "-q", "-f", root / "studies/guide/mkdocs.yml", "-d", tmp_path / "site")
    done = python("-m", "mkdocs", *words, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})
    assert (done.returncode, done.stderr) == (0, "")
    keys, commands, names = ((tmp_path / "site/reference" / name / "index.html").read_text(encoding="utf-8")
                              for name in ("keys", "commands", "python"))  # fmt: skip
    assert all(f"<code>{name}</code>" in keys for name in ("windows_s", "restart_s", "supply_V", "rivals"))
    assert all(f"armid {' '.join(name)}" in commands for name in (("close-loop",), ("export", "ioh"), ("schema",)))
    assert all(name in names for name in armid.HOME)
    assert len(list((tmp_path / "site/results").rglob("*.png"))) >= 15
