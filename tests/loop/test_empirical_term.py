"""Where no candidate will do: the missing signal is recovered, and a term without a name takes it up."""

import json
from dataclasses import replace

import numpy as np
import pytest
from few_candidates import CANDIDATES, COMMON, garbage

from armid.loop import close_loop, report_of
from armid.loop.document import conclusion, details_of
from armid.loop.figures import figures_of
from armid.model import Model
from armid.record import read_campaign
from armid.report.style import save

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def campaign(stand):
    """A spring that engages beyond an angle, which no candidate is."""
    return read_campaign(stand(*COMMON, "--effect", "cable_spring=300"))


@pytest.fixture(scope="module")
def found(campaign):
    return close_loop(Model(campaign.plant), campaign, CANDIDATES)


def test_the_signal_is_taken_up_by_a_curve_over_the_angle(found):
    assert found.effects[-1] == "unnamed:torque"
    assert found.missing is not None
    assert (found.term.dependence.port, found.term.dependence.variable) == ("torque", "theta")
    assert {s.port: s.share for s in found.missing.signals}["torque"] > 0.8
    assert found.after.holdout_error.rmse < 0.4 * found.before.holdout_error.rmse


def test_no_name_and_no_full_explanation_is_claimed(found):
    assert found.verdict == "partly_explained"
    assert [s.empirical for s in found.steps] == [False] * (len(found.steps) - 1) + [True]
    report = json.loads(json.dumps(report_of(found), allow_nan=False))
    assert report["effects"][-1] == "unnamed:torque"
    assert any(n.startswith("unnamed:torque.h") for n in report["parameters"]["after"])
    assert "no physical name" in conclusion(found)


def test_the_missing_signal_is_drawn(found, tmp_path):
    figures = figures_of(found, report_of(found), details_of(found))
    save(figures["missing"](), tmp_path / "missing.png")
    assert (tmp_path / "missing.png").stat().st_size > 10_000


def test_holdout_records_decide_nothing(found, campaign):
    rng = np.random.default_rng(1)
    records = tuple(r if r.role == "train" else garbage(r, rng) for r in campaign.records)
    again = close_loop(Model(campaign.plant), replace(campaign, records=records), CANDIDATES)
    assert again.effects == found.effects
    assert again.parameters == found.parameters
