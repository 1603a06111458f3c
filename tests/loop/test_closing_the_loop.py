"""The loop on records of the independent test stand: it names what was put in, and nothing where nothing was."""

from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
from few_candidates import CANDIDATES, COMMON, TRUTH, garbage

import armid
from armid.errors import ArmidError
from armid.estimation.constants import moved_record
from armid.estimation.corrections import DataIssue
from armid.inference import prepared
from armid.inference.decisions import calibration
from armid.loop import close_loop, report_of
from armid.loop.document import conclusion, declared_by, details_of, loop_document
from armid.model import EFFECTS, Model
from armid.record import read_campaign
from armid.record.campaign import tolerances_of

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def closed(stand):
    """Return a function that closes the loop on a campaign with some effects; each is done once."""
    known = {}

    def run(*effects):
        if effects not in known:
            campaign = read_campaign(stand(*COMMON, *(("--effect", *effects) if effects else ())))
            known[effects] = close_loop(Model(campaign.plant), campaign, CANDIDATES)
        return known[effects]

    return run


def off_by(found):
    """Return by how many half-widths of its interval each parameter of the arm is off."""
    own = [e for e in found.after.estimates if e.name in TRUTH]
    return [abs(TRUTH[e.name] - 0.5 * (e.low + e.high)) / (0.5 * (e.high - e.low)) for e in own]


def fits_of(found):
    """Return what each model leaves, by the names of its hypotheses."""
    return {tuple(sorted(model)): fit.chi2 for model, fit in found.inference.exploration.fits.items()}


def test_control_is_left_alone(closed):
    found = closed()
    assert (found.verdict, found.also) == ("no_discrepancy", ())
    report = report_of(found)
    assert report["effects"] == report["steps"] == report["advice"] == report["suspects"] == report["next_steps"] == []
    assert report["error"]["before"] == report["error"]["after"]
    assert report["parameters"]["before"] == report["parameters"]["after"]
    assert report["probabilities"]["nothing"] > 0.8
    assert max(off_by(found)) < 1.5
    assert all(e.trusted for e in found.after.estimates)


def test_missing_effect_is_named_and_the_parameters_come_right(closed):
    found = closed("supply_sag=0.010")
    assert found.effects == ("supply_sag",)
    assert (found.verdict, found.also) == ("explained", ())
    assert found.before.holdout.errors.chi2_per_sample > 2.0
    assert found.after.holdout.errors.chi2_per_sample < 1.1
    for name, value in TRUTH.items():
        assert found.parameters[name] == pytest.approx(value, rel=0.01)
    assert max(off_by(found)) < 1.5
    assert found.parameters["supply_sag.resistance"] == pytest.approx(0.010, rel=0.05)
    assert not any(e.trusted for e in found.before.estimates)
    assert all(e.trusted for e in found.after.estimates)
    report = report_of(found)
    (step,), log = report["steps"], report["log"]
    assert (step["claimed"], step["alternatives"], step["empirical"]) == (True, [], False)
    assert step["probability"] > 0.99
    # the models that were fitted, best first
    assert (log[0]["hypotheses"], log[0]["log_probability"]) == (["supply_sag"], 0.0)
    assert [m["log_probability"] for m in log] == sorted((m["log_probability"] for m in log), reverse=True)
    plain = next(m for m in log if m["hypotheses"] == [])
    assert plain["log_probability"] < -100.0
    assert plain["chi2_per_sample"] > 1.5 > log[0]["chi2_per_sample"]


@pytest.mark.nightly
def test_effects_that_leave_the_same_trace_are_one_group_and_get_advice(closed):
    found = closed("coulomb=40")
    assert (found.verdict, found.also) == ("cannot_tell_apart", ())
    (step,) = found.steps
    assert not step.claimed
    assert {step.effect, *step.alternatives} == {"coulomb", "seal_friction"}
    # The records say nothing of which it is: the prior odds of the two do.
    odds = calibration().odds
    assert step.probability == pytest.approx(odds["coulomb"] / (1.0 + odds["coulomb"]), abs=0.1)
    assert "cannot be told from" in conclusion(found)
    said = loop_document(report_of(found), details_of(found), {}, "x").answer[0]
    assert said == f"{found.inference.sentence} (among 5 of {len(EFFECTS)} effects)."
    assert found.advice
    assert {"coulomb", "seal_friction"} >= set(found.advice[0].separates)
    assert max(off_by(found)) < 1.5
    # The arm is known whichever of them it is; its strength is not, as it may have none.
    trusted = {e.name.partition(".")[0] for e in found.after.estimates if e.trusted}
    assert trusted == set(TRUTH)


def test_holdout_records_decide_nothing(closed):
    found = closed("supply_sag=0.010")
    rng = np.random.default_rng(1)
    records = tuple(r if r.role == "train" else garbage(r, rng) for r in found.campaign.records)
    again = close_loop(Model(found.campaign.plant), replace(found.campaign, records=records), CANDIDATES)
    assert again.effects == found.effects
    assert again.parameters == found.parameters
    assert fits_of(again) == fits_of(found)
    before, after = (report_of(f)["probabilities"] for f in (found, again))
    assert after["effects_beside_unknown"] == pytest.approx(before["effects_beside_unknown"])
    assert after["constants"] == before["constants"]
    assert after["unknown"] > before["unknown"]
    assert (again.verdict, again.also) == ("does_not_carry_over", ())
    assert not any(s.claimed for s in again.steps)


def test_what_held_out_records_miss_may_be_their_own_fault_or_something_unknown(closed):
    found = closed("supply_sag=0.010").inference
    one, every = (found.after_holdout(over).posterior for over in ([True, False, False], [True, True, True]))
    before = found.posterior
    assert before.probability("unknown") < 0.01 < one.probability("unknown") < 0.5
    assert every.probability("unknown") > 0.95
    for after in (one, every):
        share = (1.0 - after.probability("unknown")) / (1.0 - before.probability("unknown"))
        name = after.probability("effect", "supply_sag")
        assert name == pytest.approx(share * before.probability("effect", "supply_sag"))
    assert found.after_holdout([True]).in_force == found.in_force


def test_what_held_out_records_deny_is_withdrawn(closed):
    """Trained on an arm whose supply sags, judged on one whose supply does not."""
    sagging, sound = closed("supply_sag=0.010"), closed()
    campaign = replace(sagging.campaign, records=(*sagging.campaign.train, *sound.campaign.holdout))
    found = close_loop(Model(campaign.plant), campaign, CANDIDATES)
    assert (found.verdict, found.effects, found.steps) == ("does_not_carry_over", (), ())
    assert found.parameters == {e.name: e.value for e in found.before.estimates}
    assert not any(e.trusted for e in found.after.estimates)
    report = report_of(found)
    assert report["withdrawn"]["effects"] == ["supply_sag"]
    assert [step["claimed"] for step in report["withdrawn"]["steps"]] == [False]
    errors = report["withdrawn"]["error"]
    assert errors["after"]["holdout"]["rmse"] > 1.02 * errors["before"]["holdout"]["rmse"]
    assert not any(p["interval_holds"] for p in report["parameters"]["after"].values())
    assert "it is withdrawn, and the declared model stands" in conclusion(found)


def test_a_record_held_out_that_makes_the_simulation_diverge_is_no_noise(closed):
    """Of a gas without a volume; a copy of a train record under another name is told, too."""
    sound = closed()
    held, *_ = sound.campaign.holdout
    gone = moved_record(held, sound.campaign.plant, {"V0": -0.999})
    copy = replace(sound.campaign.train[0], file="copy.csv", role="holdout")
    campaign = replace(sound.campaign, records=(*sound.campaign.train, gone, copy))
    found = close_loop(Model(campaign.plant), campaign, CANDIDATES)
    assert (found.verdict, found.effects) == ("does_not_carry_over", ())
    assert f"{held.file} makes the simulation diverge" in conclusion(found)
    assert any("copy.csv hold the same" in sentence for sentence in report_of(found)["next_steps"])
    assert report_of(found)["error"]["after"]["holdout"]["rmse"] is None


def test_constants_that_are_off_leave_noise_and_no_name(stand):
    """The resistance is declared 4 % too high: two tolerances of 2 %."""
    campaign = read_campaign(stand(*COMMON))
    records = tuple(moved_record(r, campaign.plant, {"R": 0.04}) for r in campaign.records)
    model, there = Model(campaign.plant), replace(campaign, records=records)
    _, taken_as_exact = prepared(model, replace(there, tolerances={}), CANDIDATES)
    assert taken_as_exact.chi2 > 1.5 * len(taken_as_exact.residual)
    found = close_loop(model, replace(there, tolerances=tolerances_of({}, campaign.plant, "")), CANDIDATES, curve=False)
    assert (found.verdict, found.effects, found.suspects) == ("no_discrepancy", (), ())
    assert found.after.train.errors.chi2_per_sample < 1.1
    assert found.after.holdout.errors.chi2_per_sample < 1.1
    report = report_of(found)
    constants = report["probabilities"]["constants"]
    assert min(constants, key=constants.get) == "R"
    assert -2.5 < constants["R"] < -1.0
    assert max(off_by(found)) < 1.0
    for name in TRUTH:
        p = report["parameters"]["after"][name]
        assert p["low"] < p["noise_low"] < p["noise_high"] < p["high"]
        assert p["interval_holds"]
        assert p["causes"][0].startswith("constants within tolerances")
    assert [name for name in TRUTH if not report["parameters"]["after"][name]["trusted"]] == ["p0", "eta3", "n"]
    together = report["known_together"]
    assert any(said.startswith("these records do not tell a change of eta3 +1 %, I01") for said in together)
    assert report["taken_as_exact"] == []


@pytest.fixture
def axis(write_axis, tmp_path):
    """Return a function that gives a campaign of an axis whose viscous friction is not declared."""
    times = np.arange(401) / 200.0

    def campaign(more="[parameters.mass]\nlow = 1\nhigh = 4\n"):
        speed = 8.0 / 5.0 * (1.0 - np.exp(-5.0 * times / 2.0))
        return read_campaign(write_axis(tmp_path, speed + 1e-3 * np.random.default_rng(1).standard_normal(401), more))

    return campaign


@pytest.mark.filterwarnings("ignore:every train record")
@pytest.mark.parametrize("bounds", [{"mass": (1.0, 50.0)}, {"mass": (1.0, 4.0), "viscous.slope": (0.0, 20.0)}])
def test_the_interval_of_noise_alone_is_that_of_identify_and_of_identifiability(axis, bounds):
    """With friction that nobody declared, and without: what the model leaves counts as noise in all three."""
    campaign, known = axis(), {"effects": ["viscous"] if "viscous.slope" in bounds else [], "bounds": bounds}
    mass = armid.close_loop(campaign, candidates=["coulomb"], **known).before.estimates[0]
    fitted = armid.identify(campaign, identifier="least_squares", budget=300, **known).parameters["mass"]
    examined = armid.examine(campaign, **known)
    centre, half = (dict(zip(examined.space.free_names, each, strict=True))["mass"]
                    for each in (examined.x, examined.information.half_width))  # fmt: skip
    width = mass.noise_high - mass.noise_low
    for low, high in ((fitted.low, fitted.high), (centre - half, centre + half)):
        assert (low, high) == pytest.approx((mass.noise_low, mass.noise_high), abs=0.01 * width)


def test_a_parameter_at_its_limit_is_told_and_no_name_rests_on_it(axis):
    """At its steady speed of 1.6 m/s the axis loses all of its 8 N: 5 N s/m, where the usual range ends at 2.5."""
    campaign, viscous = axis(), {"viscous": EFFECTS["viscous"]}
    found, wider = (close_loop(Model(campaign.plant), campaign, viscous, bounds=bounds)
                    for bounds in ({"viscous.slope": (0.0, 4.0)}, {}))  # fmt: skip
    assert found.parameters["viscous.slope"] == pytest.approx(4.0)
    assert any(s.startswith("viscous.slope sits at its limit 4 N s/m") for s in found.next_steps)
    assert found.verdict != "explained"
    assert not any(step.claimed for step in found.steps)
    (told,) = [e for e in found.after.estimates if e.name == "viscous.slope"]
    assert not told.trusted
    assert told.high == pytest.approx(4.0)
    assert (wider.verdict, wider.effects) == ("explained", ("viscous",))
    assert wider.parameters["viscous.slope"] == pytest.approx(5.0, rel=1e-3)
    report = report_of(wider)
    assert report["error"]["after"]["holdout"] is report["noise_rms_holdout"] is None


def test_what_the_records_give_up_to_a_common_factor_is_told_of_rough_constants_too(axis):
    """A force in proportion to a current moves a mass against friction: scaled alike, all three move it the same."""
    campaign = axis("[tolerances]\ndefault = 0.5\n[parameters.mass]\nfixed = 2.0\n")
    found = close_loop(Model(campaign.plant), campaign, {"viscous": EFFECTS["viscous"]})
    assert found.effects == ("viscous",)
    assert report_of(found)["known_together"] == ["these records give mass, gain up to a common factor"]


def test_a_constant_that_is_known_roughly_is_looked_for_as_an_effect_is(axis):
    """The gain is declared 25 % too high: two of its deviations and a half."""
    campaign, known = axis("[constants]\ngain = 1.25\n[parameters.mass]\nfixed = 2.0\n"), {"gain": 0.1}
    found = armid.close_loop(replace(campaign, tolerances=known, rough=known), effects=["viscous"],
                             candidates=["quadratic_drag"], bounds={"viscous.slope": (0.0, 20.0)})  # fmt: skip
    assert (found.verdict, found.effects) == ("explained", ("constant:gain",))
    assert [step.claimed for step in found.steps] == [True]
    assert found.parameters["constant:gain.error"] == pytest.approx(1.0 / 1.25 - 1.0, rel=0.03)
    (slope,) = [e for e in found.after.estimates if e.name == "viscous.slope"]
    assert slope.low < 5.0 < slope.high


def test_a_constant_without_a_tolerance_may_stand_for_an_effect(axis):
    """The gain is declared 25 % too high; of nothing else does the drive depend. With a tolerance of 0 it is exact."""
    text = "[constants]\ngain = 1.25\n[parameters.mass]\nfixed = 2.0\n"
    unsaid, exact = (armid.close_loop(axis(text + more), effects=["viscous"], candidates=["drive_gain"],
                                      bounds={"viscous.slope": (0.0, 20.0)})
                     for more in ("", "[tolerances]\ngain = 0.0\n"))  # fmt: skip
    assert (unsaid.verdict, exact.verdict) == ("cannot_tell_apart", "explained")
    assert [step.claimed for found in (unsaid, exact) for step in found.steps] == [False, True]
    assert unsaid.steps[0].instead == {"gain": pytest.approx(-0.2, rel=0.03)}
    assert exact.steps[0].instead == {}
    assert "drive_gain cannot be told from gain 20." in conclusion(unsaid)
    assert "Give the tolerance of gain, 0 where it is exact." in conclusion(unsaid)
    assert not any(e.trusted for e in unsaid.after.estimates)


def test_what_the_records_cannot_show_widens_an_interval_as_far_as_it_is_probable(axis):
    """Force, mass and friction that grow alike leave the motion as it is.

    A fit with all three may end anywhere along that valley, so that a rare effect may widen one side more.
    """
    campaign = axis()
    candidates = {n: EFFECTS[n] for n in ("viscous", "drive_gain")}
    alone, plain, likely = (
        close_loop(Model(campaign.plant), campaign, some, priors=priors).after.estimates[0]
        for some, priors in (({"viscous": EFFECTS["viscous"]}, {}), (candidates, {}), (candidates, {"drive_gain": 0.5}))
    )
    assert alone.high - alone.low < plain.high - plain.low < 0.75 * (likely.high - likely.low)
    assert likely.low < 2.0 < likely.high
    assert (alone.trusted, likely.trusted) == (True, False)


def test_what_the_screen_suspects_is_told_where_the_loop_found_nothing_better(axis, monkeypatch):
    seen = [DataIssue(kind, "axis.csv", f"axis.csv: {kind}.") for kind in ("late", "unjudged", "rest")]
    monkeypatch.setattr(import_module("armid.loop.close_loop"), "data_issues", lambda *_: seen)
    campaign = axis()
    explained, at_a_loss = (
        close_loop(Model(campaign.plant), campaign, {n: EFFECTS[n] for n in names}, curve=False)
        for names in (["viscous"], ["coulomb"])
    )
    assert explained.verdict == "explained"
    assert "axis.csv: late." not in explained.next_steps
    assert not any(s.claimed for s in at_a_loss.steps)
    assert at_a_loss.next_steps[:2] == ("axis.csv: late.", "axis.csv: rest.")
    for found in (explained, at_a_loss):
        assert "axis.csv: rest." in found.next_steps
        assert "axis.csv: unjudged." not in found.next_steps


def test_records_that_look_wrong_are_told_and_nothing_is_looked_for(axis, monkeypatch):
    gross = DataIssue("sign", "", "The drive has the other sign.", 1e-6)
    monkeypatch.setattr(import_module("armid.loop.close_loop"), "data_issues", lambda *_: [gross])
    campaign = axis()
    found = close_loop(Model(campaign.plant), campaign, {"viscous": EFFECTS["viscous"]})
    assert (found.verdict, found.effects, found.missing) == ("implausible_records", (), None)
    assert conclusion(found) == "Nothing is named, as the records look wrong. The drive has the other sign."


def concluded(verdict, effects=(), claimed=(), alternatives=(), moved=0.0, shows_on_train=False, ratios=()):
    """Return what is said first of a loop that ended with a verdict and left more than noise."""
    steps = [
        SimpleNamespace(effect=e, claimed=e in claimed, alternatives=alternatives, probability=0.6, instead={})
        for e in effects
    ]
    return conclusion(SimpleNamespace(
        verdict=verdict, effects=effects, steps=steps,
        outputs={"speed": {"noise_rms": 0.1, "moved_by_inputs": moved}},
        inference=SimpleNamespace(in_force=0, exploration=SimpleNamespace(
            fits=[SimpleNamespace(deviations={"mass": -3.0}, constants={"mass": -0.06})])),
        after=SimpleNamespace(significant=True,
                              diagnosis=SimpleNamespace(
                                  significant=shows_on_train, p=0.002, of_kind=lambda _: [
                                      SimpleNamespace(where=w, ratio=r) for w, r in ratios]),
                              train=SimpleNamespace(errors=SimpleNamespace(rmse=0.45))),
        campaign=SimpleNamespace(holdout=()),
    ))  # fmt: skip


def test_a_conclusion_is_what_the_tests_say():
    missed = concluded("no_discrepancy")
    assert "on the train records is noise" in missed
    assert "on those held out, but their error is less than 1.1 times the noise" in missed
    little = concluded("no_discrepancy", shows_on_train=True)
    assert "is a little more than noise (chance 0.002), too little to name a cause: nothing is missing" in little
    assert little.endswith("mass is 3.0 standard deviations below its declared value (-6.0%).")
    predicts = "that with a + b predicts parts left out of the fit best"
    assert concluded("partly_explained", ("a", "b")).endswith(f"{predicts}: no name is claimed.")
    assert concluded("partly_explained", ("a", "b"), "a").endswith(f"{predicts}: b is not claimed.")
    assert concluded("partly_explained", ("a", "b"), "ab").endswith(f"{predicts}.")
    assert concluded("unexplained") == "The declared model lacks something that the library does not hold."
    ratios = [("a.csv, speed", 60.0), ("b.csv, speed", 1.5), ("c.csv, speed", 0.9), ("a.csv, angle", 40.0)]
    where = "99% of what the model leaves beyond noise lies in a.csv: look at this record first."
    assert concluded("unexplained", ratios=ratios).endswith(where)
    assert "a.csv" not in concluded("unexplained", ratios=[*ratios, ("c.csv, angle", 30.0)])
    assert "a.csv" not in concluded("unexplained", ratios=ratios[:2])
    assert concluded("unexplained", moved=0.4).endswith("noise of the inputs may be all of it.")
    group = concluded("cannot_tell_apart", ("a", "b"), "a", ("c", "d"))
    assert group.startswith("With a + b a significant discrepancy remains, and on these records")
    assert "b cannot be told from c or d" in group
    assert "a has a probability" not in group
    assert "b has a probability of 0.60" in concluded("cannot_tell_apart", ("a", "b"), "a")


@pytest.mark.filterwarnings("ignore:every train record")
def test_identify_takes_what_was_found_by_the_options_that_are_printed(axis):
    campaign = axis()
    found = armid.close_loop(campaign, candidates=["viscous"], curve=False)
    said = declared_by(found)
    assert said.startswith("`armid identify` declares this model with `--effects viscous --bounds viscous.slope=0:")
    name, _, ends = said.rstrip("`.").rpartition(" ")[2].partition("=")
    bounds = {name: tuple(float(end) for end in ends.split(":"))}
    again = armid.identify(campaign, identifier="least_squares", effects="viscous", bounds=bounds)
    slope = next(e.value for e in found.after.estimates if e.name == name)
    assert again.parameters[name].value == pytest.approx(slope, rel=1e-3)
    assert declared_by(armid.close_loop(campaign, effects=["viscous"], candidates=["coulomb"], curve=False)) == ""
    at_null = replace(found.after, fit=replace(found.after.fit, z=np.zeros_like(found.after.fit.z)))
    assert declared_by(replace(found, after=at_null)).endswith(" with `--effects viscous`.")


def test_what_is_known_of_a_parameter_beforehand_counts(axis):
    """A prior as narrow as the records' own interval draws the estimate half-way."""
    campaign = axis()
    alone, drawn = (
        armid.close_loop(campaign, candidates=["viscous"], curve=False, priors=priors).after.estimates[0]
        for priors in ({}, {"mass": (2.02, 0.0001)})
    )
    assert abs(alone.value - 2.0) < 0.01
    assert abs(drawn.value - 2.02) < 0.2 * abs(alone.value - 2.02)
    assert drawn.high - drawn.low < alone.high - alone.low
    for bad in ({"mas": (1.0, 1.0)}, {"mass": (2.0, -1.0)}, {"viscous": 1.5}, {"viscos": 0.5}):
        with pytest.raises(ArmidError):
            armid.close_loop(campaign, candidates=["viscous"], priors=bad)
    with pytest.raises(ArmidError, match="within"):
        armid.close_loop(campaign, candidates=["viscous"], within=-0.1)
    with pytest.raises(ArmidError, match=r"did you mean 'viscous\.slope'"):
        armid.close_loop(campaign, candidates=["viscous"], bounds={"viscous.slop": (0.0, 1.0)})
