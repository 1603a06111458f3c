"""Tables of a study: the overview, success rates, errors by identifier and case, fitnesses, closed loops."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from made_results import PAPER_CASES, MadeResults, made

from armid.report.files import markdown
from armid.study.analyses.analysis import Evidence
from armid.study.analyses.convergence import success
from armid.study.analyses.errors import (
    brief,
    end_points,
    error_map,
    error_map_figure,
    fitness_quality,
    fitness_quality_figure,
)
from armid.study.analyses.overview import loop_runs, main_table, reasons, runs_table
from armid.study.document import report_of, summary_of
from armid.study.results import load_study
from armid.study.runner import run_study
from armid.study.tasks import read_study
from armid.units import angles_in
from input_texts import TABLE_STUDY


def test_the_overview_begins_with_the_paper():
    evidence = Evidence(made(report="table1"))
    frame, estimates = main_table(evidence).frame, evidence.estimates
    assert frame.iloc[0]["variant"] == "the paper's pso"
    means = 100.0 * frame.iloc[0][["p0_mean", "k_mean", "eta3_mean", "n_mean"]].astype(float)
    assert means.round(3).tolist() == [0.487, 0.421, 0.171, 0.899]
    row = frame[(frame["variant"] == "pso") & (frame["setting"] == "noise-free")].iloc[0]
    own = estimates[(estimates["variant"] == "pso") & (estimates["setting"] == "noise-free")]
    assert row["n_median"] == own.loc[own["parameter"] == "n", "relative_error"].median()
    assert row["largest_worst"] == own["relative_error"].max()


def test_without_truths_there_are_medians_of_the_values_in_units_that_people_read():
    evidence = Evidence(made(seeds=2))
    evidence.parameters = evidence.parameters.assign(truth=np.nan)
    table = main_table(evidence)
    frame = table.frame.set_index(["setting", "variant", "parameter"])
    own = evidence.estimates.groupby(["setting", "variant", "parameter"])["value"].median()
    own[own.index.get_level_values("parameter") == "p0"] *= 1e-6
    assert frame["median"].to_dict() == own.to_dict()
    assert frame["unit"].groupby("parameter").first().to_dict() == {"p0": "MPa", "k": "1", "eta3": "1", "n": "1"}
    headers = [c.header for c in table.columns]
    shown = [row[headers.index("RMSE train [deg/s]")].text for row in table.cells()]
    assert shown[0] == f"{np.degrees(0.01):.4g}"


@pytest.mark.parametrize(("angle", "label", "factor"), [("deg", "deg/s", 180.0 / np.pi), ("rad", "rad/s", 1.0)])
def test_a_study_shows_its_fitness_in_the_unit_of_its_records(angle, label, factor):
    results = made(seeds=1, noises=(0.0,), fitness=("rmse",))
    results.parameters["truth"] = np.nan
    results.study |= {"angle": angle, "unit": "rad/s"}
    document = report_of(results)
    least = factor * results.runs.groupby("identifier")["value"].median().min()
    assert f"{least:.6g} of rmse [{label}]." in document.answer[0]
    with angles_in(document.angle):
        figure = next(f for f in document.figures if f.name == "convergence_fitness").draw()
    assert figure.axes[0].get_ylabel() == f"best fitness (rmse [{label}])"
    plt.close(figure)


def outcomes_with(errors):
    return pd.DataFrame({"setting": "noise-free", "variant": "pso", "largest_error": errors})


def test_success_at_the_tolerance_with_its_interval_and_runs_are_counted_with_their_failures():
    row = success(outcomes_with([1e-2, 0.0099, 0.02, np.inf, np.nan])).frame.iloc[0]
    assert (row["n"], row["within_1_percent_successes"], row["within_0.1_percent_successes"]) == (4, 2, 0)
    assert (row["within_1_percent_rate"], row["within_0.1_percent_rate"]) == (0.5, 0.0)
    table = success(outcomes_with([1e-5] * 8 + [1.0] * 2))
    # Wilson's interval of 8 of 10
    assert table.frame.loc[0, "within_1_percent_text"] == "80.0 (49.0 to 94.3)"
    evidence = Evidence(made(seeds=1, noises=(0.0,), failed=2))
    counts = runs_table(evidence.runs, evidence.parameters).frame.set_index("variant")
    assert counts["failed"].to_dict() == {"pso": 0, "cmaes": 1, "de+bobyqa": 1}
    found = reasons(evidence.runs).frame.groupby("reason")["n"].sum().to_dict()
    assert found == {"budget used": 13, "failed: it broke": 2}


def test_the_error_map_has_medians_in_the_orders_given_and_deviations_are_in_percent():
    evidence = Evidence(made(seeds=2))
    runs = evidence.of("noise-free")
    errors = error_map(runs, ["de+bobyqa", "pso", "unknown"], ["row 2", "row 1"])
    assert list(errors.index) == ["de+bobyqa", "pso"]
    assert list(errors.columns) == ["row 2", "row 1"]
    own = runs[(runs["variant"] == "pso") & (runs["case"] == "row 1")]
    assert errors.loc["pso", "row 1"] == np.median(own["largest_error"])
    figure = error_map_figure({"noise-free": errors})
    assert brief(100.0 * errors.loc["pso", "row 1"]) in {t.get_text() for t in figure.axes[0].texts}
    plt.close(figure)
    ends = end_points(evidence.estimates)
    assert list(ends.columns) == ["variant", "setting", "p0", "eta3", "n", "k"]
    rows = evidence.parameters
    first = rows[(rows["run"] == ends.index[0]) & (rows["parameter"] == "n")].iloc[0]
    assert ends.iloc[0]["n"] == pytest.approx(100.0 * (first["value"] / first["truth"] - 1.0))
    renamed = evidence.estimates.replace({"parameter": {"p0": "mass", "eta3": "coulomb.level"}})
    assert list(end_points(renamed).columns[2:]) == ["mass", "k", "coulomb.level", "n"]


def test_a_plug_in_has_the_first_colour_and_every_fitness_a_strip():
    found = made(seeds=2, fitness=("similarity", "likelihood"))
    found.study["plugins"] = ["mine.py:cmaes"]
    evidence = Evidence(found)
    assert all(name.startswith("cmaes") for name in list(evidence.colours)[:2])
    figure = fitness_quality_figure(evidence.runs, evidence.colours)
    axis = figure.axes[0]
    assert sorted(t.get_text() for t in axis.get_yticklabels()) == ["likelihood", "similarity"]
    done = evidence.runs[(evidence.runs["setting"] == axis.get_title()) & (evidence.runs["status"] == "done")]
    rows = np.concatenate([line.get_ydata() for line in axis.lines if line.get_linestyle() == "None"])
    assert [np.sum(np.abs(rows - k) < 0.4) for k in (0, 1)] == [len(done) // 2] * 2
    plt.close(figure)


def test_the_ranks_of_fitnesses_by_hand():
    runs = pd.DataFrame({
        "setting": "noise-free", "identifier": "pso", "status": "done", "fitness": ["similarity"] * 4 + ["rmse"] * 4,
        "train_s": [0.9, 0.99, 0.999, np.nan, 0.9, 0.99, 0.999, 0.9999],
        "largest_error": [3e-1, 2e-2, 1e-3, np.inf, 1e-3, 2e-3, 3e-3, 4e-3],
    })  # fmt: skip
    table = fitness_quality(runs).frame.set_index("fitness")
    # similarity: the better S the smaller the error; rmse: the other way round; a failed run is infinite
    assert table["correlation"].round(12).to_dict() == {"similarity": 1.0, "rmse": -1.0}
    assert table.loc["similarity", "median_error"] == (2e-2 + 3e-1) / 2
    assert table.loc["similarity", "worst_error"] == np.inf
    assert np.isclose(table.loc["similarity", "median_misfit"], 0.01)


def report(effects, after, holdout=0.03):
    error = {"before": {"holdout": {"rmse": holdout}}, "after": {"holdout": None if after is None else {"rmse": after}}}
    return {"plant": "shell_transfer_arm", "effects": effects, "noise_rms": 0.01, "error": error}


def test_closed_loops_have_a_row_each_and_a_report_that_counts_verdicts(tmp_path):
    loops = pd.DataFrame({
        "case": ["c0", "c1"], "verdict": ["explained", "no_discrepancy"], "cpu_seconds": [3.0, 0.5],
        "seconds": [4.0, 0.6], "report": [report(["tilt", "backlash"], 0.0101), report([], None)],
    })  # fmt: skip
    study = {
        "name": "loops", "question": "What is missing?", "kind": "close_loop", "report": "blind", "text": "x = 1",
        "campaigns": "campaigns/c", "made_by": "make them", "key": "key.json", "candidates": ["tilt"], "rivals": {},
        "versions": {"armid": "0"}, "n_planned": 3, "n_done": 2, "n_failed": 1,
    }  # fmt: skip
    closed = MadeResults(pd.DataFrame({"model": ["m", "m", None]}), pd.DataFrame(), study)
    closed.loops = loops
    rows = loop_runs(closed.loops)
    assert rows["effects"].tolist() == ["tilt + backlash", "nothing"]
    assert rows["before"].tolist() == pytest.approx([3.0, 3.0])
    assert rows["after"].tolist() == pytest.approx([1.01, np.nan], nan_ok=True)
    document = report_of(closed, tmp_path / "key.json", {"slow": lambda runs: runs[runs["cpu_seconds"] > 1]})
    assert document.answer == ("Of 2 campaigns: 1 explained, 1 no discrepancy.",
                               "Complete: 3 of 3 campaigns, 1 of them failed.")  # fmt: skip
    assert [t.name for t in document.tables] == ["verdicts", "campaigns", "own_slow"]
    assert len(document.tables[2].frame) == 1
    said = " ".join(document.facts)
    assert "python studies/blind/score.py" in said
    assert "no machine was measured" in said
    assert summary_of(closed).main[0].frame["n"].tolist() == [1, 1]
    failed = MadeResults(closed.runs, closed.parameters, closed.study | {"n_done": 0, "n_failed": 3})
    failed.loops = closed.loops[:0]
    assert report_of(failed).answer[0] == "No campaign was closed."


@pytest.mark.slow
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
    table = evidence.apart(main_table(evidence))
    return evidence, [c.header for c in table.columns if c.key.startswith("setting")], table.frame


def test_noise_window_and_budget_have_columns_of_their_own_as_far_as_they_differ():
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
