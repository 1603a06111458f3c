"""Campaigns, studies and stored results come from anywhere: none runs code, none reads or writes elsewhere."""

import ast
import pickle
import sqlite3
import zlib
from contextlib import closing, suppress
from pathlib import Path
from shutil import copytree

import pytest

from commands import ended, not_drawn
from input_texts import LOWERING

ROOT = Path(__file__).parents[1] / "src" / "armid"
# Where code is made out of text, and whose text that is: the composed model's own, the user's --plugin.
MAKES_CODE = {"engine/compile.py", "registry.py"}
TEXT_RUNS, FILE_RUNS = {"eval", "exec", "compile", "__import__"}, {"exec_module", "spec_from_file_location"}
# Read with pickle: what the compiler wrote into a folder that nobody else may write, after its digest is checked; and
# what a worker, which runs the user's own code, sends through its pipe.
READS_PICKLES = {"engine/compile.py", "study/pool.py"}
UNPICKLES = {"pickle", "cPickle", "dill", "cloudpickle", "marshal", "shelve", "yaml"}
EVIL = "from pathlib import Path\nPath('touched').touch()\nthing = 1\n"
CAMPAIGN = f'name = "c"\nplant = "{{plant}}"\neffects = {{effects}}\n{LOWERING}'
STUDY = """\
name = "{name}"
plant = "{plant}"
budget = 40
seeds = 1
fitness = "{fitness}"
effects = {effects}
[[identifiers]]
name = "{identifier}"
options = {{ {option} }}
[[cases]]
name = "row"
truth = {{ p0 = 3.20e6, k = 1.00, eta3 = 0.62, n = 1.00 }}
manoeuvres = [{{ start_angle_deg = -48.0, target_angle_deg = 22.0, shell = true, supply_V = 28.0, duration_s = 0.3 }}]
"""
GOOD = {"name": "s", "plant": "shell_transfer_arm", "fitness": "rmse", "effects": "[]", "identifier": "random",
        "option": ""}  # fmt: skip
CODE = "evil.py:thing"


@pytest.fixture(autouse=True)
def evil(tmp_path, monkeypatch):
    """A working folder with a file that must not be run."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "evil.py").write_text(EVIL)
    yield
    assert not (tmp_path / "touched").exists()


def test_nothing_unpickles_and_nothing_runs_text():
    for path in ROOT.rglob("*.py"):
        nodes = [*ast.walk(ast.parse(path.read_text(encoding="utf-8")))]
        modules = {a.name.split(".")[0] for n in nodes if isinstance(n, ast.Import) for a in n.names}
        modules |= {str(n.module).split(".")[0] for n in nodes if isinstance(n, ast.ImportFrom)}
        assert not modules & UNPICKLES or path.relative_to(ROOT).as_posix() in READS_PICKLES, path
        calls = {ast.unparse(n.func) for n in nodes if isinstance(n, ast.Call)}
        made = {c for c in calls if c in TEXT_RUNS or c.rpartition(".")[2] in FILE_RUNS}
        assert not made or path.relative_to(ROOT).as_posix() in MAKES_CODE, (path, made)
        assert not {"np.load", "joblib.load", "pd.read_pickle"} & calls, path


def test_a_campaign_names_registered_things_only(tmp_path, refused):
    folder = tmp_path / "c"
    folder.mkdir()
    (folder / "lower.csv").write_text("time_s,angular_velocity_deg_s\n0,1\n")
    for key, value, more, says in (
        ("plant", CODE, "", f"plant '{CODE}' is unknown"),
        ("effects", f'["{CODE}"]', "", f"effect '{CODE}' is unknown"),
        ("effects", '["evil"]', "", "effect 'evil' is unknown"),
        ("effects", "[]", f'plugin = ["{CODE}"]\n', "key 'plugin' is unknown"),
    ):  # fmt: skip
        told = {"plant": "shell_transfer_arm", "effects": "[]"} | {key: value}
        (folder / "campaign.toml").write_text(more + CAMPAIGN.format(**told))
        assert says in refused("identify", folder)


def test_a_study_names_registered_things_only(tmp_path, refused):
    for key, value in (
        ("plant", CODE), ("effects", f'["{CODE}"]'), ("fitness", CODE), ("identifier", CODE),
        ("identifier", f"multistart:{CODE}"), ("identifier", f"random+{CODE}"), ("name", "../s"), ("name", "/tmp/s"),
        ("option", 'plugin = "evil.py:thing"'), ("option", "termination = 3"), ("option", "evaluator = 1"),
    ):  # fmt: skip
        (tmp_path / "s.toml").write_text(STUDY.format(**(GOOD | {key: value})))
        refused("study", "s.toml")
        assert sorted(p.name for p in tmp_path.iterdir()) == ["evil.py", "s.toml"]


class Touch:
    def __reduce__(self):
        return (Path.touch, (Path("touched"),))


def test_a_store_with_a_pickle_in_it_runs_nothing(table_study, tmp_path, monkeypatch):
    monkeypatch.setattr("armid.report.files.save", not_drawn)
    store = copytree(table_study / "out", tmp_path / "out") / "study.sqlite"
    written = store.read_bytes()
    for place in ("traces.trace", "runs.error", "study.value"):
        store.write_bytes(written)
        table, column = place.split(".")
        with closing(sqlite3.connect(store)) as connection:
            # as text where the column takes no bytes
            harm = pickle.dumps(Touch(), protocol=0)
            changed = connection.execute(
                f"UPDATE {table} SET {column} = ?", (harm.decode() if place != "traces.trace" else harm,)
            ).rowcount
            connection.commit()
        assert changed > 0, place
        # such a store was never written by armid: it may be refused anyhow, as long as nothing of it is run
        with suppress(zlib.error, ValueError):
            ended("report", "out")
        assert not (tmp_path / "touched").exists(), place
