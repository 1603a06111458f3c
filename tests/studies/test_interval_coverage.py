"""The study of how often intervals hold the truth: what it counts, and that it goes on where it was."""

import numpy as np
import pandas as pd
import pytest

import interval_coverage
from interval_coverage import FITNESSES, NORMAL_95, Machine, axis, coverage


def test_coverage_width_and_bias_are_those_of_the_intervals_that_are_given():
    rng, n, sd = np.random.default_rng(1), 4000, 0.5
    values = 3.0 + sd * rng.standard_normal(n)
    half = 1.2 * NORMAL_95 * sd
    rows = pd.DataFrame({"machine": "made", "fitness": "rmse", "parameter": "a", "noise": np.arange(n), "value": values,
                         "low": values - half, "high": values + half, "doubt": None})  # fmt: skip
    rows.loc[:999, "value"] = 100.0
    rows.loc[:999, "doubt"] = "the search has not come to the minimum of rmse"
    found = coverage(rows, Machine("made", {"a": 3.0}, None, {})).iloc[0]
    assert (found["intervals"], found["noises"]) == (3000, 4000)
    assert found["coverage"] == pytest.approx(98.1, abs=0.8)
    assert found["width"] == pytest.approx(1.2, rel=0.04)
    assert found["bias"] == pytest.approx(0.0, abs=0.06)


@pytest.mark.nightly
def test_two_noises_of_a_machine_and_its_twin(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(interval_coverage, "arm", lambda: axis()._replace(name="twin"))
    monkeypatch.setattr(interval_coverage, "FITNESSES", {name: FITNESSES[name] for name in ("rmse", "minimax")})
    words = ["interval_coverage.py", "--out", str(tmp_path), "--noises", "2"]
    monkeypatch.setattr("sys.argv", words)
    interval_coverage.main()
    stored = (tmp_path / "intervals.csv.gz").read_bytes()
    table = pd.read_csv(tmp_path / "coverage.csv")
    assert set(table["fitness"]) == {"rmse", "minimax"}
    assert (table["noises"] == 2).all()
    assert table["machine"].tolist() == ["twin"] * 6 + ["axis"] * 6
    assert (tmp_path / "report.md").read_text().count("\n| twin | rmse |") == 3
    interval_coverage.main()
    assert (tmp_path / "intervals.csv.gz").read_bytes() == stored
    assert "coverage" in capsys.readouterr().out
