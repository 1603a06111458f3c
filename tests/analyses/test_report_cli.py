"""`armid report` and `armid export ioh` on a small study that was really run."""

import hashlib
from pathlib import Path

import pandas as pd
import pytest

from armid.cli.main import main
from armid.report import files as write
from armid.study.results import load_study
from armid.study.runner import run_study

STUDY = """\
name = "tiny"
question = "Does a report come out of a real store?"
report = "table1"
plant = "shell_transfer_arm"
budget = 30
seeds = 2
fitness = "rmse"
windows_s = [[0.0, 0.3]]

[[identifiers]]
name = "pso"
options = { n_particles = 10 }

[[identifiers]]
name = "random"

[[cases]]
name = "row 1"
truth = { p0 = 3.20e6, k = 1.00, eta3 = 0.62, n = 1.00 }
published = { p0 = 3.2114e6, k = 1.0026, eta3 = 0.6213, n = 1.0124 }
manoeuvres = [{ start_angle_deg = -48.0, target_angle_deg = 22.0, shell = true, supply_V = 28.0, duration_s = 0.3 }]

[bounds]
p0 = [2.6e6, 3.5e6]
k = [0.6, 1.1]
eta3 = [0.45, 0.70]
n = [0.9, 1.5]
"""


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Folder of a study of four runs."""
    folder = tmp_path_factory.mktemp("tiny")
    (folder / "tiny.toml").write_text(STUDY, encoding="utf-8")
    run_study(folder / "tiny.toml", jobs=1, out=folder / "out")
    return folder / "out"


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def refused(arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert stopped.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


@pytest.fixture(scope="module")
def reported(store):
    """The folder with its report, and the digest that its store had before."""
    before = digest(store / "study.sqlite")
    with pytest.raises(SystemExit) as ended:
        main(["report", str(store)])
    assert ended.value.code == 0
    return store, before


def test_a_report_of_a_real_store(reported):
    store, before = reported
    assert digest(store / "study.sqlite") == before
    text = (store / "report.md").read_text()
    assert "Complete: 4 of 4 runs." in text
    assert "Versions: armid" in text
    assert {"overview.csv", "table1.png", "ecdf.svg", "runs.tex"} <= {p.name for p in store.iterdir()}
    page = (store / "report.html").read_text()
    assert page.count("<svg") == len(list(store.glob("*.svg")))
    for wanted in ("Does a report come out of a real store?", "Nearest to the truth: ", "Complete: 4 of 4 runs.",
                   "armid study tiny.toml", "d omega/dt", "name = &#34;tiny&#34;"):  # fmt: skip
        assert wanted in page


def test_its_numbers_are_those_of_the_store(reported):
    results = load_study(reported[0])
    overview = pd.read_csv(reported[0] / "overview.csv").set_index("variant")
    own = results.parameters.merge(results.runs[["run", "identifier"]], on="run")
    for (identifier, name), group in own.groupby(["identifier", "parameter"]):
        assert overview.loc[identifier, f"{name}_mean"] == pytest.approx(group["relative_error"].mean())
    assert pd.read_csv(reported[0] / "running_time.csv")["n"].tolist() == [2, 2]


def test_the_main_table_and_the_state_are_printed_and_a_users_analysis_is_a_section(
    store, tmp_path, capsys, monkeypatch
):
    (tmp_path / "study.sqlite").write_bytes((store / "study.sqlite").read_bytes())
    (tmp_path / "mine.py").write_text("def best(runs):\n    return runs.groupby('identifier')[['value']].min()\n")
    monkeypatch.setattr(write, "save", lambda figure, *paths: [p.write_text("<svg/>") for p in paths])
    with pytest.raises(SystemExit):
        main(["report", str(tmp_path), "--plugin", f"{tmp_path / 'mine.py'}:best"])
    printed = capsys.readouterr().out
    for wanted in ("the paper's pso", "random", "noise-free", "Complete: 4 of 4 runs.", "wrote report.md and "):
        assert wanted in printed
    best = pd.read_csv(tmp_path / "own_best.csv").set_index("identifier")["value"]
    assert best.to_dict() == load_study(store).runs.groupby("identifier")["value"].min().to_dict()
    assert "mine.py:best" in (tmp_path / "report.md").read_text()


def test_a_report_that_fails_leaves_nothing(store, tmp_path, monkeypatch):
    (tmp_path / "study.sqlite").write_bytes((store / "study.sqlite").read_bytes())

    def fails(figure, *paths):
        paths[0].write_text("half")
        raise RuntimeError("no room")

    monkeypatch.setattr(write, "save", fails)
    with pytest.raises(RuntimeError, match="no room"):
        main(["report", str(tmp_path)])
    assert [p.name for p in tmp_path.iterdir()] == ["study.sqlite"]


def test_no_store_is_refused_with_a_sentence(tmp_path, capsys):
    assert "holds no result: study.sqlite of `armid study`" in refused(["report", str(tmp_path)], capsys)


def test_export_of_a_real_store_loads(store, tmp_path, capsys):
    import iohinspector

    with pytest.raises(SystemExit) as ended:
        main(["export", "ioh", str(store), str(tmp_path / "ioh")])
    assert ended.value.code == 0
    assert "wrote 4 runs in 4 files" in capsys.readouterr().out
    manager = iohinspector.DataManager()
    manager.add_folder(str(tmp_path / "ioh"))
    rows = manager.load(monotonic=False, include_meta_data=True).to_pandas()
    values = load_study(store).runs.set_index(["identifier", "seed"])["value"]
    ends = rows.groupby(["algorithm_name", "instance"])["raw_y"].last()
    assert {key: ends[key] for key in ends.index} == {key: values[key] for key in values.index}
    assert rows.groupby("data_id")["evaluations"].agg(["first", "last"]).to_numpy().tolist() == [[1, 30]] * 4


def test_a_folder_that_holds_something_is_not_mixed_with(store, tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("")
    assert "is not empty" in refused(["export", "ioh", str(store), str(tmp_path)], capsys)
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]
