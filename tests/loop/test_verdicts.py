"""What a posterior and the errors on held-out records come to: steps that stand, verdicts, claims, what is told."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armid.inference import Inference
from armid.inference.checks import Diagnosis, Finding
from armid.inference.kinds.hypothesis import Hypothesis
from armid.inference.posterior import Atom, Posterior
from armid.loop import Judgement, Step
from armid.loop.close_loop import confirmed, is_denied, limits_of, path_of, steps_of, verdicts_of
from armid.loop.document import diagnosis_sentences
from armid.loop.figures import diagnosis_figure, ends_of, parameter_figure
from armid.loop.result import HELD, Estimate, Withdrawn, spelled
from armid.report.style import pyplot

QUIET, LOUD = SimpleNamespace(significant=False), SimpleNamespace(significant=True)


def effect(name):
    return Hypothesis("effect", name, means=name)


LATE, DRIFT = Hypothesis("record", "late@a.csv"), Hypothesis("drift", "mass")


def posterior(*sets):
    """Return a posterior of some sets, (names of effects, probability) each; kind:name where it is not an effect."""

    def named(word):
        kind, colon, name = word.partition(":")
        return (kind, name) if colon else ("effect", kind)

    atoms = (Atom(np.log(p), 0.0, frozenset(map(named, names.split())), np.zeros(1), np.ones(1)) for names, p in sets)
    return Posterior(tuple(atoms), ("mass",))


def judged(held, noise=1.0, on_train=QUIET):
    """Return a model that misses held-out records by some error; None: nothing is held out."""
    if held is None:
        return Judgement(None, None, (), SimpleNamespace(diagnosis=on_train), None)
    errors = SimpleNamespace(outputs={"speed": SimpleNamespace(rmse=held)}, joint_nrmse=0.01 * held)
    unseen = SimpleNamespace(errors=errors, noise_of={"speed": noise}, diagnosis=LOUD if held > 1.2 * noise else QUIET)
    seen = SimpleNamespace(errors=SimpleNamespace(outputs={}), diagnosis=on_train)
    return Judgement(None, None, (), seen, unseen)


@pytest.mark.parametrize(("held", "kept"), [
    ([3.0, 1.0, 1.0], 2),
    ([3.0, 1.0, 2.0], 1),
    # better than the declared model, and worse than the step before
    ([3.0, 1.5, 2.0, 1.4], 3),
    ([1.0, 2.0, 3.0], 0),
    # a first step that only the second makes good
    ([2.0, 3.0, 1.0], 2),
    # as much as a prediction may be: above the noise by a tenth, worse by two per cent
    ([1.0, 1.09], 1),
    ([1.0, 1.12], 0),
    ([3.0, 3.05], 1),
    ([3.0, 3.07], 0),
    ([None, None, None], 2),
])  # fmt: skip
def test_last_steps_that_held_out_records_deny_go_one_by_one(held, kept):
    assert confirmed([judged(error) for error in held]) == kept


@pytest.mark.parametrize(("speed", "is_denied_then"), [(1.0, False), (3.0, True)])
def test_any_output_that_is_held_out_may_deny(speed, is_denied_then):
    """rmse of the angle, whose noise is 1, and of the speed."""

    def seen(angle, speed):
        outputs = {name: SimpleNamespace(rmse=rmse) for name, rmse in (("angle", angle), ("speed", speed))}
        errors = SimpleNamespace(outputs=outputs, joint_nrmse=float(np.hypot(angle, speed)))
        return SimpleNamespace(errors=errors, noise_of={"angle": 1.0, "speed": 1.0}, diagnosis=QUIET)

    before, after = seen(1.0, 1.0), seen(1.0, speed)
    after.diagnosis = LOUD
    model = Judgement(None, None, (), before, after)
    assert model.fails_to_carry_over is is_denied_then
    assert is_denied(Judgement(None, None, (), before, before), model) is is_denied_then


def step(name, claimed, p=1.0):
    return Step(name, "torque", (), claimed, p, None)


SURE, UNSURE = step("viscous", True), step("coulomb", False, 0.5)
ENOUGH, MISSED = judged(1.0), judged(3.0)


@pytest.mark.parametrize(("sets", "steps", "accused", "after", "verdicts"), [
    ([("", 0.97), ("viscous", 0.03)], (), (), ENOUGH, ("no_discrepancy",)),
    ([("viscous", 1.0)], (SURE,), (), ENOUGH, ("explained",)),
    ([("viscous coulomb", 0.5), ("viscous seal", 0.5)], (SURE, UNSURE), (), ENOUGH, ("cannot_tell_apart",)),
    # many weak answers, none of them probable
    ([("", 0.4), ("viscous", 0.3), ("coulomb", 0.3)], (), (), ENOUGH, ("cannot_tell_apart",)),
    ([("unknown:torque", 0.9), ("", 0.1)], (), (), judged(1.0, on_train=LOUD), ("unexplained",)),
    ([("viscous unknown:torque", 1.0)], (SURE,), (), judged(1.0, on_train=LOUD), ("partly_explained",)),
    # what nobody knows may be what a name stands for: then none is said to be undecided
    ([("unknown:torque", 0.6), ("coulomb", 0.4)], (UNSURE,), (), ENOUGH, ("partly_explained",)),
    # what tests find counts in the posterior, and not once more
    ([("", 0.97)], (), (), judged(1.0, on_train=LOUD), ("no_discrepancy",)),
    ([("record:late@a.csv", 1.0)], (), (LATE,), ENOUGH, ("record_disagrees",)),
    ([("drift:mass", 1.0)], (), (DRIFT,), ENOUGH, ("record_disagrees",)),
    ([("viscous record:late@a.csv", 1.0)], (SURE,), (LATE,), ENOUGH, ("record_disagrees",)),
    ([("record:late@a.csv unknown:torque", 1.0)], (), (LATE,), judged(1.0, on_train=LOUD),
     ("record_disagrees", "unexplained")),
    ([("viscous", 1.0)], (SURE,), (), MISSED, ("does_not_carry_over",)),
    ([("viscous record:late@a.csv", 1.0)], (SURE,), (LATE,), MISSED, ("does_not_carry_over", "record_disagrees")),
])  # fmt: skip
def test_verdicts_are_read_off_the_posterior(sets, steps, accused, after, verdicts):
    assert verdicts_of(SimpleNamespace(posterior=posterior(*sets)), accused, after, steps, None) == verdicts


def test_what_held_out_records_deny_does_not_carry_over_and_is_no_draw():
    found = SimpleNamespace(posterior=posterior(("viscous", 1.0)))
    withdrawn = Withdrawn((step("viscous", False),), MISSED, 0.14)
    assert verdicts_of(found, (), ENOUGH, (), withdrawn) == ("does_not_carry_over",)
    # a name that is not claimed for that reason alone is not one of several
    assert verdicts_of(found, (), MISSED, (step("viscous", False),), None) == ("does_not_carry_over",)


def test_what_may_stand_in_the_place_of_an_effect_and_how_hypotheses_are_spelled():
    found = Inference(None, posterior(
        ("viscous coulomb", 0.4), ("viscous seal", 0.2), ("viscous stribeck", 0.15), ("viscous stribeck unknown:torque",
        0.1), ("viscous record:late@a.csv", 0.05), ("viscous", 0.04), ("viscous seal tilt", 0.03), ("seal", 0.02),
        ("viscous tilt", 0.005), ("drag coulomb", 0.005),
    ))  # fmt: skip
    model = frozenset({effect("viscous"), effect("coulomb")})
    partners = found.partners(model, effect("coulomb"))
    # no fault of a record, no two in the place of one, nothing beside another effect than the model's
    assert partners == pytest.approx({"stribeck": 0.25, "seal": 0.2})
    assert list(partners) == ["stribeck", "seal"], "the most probable first"
    assert found.partners(model, effect("viscous")) == {}
    over = [Hypothesis("unknown", "torque", variable) for variable in ("v", "time (0.2 of a record)")]
    assert [spelled(h) for h in (*over, replace(effect("drag"), form="tanh"), effect("drag"), LATE)] == [
        "something at torque, over v", "something at torque, over time (0.2 of a record)", "drag:tanh", "drag",
        "late@a.csv",
    ]  # fmt: skip


def test_the_name_in_force_is_the_most_probable_whatever_its_forms_share():
    late, drag = effect("late"), effect("drag")
    models = {late: 0.0, replace(drag, form="a"): -0.6, drag: -0.6, Hypothesis("unknown", "torque"): 1.0}
    ranked = [(frozenset({h}), p) for h, p in sorted(models.items(), key=lambda pair: -pair[1])]
    fits = {m: SimpleNamespace(has_idle_effect=False) for m, _ in ranked}
    found = Inference(SimpleNamespace(ranked=lambda: ranked, fits=fits), posterior(("drag", 0.52), ("late", 0.48)))
    assert [h.name for (h,) in found.named] == ["drag", "drag", "late"]
    assert found.in_force == ranked[2][0]
    fits[ranked[2][0]].has_idle_effect = fits[ranked[3][0]].has_idle_effect = True
    assert [h.name for (h,) in found.named] == ["late"]


def test_the_way_to_a_model_goes_by_its_most_probable_parts():
    a, b, c = map(effect, "abc")
    whole = frozenset({a, b, c, LATE})
    known = {whole: 9.0, whole - {a}: 5.0, whole - {b}: 6.0, whole - {c}: 1.0, frozenset({a, LATE}): 2.0,
             frozenset({c, LATE}): 3.0}  # fmt: skip
    found = SimpleNamespace(in_force=whole, exploration=SimpleNamespace(fits=known, log_posterior=known.__getitem__))
    assert path_of(found) == [frozenset(), frozenset({c, LATE}), whole - {b}, whole]
    alone = SimpleNamespace(in_force=frozenset({LATE}), exploration=found.exploration)
    assert path_of(alone) == [frozenset(), frozenset({LATE})]
    assert path_of(SimpleNamespace(in_force=frozenset(), exploration=found.exploration)) == [frozenset()]


@pytest.mark.parametrize(("p", "at_a_limit", "has_arrived", "claimed"), [
    (0.951, False, True, True), (0.949, False, True, False), (0.999, True, True, False), (0.999, False, False, False),
])  # fmt: skip
def test_a_name_is_claimed_that_is_probable_and_whose_fit_is_settled(p, at_a_limit, has_arrived, claimed):
    model = frozenset({effect("viscous"), LATE})
    inference = Inference(None, posterior(("viscous record:late@a.csv", p), ("coulomb record:late@a.csv", 1.0 - p)))
    inference.__dict__["in_force"] = model
    library = SimpleNamespace(candidates={"viscous": SimpleNamespace(adds=("torque", "inertia"))})
    fit = SimpleNamespace(is_at_a_limit=lambda _: at_a_limit, has_arrived=has_arrived)
    object.__setattr__(inference, "exploration", SimpleNamespace(library=library, fits={model: fit}))
    after = Judgement(fit, None, (), None, None)
    (only,) = steps_of(inference, [frozenset(), model], [None, after], lambda *_: {})
    assert (only.effect, only.port, only.claimed) == ("viscous", "torque, inertia", claimed)
    assert only.probability == pytest.approx(p)
    assert only.alternatives == (("coulomb",) if p < 0.99 else ())
    # a model of faults alone is not a step
    assert steps_of(inference, [frozenset(), frozenset({LATE})], [None, after], lambda *_: {}) == ()


def test_a_limit_that_holds_a_parameter_is_told_and_an_interval_is_drawn_as_it_is():
    at_limit = Estimate("n", 1.5, "1", 1.4, 1.6, (HELD,))
    other = Estimate("p0", 3e6, "Pa", 2.9e6, 3.1e6, ())
    length = Estimate("x.width", 0.02, "m", 0.01, 0.03, ("something else", HELD))
    at_zero = Estimate("viscous.slope", 0.0, "N s/m", 0.0, 0.1, (HELD,))
    said = limits_of(SimpleNamespace(estimates=(at_limit, other, length, at_zero)))
    assert [s.partition(":")[0] for s in said] == ["n sits at its limit 1.5", "x.width sits at its limit 0.02 m"]
    assert said[0].endswith("widen it (--bounds n=LOW:HIGH), or fix it.")
    assert ends_of({"value": 3.0, "low": 1.0, "high": 3.5}, 2.0) == [[4.0], [1.0]]
    assert ends_of({"value": 4.0, "low": 1.0, "high": 3.5}, 1.0) == [[3.0], [0.0]]
    assert ends_of({"value": 4.0, "low": None, "high": None}, 1.0) == [[0.0], [0.0]]


@pytest.mark.parametrize(("known", "where"), [([False], ""), ([True, False, True], " of 1 of 3 signals")])
def test_noise_that_no_rest_tells_is_told_of_the_records_that_lack_one(known, where):
    levels = [SimpleNamespace(known=each) for each in known]
    diagnosis = Diagnosis((Finding("autocorrelation", "all", 9.0, 1e-9),), False)
    seen = {"data": SimpleNamespace(known=False, levels=levels), "residual": np.ones(4), "stages": {}, "phases": {}}
    said = diagnosis_sentences(SimpleNamespace(diagnosis=diagnosis, **seen))
    assert said[1] == f"No rest tells the noise{where}: the residual is tested against itself."


def test_the_parts_of_a_diagnosis_are_bars_from_noise_the_largest_first():
    before = Diagnosis((Finding("record", "a.csv", 4.0, 0.1), Finding("record", "b.csv", 9.0, 0.0),
                        Finding("dependence", "omega", 0.5, 0.9)), noise_known=True)  # fmt: skip
    after = Diagnosis((Finding("record", "b.csv", 1.5, 0.4),), noise_known=True)
    found = SimpleNamespace(campaign=SimpleNamespace(name="c"), before=SimpleNamespace(diagnosis=before),
                            after=SimpleNamespace(diagnosis=after))  # fmt: skip
    figure = diagnosis_figure(found)
    records, variables = figure.axes
    assert [t.get_text() for t in records.get_yticklabels()] == ["b.csv", "a.csv"]
    ends = [[bar.get_x() + bar.get_width() for bar in bars] for bars in records.containers]
    # what was not found after is as noise
    assert ends == [[9.0, 4.0], [1.5, 1.0]]
    assert variables.containers[0][0].get_width() == pytest.approx(-0.5)
    pyplot().close(figure)


def test_parameters_are_drawn_in_percent_of_their_value_with_the_truth_where_it_is_known():
    def entry(value, low, high, trusted=True):
        return {"value": value, "low": low, "high": high, "unit": "Pa", "trusted": trusted}

    after = {"p0": entry(2e6, 1.9e6, 2.2e6), "sag": entry(-4.0, -5.0, -3.0), "off": entry(0.0, -1.0, 1.0)}
    before = {"p0": entry(2.5e6, 2.4e6, 2.6e6, trusted=False)}
    figure = parameter_figure("c", {"before": before, "after": after}, {"p0": 2.1e6})
    p0, sag = figure.axes
    assert (p0.get_title(), sag.get_title()) == ("p0\n2 MPa", "sag\n-4e-06 MPa")
    marks = [container.lines[0].get_ydata()[0] for container in p0.containers]
    assert marks == pytest.approx([25.0, 0.0])
    (bar,) = p0.containers[1].lines[2]
    assert np.ravel(bar.get_segments()[0][:, 1]) == pytest.approx([-5.0, 10.0])
    (truth,) = [line for line in p0.lines if line.get_linestyle() == "--"]
    assert truth.get_ydata()[0] == pytest.approx(5.0)
    assert len(sag.containers) == 1
    (bar,) = sag.containers[0].lines[2]
    assert np.ravel(bar.get_segments()[0][:, 1]) == pytest.approx([-25.0, 25.0])
    assert "dashed: true" in figure.get_suptitle()
    pyplot().close(figure)
