"""IOHprofiler files, loaded by iohinspector itself."""

import json
import warnings

import iohinspector
import numpy as np
import pytest
from made_results import made

from armid.study.export import WORST_VALUE, export_ioh, instance_numbers, lines
from armid.study.store import RunTrace


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ioh")
    results = made(seeds=3, failed=2)

    def path_of(name):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        return folder / name

    return folder, results, export_ioh(results, path_of)


def test_every_run_that_ended_well_is_there_and_every_improvement_comes_back_bit_for_bit(exported):
    manager = iohinspector.DataManager()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        manager.add_folder(str(exported[0]))
    _, results, n_runs = exported
    done = results.runs[results.runs["status"] == "done"]
    assert n_runs == manager.n_runs == len(done) == 88
    overview = manager.overview.to_pandas()
    assert set(overview["algorithm_name"]) == {"pso", "cmaes", "de+bobyqa"}
    assert overview["function_id"].nunique() == 10
    assert set(overview["dimension"]) == {4}
    assert set(overview["noise_deg_s"]) == {0.0, 0.3}
    named = overview.set_index(["algorithm_name", "function_name", "instance"]).sort_index()
    for run in done.sample(10, random_state=1).itertuples():
        noise = "noise-free" if run.noise_deg_s == 0 else "0.3 deg/s"
        found = named.loc[(run.identifier, f"{run.case}, {noise}, similarity", run.seed)]
        assert found["best_y"] == run.value
        assert found["evals"] == run.used
    rows = manager.load(monotonic=False, include_meta_data=True).to_pandas()
    trace = results.kept[3]
    run = results.runs.set_index("run").loc[trace.run]
    own = rows[(rows["algorithm_name"] == run["identifier"]) & (rows["instance"] == run["seed"])
               & rows["function_name"].str.startswith(f"{run['case']}, 0.3 deg/s")].iloc[:-1]  # fmt: skip
    assert own["evaluations"].tolist() == trace.evaluations.tolist()
    assert own["raw_y"].tolist() == trace.values.tolist()
    assert own[["x0", "x1", "x2", "x3"]].to_numpy().tolist() == trace.X.tolist()


def test_a_failed_first_candidate_and_an_early_end_are_logged_and_large_seeds_become_places(tmp_path):
    trace = RunTrace("r", np.array([3]), np.array([0.5]), np.array([[1.0]]), ("k",))
    assert list(lines(trace, 7)) == [f"1 {WORST_VALUE!r} nan\n", "3 0.5 1.0\n", "7 0.5 1.0\n"]
    assert list(lines(trace, 3)) == [f"1 {WORST_VALUE!r} nan\n", "3 0.5 1.0\n"]
    results = made(seeds=2)
    assert instance_numbers(results.runs) == {1: 1, 2: 2}
    assert instance_numbers(results.runs.assign(seed=results.runs["seed"] * 100_000)) == {100_000: 1, 200_000: 2}


def test_no_text_of_a_study_file_is_given_to_a_program_that_evaluates_it(exported):
    """iohinspector evaluates attributes as Python: numbers are all that may stand there."""
    for file in exported[0].rglob("*.json"):
        for attribute in json.loads(file.read_text())["experiment_attributes"]:
            assert all(float(value) >= 0.0 for value in attribute.values())
