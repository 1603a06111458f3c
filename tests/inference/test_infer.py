"""What the inference says of machines whose truth is known: synthetic records of the independent test stand."""

from dataclasses import replace

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.inference import infer, prepared
from armid.inference.decisions import calibration
from armid.model import EFFECTS, Model
from armid.record import read_campaign

# coulomb and seal_friction leave the very same trace
CANDIDATES = {n: EFFECTS[n] for n in ("coulomb", "seal_friction", "supply_sag", "tilt", "viscous")}
TRUTH = {"p0": 3.2e6, "k": 0.9, "eta3": 0.6, "n": 1.2}
COMMON = ("--p0", "3.2e6", "--k", "0.9", "--eta3", "0.6", "--n", "1.2", "--repeats", "1", "--duration", "1.0",
          "--manoeuvres", "lower,raise,short,empty,lower_low_voltage", "--holdout", "lower_low_voltage")  # fmt: skip

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def inferred(stand):
    """Return a function that infers what a campaign with some effects lacks; each is done once."""
    known = {}

    def run(*effects, hidden=(), changed=lambda c: c, **more):
        key = (effects, hidden, changed.__name__, repr(more))
        if key not in known:
            campaign = read_campaign(stand(*COMMON, *(("--effect", *effects) if effects else ())))
            campaign = changed(replace(campaign, tolerances={}))
            candidates = {n: e for n, e in CANDIDATES.items() if n not in hidden}
            known[key] = infer(*prepared(Model(campaign.plant), campaign, candidates, **more))
        return known[key]

    return run


def inside(found):
    """Tell of each parameter whether its interval, made wider by half, holds the truth: one in 300 does not."""
    each = ((found.intervals[n], value) for n, value in TRUTH.items())
    return [abs(value - 0.5 * (i.low + i.high)) < 0.75 * (i.high - i.low) for i, value in each]


def test_nothing_is_probable_where_nothing_is_missing(inferred):
    found = inferred()
    assert found.probabilities["nothing"] > 0.8
    assert all(p < 0.1 for p in found.probabilities["effects"].values())
    assert all(inside(found))


def test_a_missing_effect_is_named_and_the_intervals_hold(inferred):
    found = inferred("supply_sag=0.010")
    assert found.probabilities["effects"]["supply_sag"] > 0.9
    assert found.probabilities["nothing"] < 1e-6
    assert all(inside(found))


def test_twins_share_the_probability(inferred):
    """A swap partner that was never fitted would make a posterior that is sure of the wrong one."""
    chances = inferred("coulomb=60").probabilities["effects"]
    assert chances["coulomb"] + chances["seal_friction"] > 0.9
    odds = calibration().odds["coulomb"]
    assert 0.2 * odds < chances["coulomb"] / chances["seal_friction"] < 5.0 * odds


def test_two_effects_are_found_together(inferred):
    found = inferred("coulomb=60", "tilt_deg=2")
    chances = found.probabilities["effects"]
    assert chances["tilt"] > 0.9
    assert sum(chances.get(twin, 0.0) for twin in ("coulomb", "seal_friction")) > 0.9
    assert all(inside(found))


def test_the_true_effect_taken_out_leaves_something_unknown(inferred):
    found = inferred("supply_sag=0.010", hidden=("supply_sag",))
    assert found.probabilities["unknown"] > 0.5
    assert all(p < 0.5 for p in found.probabilities["effects"].values())


def late(campaign):
    """Return the campaign with one record that starts 4 ms late."""
    records = {r.file: r for r in campaign.records}
    record = records["short.csv"]
    shift = round(0.004 / record.manoeuvre.interval)
    measured = np.concatenate([record.rest[-shift:], record.measured[:-shift]])
    records["short.csv"] = record.with_measured({record.output: measured})
    return replace(campaign, records=tuple(records.values()))


def test_a_late_record_is_named_and_no_effect(inferred):
    chances = inferred(changed=late).probabilities
    assert chances["records"]["late@short.csv"] > 0.9
    assert all(p < 0.1 for p in chances["effects"].values())


def test_what_the_user_knows_counts(inferred):
    plain, sure = (inferred(priors=p).probabilities["effects"].get("tilt", 0.0) for p in ({}, {"tilt": 0.5}))
    assert sure > 3.0 * plain


def test_constants_in_tolerances_widen_the_intervals_and_may_be_off(stand, inferred):
    campaign = read_campaign(stand(*COMMON))
    campaign = replace(campaign, tolerances=dict.fromkeys(("R", "C_T", "eta1"), 0.03))
    found = infer(*prepared(Model(campaign.plant), campaign, CANDIDATES))
    exact = inferred()
    widths = [[f.intervals[n].high - f.intervals[n].low for n in TRUTH] for f in (exact, found)]
    assert sum(np.array(widths[1]) > np.array(widths[0])) >= 3
    assert found.probabilities["constants"]
    assert all(inside(found))


def test_a_prior_of_an_unknown_effect_is_refused(inferred):
    with pytest.raises(ArmidError, match="tild"):
        inferred(priors={"tild": 0.5})


def test_what_held_out_records_miss_may_be_their_own_fault_or_something_unknown(inferred):
    found = inferred("supply_sag=0.03")
    one, every = (found.after_holdout(over).posterior for over in ([True, False, False], [True, True, True]))
    before = found.posterior
    assert before.probability("unknown") < 0.01 < one.probability("unknown") < 0.5
    assert every.probability("unknown") > 0.95
    for after in (one, every):
        share = (1.0 - after.probability("unknown")) / (1.0 - before.probability("unknown"))
        name = after.probability("effect", "supply_sag")
        assert name == pytest.approx(share * before.probability("effect", "supply_sag"))
    assert found.after_holdout([True]).in_force == found.in_force
