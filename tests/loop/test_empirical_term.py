"""Where no candidate will do: the missing signal is recovered, and a term without a name takes it up."""

import json
from dataclasses import replace

import numpy as np
import pytest

from armid.loop import close_loop, report_of
from armid.loop.document import conclusion, details_of
from armid.loop.figures import figures_of
from armid.model import EFFECTS, Model
from armid.record import read_campaign
from armid.report.style import save

pytestmark = pytest.mark.slow
# Those of test_closing_the_loop.py: the same compiled models.
CANDIDATES = {n: EFFECTS[n] for n in ("coulomb", "seal_friction", "supply_sag", "tilt", "viscous")}
COMMON = (
    "--p0", "3.2e6", "--k", "0.9", "--eta3", "0.6", "--n", "1.2", "--repeats", "1", "--duration", "1.0",
    "--manoeuvres", "lower,raise,short,empty,lower_low_voltage", "--holdout", "lower_low_voltage",
)  # fmt: skip


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
    assert found.missing.signal_at("torque").share > 0.8
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


def garbage(record, rng):
    """Return a record of noise."""
    measured = rng.standard_normal(record.measured.shape)
    pieces = tuple(replace(p, measured=measured[p.start_index :][: len(p.measured)]) for p in record.pieces)
    return replace(record, measured=measured, rest=rng.standard_normal(record.rest.shape), pieces=pieces)
