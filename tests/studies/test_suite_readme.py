"""What the guide of the suite and the notebook of the tour show runs as it stands, with the real libraries."""

import json
import os
import re

import pytest

from armid.study.tasks import read_study
from commands import python

# Letters of the notebook after a run, and as it is committed, its figures with few colours.
MOST_LETTERS, MOST_COMMITTED = 1_000_000, 150_000
PACKAGES = ("cma", "scipy", "nevergrad", "optuna", "ioh", "pymoo")


@pytest.fixture(scope="module")
def blocks(root):
    text = (root / "studies" / "guide" / "pages" / "suite.md").read_text(encoding="utf-8")
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)


def test_the_guide_has_an_example_of_every_library_in_about_ten_lines(blocks):
    for package in PACKAGES:
        (found,) = [b for b in blocks if re.search(rf"import.*\b{package}\b|from {package}\b", b) and "armid" in b]
        assert len([line for line in found.splitlines() if line.strip()]) <= 12


@pytest.mark.nightly
@pytest.mark.parametrize("package", PACKAGES)
def test_examples_run(package, blocks, tmp_path):
    pytest.importorskip(package)
    (found,) = [b for b in blocks if re.search(rf"import.*\b{package}\b|from {package}\b", b) and "armid" in b]
    done = python("-c", found, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


@pytest.mark.nightly
def test_a_foreign_optimiser_is_compared_by_one_command(blocks, root, tmp_path):
    (mine,) = [b for b in blocks if b.startswith("# mine.py")]
    (tmp_path / "mine.py").write_text(mine, encoding="utf-8")
    study = (root / "studies" / "suite" / "yours.toml").read_text(encoding="utf-8")
    short = re.sub(r"problems = .*", 'problems = ["arm", "arm_shape"]', study).replace("[10, 100]", "[10]")
    (tmp_path / "yours.toml").write_text(short, encoding="utf-8")
    words = ("study", "yours.toml", "--plugin", "mine.py:mine", "--out", "out")
    done = python("-m", "armid", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "The paper's swarm (pso) is number" in done.stdout
    assert "mine" in done.stdout


@pytest.mark.parametrize("name", ["suite", "long"])
def test_the_studies_can_be_planned(name, root):
    """Where the packages are missing, the study says so."""
    for package in ("minionpy", "nevergrad", "optuna"):
        pytest.importorskip(package)
    study = read_study(root / "studies" / "suite" / f"{name}.toml")
    assert len({run.run for run in study.plan()}) == len(list(study.plan())) > 1000


def last_errors(cell):
    """Return the numbers that a cell has printed before a percent sign."""
    text = "".join(output.get("text", "") for output in cell.outputs)
    return [float(number) for number in re.findall(r"([\d.]+)%", text)]


@pytest.mark.nightly
@pytest.mark.filterwarnings("default")
def test_the_notebook_runs(root, tmp_path):
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed: pip install -e '.[notebook]'")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed: pip install -e '.[notebook]'")
    import nbformat

    notebook = nbformat.read(root / "studies" / "guide" / "tour.ipynb", as_version=4)
    committed = [last_errors(cell) for cell in notebook.cells if cell.cell_type == "code"][-1]
    assert len(json.dumps(notebook)) < MOST_COMMITTED
    os.environ.setdefault("PYTHONPATH", str(root / "src"))
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(root)}}).execute()
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    shown = [kind for cell in code for output in cell.outputs for kind in output.get("data", {})]
    assert shown.count("text/html") >= 5
    assert shown.count("image/png") >= 3
    assert len(json.dumps(notebook)) < MOST_LETTERS
    assert len(committed) == 3
    assert last_errors(code[-1]) == pytest.approx(committed, rel=0.01)
    closed = "".join(output.data["text/html"] for cell in code for output in cell.outputs if "data" in output
                     and "Explained" in output.data.get("text/html", ""))  # fmt: skip
    assert "shell_rocking" in closed
