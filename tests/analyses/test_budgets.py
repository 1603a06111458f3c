"""Several budgets of one study: each is run by itself, and noise, window and budget have columns of their own."""

from made_results import PAPER_CASES

from armid.report.files import markdown
from armid.study.analyses.analysis import Evidence
from armid.study.document import report_of
from armid.study.results import load_study
from armid.study.runner import run_study
from armid.study.tasks import read_study
from input_texts import TABLE_STUDY


def test_each_budget_is_run_by_itself(tmp_path):
    text = TABLE_STUDY.replace("seeds = 2", "seeds = 1")
    line = next(line for line in text.splitlines() if line.startswith("budget = "))
    (tmp_path / "tiny.toml").write_text(text.replace(line, "budget = [40, 90]"), encoding="utf-8")
    study = read_study(tmp_path / "tiny.toml")
    assert [entry.budgets(4) for entry in study.entries] == [[40, 90]] * len(study.entries)
    run_study(tmp_path / "tiny.toml", jobs=1, out=tmp_path / "out")
    runs = load_study(tmp_path / "out").runs
    assert (runs["used"] <= runs["budget"]).all()
    assert runs.groupby("identifier")["budget"].apply(sorted).map(tuple).unique().tolist() == [(40, 90)]
    text = markdown(report_of(load_study(tmp_path / "out")))
    assert "| budget |" in text.replace("**", "")
    assert ", 40 simulations: " in text


def columns_of(results):
    evidence = Evidence(results)
    table = next(t for t in report_of(results).tables if t.name == "overview")
    return evidence, [c.header for c in table.columns if c.key.startswith("setting")], table.frame


def test_noise_window_and_budget_have_columns_of_their_own_as_far_as_they_differ(made):
    results = made(cases=PAPER_CASES[:2], noises=(0.0, 0.3), windows=("0-0.7 s", "whole"), seeds=2)
    _, headers, frame = columns_of(results)
    assert headers == ["noise", "window"]
    assert set(frame["setting_noise"]) == {"noise-free", "0.3 deg/s"}
    assert set(frame["setting_window"]) == {"0-0.7 s", "whole"}
    results.runs["budget"] = results.runs["seed"].map(lambda seed: 500 if seed < 2 else 3000)
    evidence, headers, frame = columns_of(results)
    assert headers == ["noise", "window", "budget"]
    assert evidence.settings[:2] == ["noise-free, 0-0.7 s, 500 simulations", "noise-free, 0-0.7 s, 3,000 simulations"]
    assert set(frame["setting_budget"]) == {"500", "3,000"}
    assert columns_of(made(noises=(0.0,), seeds=2))[1] == ["noise"]
    # the paper has no setting
    _, _, frame = columns_of(made(report="table1", noises=(0.0, 0.3), seeds=2))
    assert frame.loc[frame["variant"] == "the paper's pso", "setting_noise"].tolist() == [""]
