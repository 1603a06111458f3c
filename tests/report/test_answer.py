"""The answer of a study in words is that of its tables."""

import re
from dataclasses import replace

import numpy as np

from armid.study.document import report_of


def test_who_is_nearest_is_who_the_table_says(made):
    report = report_of(made(report="table1", seeds=3, noises=(0.0, 0.3)))
    table = report.main.frame
    for setting in ("noise-free", "0.3 deg/s"):
        own = table[table["setting"] == setting]
        best = own.loc[own["largest_median"].idxmin()]
        assert (
            f"{setting}: {best['variant']}, median largest error of a run {100 * best['largest_median']:.3g} %"
            in (report.answer[0])
        )
        assert f"within {100 * best['largest_p95']:.3g} %" in report.answer[0]
    paper = table[table["variant"] == "the paper's pso"].iloc[0]
    assert re.search(rf"has {100 * paper['largest_median']:.3g} %; \d of 3 identifiers", report.answer[1])


def test_without_the_paper_the_furthest_is_named(made):
    identifiers = {"near": 1e-6, "far": 1e-1}
    answer = report_of(made(seeds=2, noises=(0.0,), identifiers=identifiers)).answer
    assert answer[0].startswith("Nearest to the truth: noise-free: near, ")
    assert "Of 2 identifiers the furthest is far with" in answer[1]


def test_without_truths_the_fitness_decides(made):
    results = made(seeds=2)
    rows = results.parameters.assign(truth=np.nan, relative_error=np.nan)
    unknown = replace(results, parameters=rows)
    (sentence,) = report_of(unknown).answer
    medians = results.runs.groupby("identifier")["value"].median()
    assert sentence == (
        f"No truth is known. Lowest median fitness: {medians.idxmin()}, {medians.min():.6g} of similarity."
    )


def test_failed_runs_are_no_finite_error(made):
    assert report_of(made(seeds=1, noises=(0.0,), failed=15)).answer == ("No run has a result.",)
