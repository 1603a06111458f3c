"""The report of a study that closes the loop: verdicts and campaigns, no truth."""

import numpy as np
import pandas as pd
import pytest

from armid.study.analyses.loops import loop_runs
from armid.study.document import report_of, summary_of
from conftest import MadeResults


def report(effects, after, holdout=0.03):
    error = {"before": {"holdout": {"rmse": holdout}}, "after": {"holdout": None if after is None else {"rmse": after}}}
    return {"plant": "shell_transfer_arm", "effects": effects, "noise_rms": 0.01, "error": error}


@pytest.fixture(scope="module")
def closed():
    """Results of three campaigns, one of which failed."""
    loops = pd.DataFrame({
        "case": ["c0", "c1"], "verdict": ["explained", "no_discrepancy"], "cpu_seconds": [3.0, 0.5],
        "seconds": [4.0, 0.6], "report": [report(["tilt", "backlash"], 0.0101), report([], None)],
    })  # fmt: skip
    study = {
        "name": "loops", "question": "What is missing?", "kind": "close_loop", "report": "blind", "text": "x = 1",
        "campaigns": "campaigns/c", "made_by": "make them", "key": "key.json", "candidates": ["tilt"], "rivals": {},
        "versions": {"armid": "0"}, "n_planned": 3, "n_done": 2, "n_failed": 1,
    }  # fmt: skip
    results = MadeResults(pd.DataFrame({"model": ["m", "m", None]}), pd.DataFrame(), study)
    results.loops = loops
    return results


def test_each_campaign_has_a_row_with_its_errors_over_the_noise(closed):
    rows = loop_runs(closed.loops)
    assert rows["effects"].tolist() == ["tilt + backlash", "nothing"]
    assert rows["before"].tolist() == pytest.approx([3.0, 3.0])
    assert rows["after"].tolist() == pytest.approx([1.01, np.nan], nan_ok=True)


def test_the_report_counts_verdicts_and_says_what_scores_them(closed, tmp_path):
    document = report_of(closed, tmp_path / "key.json", {"slow": lambda runs: runs[runs["cpu_seconds"] > 1]})
    assert document.answer == ("Of 2 campaigns: 1 explained, 1 no discrepancy.",
                               "Complete: 3 of 3 campaigns, 1 of them failed.")  # fmt: skip
    assert [t.name for t in document.tables] == ["verdicts", "campaigns", "own_slow"]
    assert len(document.tables[2].frame) == 1
    said = " ".join(document.facts)
    assert "python studies/blind/score.py" in said
    assert "no machine was measured" in said
    assert summary_of(closed).main[0].frame["n"].tolist() == [1, 1]


def test_campaigns_that_all_failed_are_no_finding(closed):
    failed = MadeResults(closed.runs, closed.parameters, closed.study | {"n_done": 0, "n_failed": 3})
    failed.loops = closed.loops[:0]
    assert report_of(failed).answer[0] == "No campaign was closed."
