"""The table that answers a study's question."""

import numpy as np

from armid.study.analyses.analysis import Evidence
from armid.study.analyses.overview import main_table, reasons, runs_table


def test_the_overview_begins_with_the_paper(made):
    evidence = Evidence(made(report="table1"))
    frame, estimates = main_table(evidence).frame, evidence.estimates
    assert frame.iloc[0]["variant"] == "the paper's pso"
    means = 100.0 * frame.iloc[0][["p0_mean", "k_mean", "eta3_mean", "n_mean"]].astype(float)
    assert means.round(3).tolist() == [0.487, 0.421, 0.171, 0.899]
    row = frame[(frame["variant"] == "pso") & (frame["setting"] == "noise-free")].iloc[0]
    own = estimates[(estimates["variant"] == "pso") & (estimates["setting"] == "noise-free")]
    assert row["n_median"] == own.loc[own["parameter"] == "n", "relative_error"].median()
    assert row["largest_worst"] == own["relative_error"].max()


def test_without_truths_there_are_medians_of_the_values(made):
    evidence = Evidence(made(seeds=2))
    evidence.parameters = evidence.parameters.assign(truth=np.nan)
    frame = main_table(evidence).frame.set_index(["setting", "variant", "parameter"])
    own = evidence.estimates.groupby(["setting", "variant", "parameter"])["value"].median()
    assert frame["median"].to_dict() == own.to_dict()


def test_runs_are_counted_with_their_failures_and_reasons(made):
    evidence = Evidence(made(seeds=1, noises=(0.0,), failed=2))
    counts = runs_table(evidence.runs, evidence.parameters).frame.set_index("variant")
    assert counts["failed"].to_dict() == {"pso": 0, "cmaes": 1, "de+bobyqa": 1}
    found = reasons(evidence.runs).frame.groupby("reason")["n"].sum().to_dict()
    assert found == {"budget used": 13, "failed: it broke": 2}
