"""Names under which runs are compared, and their largest error."""

import numpy as np
from armid.study.analyses.outcomes import outcomes


def test_a_label_on_one_fitness_keeps_its_name_and_on_several_tells_which(made):
    one, two = made(seeds=1), made(seeds=1, fitness=("rmse", "similarity"))
    assert set(outcomes(one.runs, one.parameters)["variant"]) == {"pso", "cmaes", "de+bobyqa"}
    assert "pso on rmse" in set(outcomes(two.runs, two.parameters)["variant"])


def test_settings(made):
    one, two = made(seeds=1), made(seeds=1, windows=("0-0.7 s", "whole"))
    assert set(outcomes(one.runs, one.parameters)["setting"]) == {"noise-free", "0.3 deg/s"}
    assert "0.3 deg/s, whole" in set(outcomes(two.runs, two.parameters)["setting"])
    unknown = one.runs.assign(noise_deg_s=np.nan)
    assert set(outcomes(unknown, one.parameters)["setting"]) == {"as recorded"}


def test_largest_error(made):
    results = made(seeds=1, failed=2)
    found = outcomes(results.runs, results.parameters)
    assert np.isinf(found["largest_error"].iloc[-2:]).all()
    own = results.parameters.loc[results.parameters["run"] == found.loc[0, "run"], "relative_error"]
    assert found.loc[0, "largest_error"] == own.max()


def test_only_known_truths_count(made):
    results = made(seeds=1)
    rows = results.parameters.copy()
    rows.loc[rows["parameter"] != "k", ["truth", "relative_error"]] = np.nan
    found = outcomes(results.runs, rows)
    of_k = rows.loc[rows["parameter"] == "k"].set_index("run")["relative_error"]
    assert found["largest_error"].tolist() == of_k.loc[found["run"]].tolist()
    assert outcomes(results.runs, rows.assign(relative_error=np.nan))["largest_error"].isna().all()
