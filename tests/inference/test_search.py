"""Which models are fitted: those in the window, free shapes, other forms, pairs; what is kept of them."""

from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from armid.inference import infer, moves, prepared, search
from armid.inference.candidates import EffectKey
from armid.inference.decisions import HOPELESS, WINDOW
from armid.inference.evidence import expansion_of, forecast
from armid.inference.kinds import effects, faults
from armid.inference.kinds.hypothesis import Hypothesis, may_join
from armid.inference.library import Activation, Library
from armid.inference.model import best_along
from armid.inference.moves import Exploration, drops
from armid.inference.search import BEAM, MOST_EFFECTS, has_expanded_form, is_outdone, next_model
from armid.model import EFFECTS, Model
from armid.record import read_campaign

MANOEUVRES = ("--manoeuvres", "lower,raise,short,empty", "--holdout", "", "--repeats", "1", "--duration", "0.8")
# Candidates of one compiled model, of which a test asks for some.
FEW = ("coulomb", "flux_saturation", "stribeck", "supply_sag", "torque_ripple")


@pytest.fixture
def explored(stand, monkeypatch):
    """Return a function that infers of some candidates what a campaign with some effects lacks, and how it explored."""
    joinable = Library.joinable

    def run(candidates, *effects):
        campaign = read_campaign(stand(*MANOEUVRES, "--effect", *effects))
        some = Model(campaign.plant), campaign, {n: EFFECTS[n] for n in FEW}
        monkeypatch.setattr(Library, "joinable", lambda *of: [k for k in joinable(*of) if k.public in candidates])
        return infer(*prepared(*some))

    return run


@pytest.mark.nightly
def test_a_shape_that_is_not_the_usual_one_is_found(explored):
    found = explored(["stribeck"], "stribeck=60", "stribeck_exponent=1").exploration
    best, _ = found.ranked()[0]
    assert {h.public for h in best} == {("effect", "stribeck")}
    fit = found.fits[best]
    assert fit.active == (EffectKey("stribeck", free_shape=True),)
    assert fit.values["stribeck.exponent"] == pytest.approx(1.0, abs=0.15)


@pytest.mark.nightly
def test_another_form_of_an_effect_takes_its_place(explored):
    """As the square of the current, what saturates otherwise looks like another effect; its own form is asked for."""
    found = explored(["flux_saturation", "coulomb"], "flux_saturation=90", "coulomb=40")
    best = {h.name: h.form for h in found.exploration.ranked()[0][0]}
    assert best.keys() == {"coulomb", "flux_saturation"}
    assert best["flux_saturation"] == ""
    assert "arctangent" in {h.form for model in found.exploration.fits for h in model if len(model) == 2}
    assert found.probabilities["effects"]["flux_saturation"] > 0.95


@pytest.mark.nightly
def test_a_wave_needs_five_periods_within_the_travel(stand):
    campaign = read_campaign(stand(*MANOEUVRES))
    library, declared = prepared(Model(campaign.plant), campaign, {n: EFFECTS[n] for n in FEW})
    key = EffectKey("torque_ripple")
    space, waves = library.problem((key,)).space, "torque_ripple.waves"
    least = 10.0 * np.pi / np.ptp(effects.positions(declared))
    assert 20.0 < least < 30.0
    assert space.low[space.index(waves)] == pytest.approx(least)
    short = replace(library, least_waves=1e4, _problems={})
    assert (key in library.joinable(()), key in short.joinable(())) == (True, False)
    assert key in replace(short, bounds={waves: (30.0, 60.0)}).joinable(())


def test_a_form_begins_where_the_other_one_ended(monkeypatch):
    old, new = EffectKey("stribeck", "hess_soom", free_shape=True), EffectKey("stribeck")
    values = {"inertia": 2.0, "stribeck_hess_soom.level": 1.4, "stribeck_hess_soom.fade": 0.09}
    full = {"stribeck.level": 5.0, "stribeck.fade": 0.3, "stribeck.exponent": 2.0}
    one = Activation(full, {"stribeck.level": 0.0}, 0.001)
    library = SimpleNamespace(fixed_shapes=lambda key: ("stribeck.exponent",), reachable=lambda shares: shares)
    proposal = SimpleNamespace(hypothesis=SimpleNamespace(means=new), grid=[one])
    fitted = Mock()
    monkeypatch.setattr(moves, "near", fitted)
    moves.swapped(SimpleNamespace(active=(old,), values=values), old, proposal, 0, 0.5, library, 1.0, np.inf)
    _, active, guesses, *_ = fitted.call_args.args
    assert active == (EffectKey("stribeck", free_shape=True),)
    assert guesses[-1] == {"inertia": 2.0, "stribeck.level": 1.4, "stribeck.fade": 0.09, "stribeck.exponent": 2.0}
    assert {guess["stribeck.fade"] for guess in guesses[:-1]} == {0.3}


@pytest.mark.nightly
def test_a_fault_that_an_effect_makes_needless_is_dropped(explored, monkeypatch):
    """It took the place of the effect and keeps it with no size: a sound record would be accused."""
    found = explored(["supply_sag"], "supply_sag=0.03").exploration
    best, _ = found.ranked()[0]
    assert {h.public for h in best} == {("effect", "supply_sag")}
    right = found.fits.pop(best)
    about = expansion_of(right, found.scale(), found.library)
    monkeypatch.setattr(faults, "MOVES", 0.0)
    offset = next(p for p in faults.propose(right, found.faults, found.library) if "offset" in p.hypothesis.name)
    faulty = best | {offset.hypothesis}
    found.fits[faulty] = offset.refit(right, about, forecast(about, offset), np.inf)
    assert [f.unknown.name for f in found.fits[faulty].others] == [offset.hypothesis.name]
    trials = dict(drops(found, faulty))
    again = trials[best]()
    assert again.others == ()
    assert again.chi2 == pytest.approx(right.chi2, rel=1e-3)
    found.fits[best] = again
    assert found.log_posterior(best) > found.log_posterior(faulty)


@pytest.mark.nightly
def test_the_model_at_which_the_search_ends_is_expanded(explored, monkeypatch):
    """Else its name may stand for a twin that was never fitted in its place."""
    for name in ("MOST_EXPANDED", "FEWEST_EXPANDED"):
        monkeypatch.setattr(search, name, 1)
    found = explored(["coulomb", "stribeck", "supply_sag"], "coulomb=40").exploration
    best, _ = found.ranked()[0]
    assert {h.name for h in best} == {"coulomb"}
    assert set(found.forecasts) == {frozenset(), best}
    assert {"stribeck"} in [{h.name for h in model} for model in found.fits]


@pytest.mark.slow
def test_a_model_that_missed_its_valley_is_fitted_again_from_the_larger_one(explored):
    """Else a second name, of no size, would seem as necessary as the first."""
    found = explored(["coulomb", "supply_sag"], "coulomb=40").exploration
    right, _ = found.ranked()[0]
    assert {h.public for h in right} == {("effect", "coulomb")}
    found.fits = {model: found.fits[model] for model in (frozenset(), right)}
    fit = found.fits[right]
    about = expansion_of(fit, found.scale(), found.library)
    (sag,) = effects.propose(fit, found.known, found.library)
    both = right | {sag.hypothesis}
    found.fits[both] = sag.refit(fit, about, forecast(about, sag), np.inf)
    z = 0.5 * (fit.z + 0.1)
    found.fits[right] = replace(fit, z=z, residual=fit.records.plain.residuals(z)[0])
    found._evidence.clear()
    assert found.ranked()[0][0] == both
    search.finish_all(found)
    assert found.ranked()[0][0] == right
    assert found.fits[right].chi2 == pytest.approx(fit.chi2, rel=1e-3)


class Narrow:
    """A sum of squares with a narrow valley along its second parameter, whose range begins at `low`."""

    def __init__(self, low, valley, width):
        self.space = SimpleNamespace(free=np.ones(2, bool), low=np.array([0.0, low]), high=np.ones(2))
        self.valley, self.width = valley, width

    def chi2(self, Z):
        second = self.space.low[1] + Z[:, 1] * (1.0 - self.space.low[1])
        return np.where(np.abs(second - self.valley) < self.width, 1.0, 10.0) + (Z[:, 0] - 0.2) ** 2


@pytest.mark.parametrize(
    ("low", "valley", "width"),
    [(0.0, 0.7123, 0.002), pytest.param(1e-4, 7e-4, 2e-5, id="near the small end of a range over decades")],
)
def test_a_narrow_valley_is_found_along_one_parameter(low, valley, width):
    best = best_along(Narrow(low, valley, width), np.array([0.5, 0.5]), 1)
    assert best[0] == 0.5
    assert low + best[1] * (1.0 - low) == pytest.approx(valley, abs=width)


def model(names):
    """Return a model; each letter is an effect."""
    return frozenset(Hypothesis("effect", name) for name in names)


def exploration(posteriors, expanded=(), misfit=False, monkeypatch=None):
    """Return an exploration of models, names -> log posterior, the best of which leaves more than noise or does not."""
    fit = SimpleNamespace(records=SimpleNamespace(data=SimpleNamespace(cover=None)))
    found = Exploration(None, {}, fits={model(n): fit for n in posteriors}, forecasts={model(n): [] for n in expanded})
    ranked = sorted(((model(n), p) for n, p in posteriors.items()), key=lambda pair: -pair[1])
    monkeypatch.setattr(found, "ranked", lambda: ranked)
    monkeypatch.setattr(search, "is_significant", lambda _: misfit)
    monkeypatch.setattr(search, "is_near", lambda _: not misfit)
    return found


def test_the_most_probable_model_comes_next_that_is_neither_expanded_nor_outdone_by_a_smaller_one(monkeypatch):
    posteriors = {"ab": 0.0, "ac": -0.5, "d": -WINDOW + 0.1, "e": -WINDOW - 0.1}
    order = []
    while (one := next_model(exploration(posteriors, order, monkeypatch=monkeypatch))) is not None:
        order.append("".join(sorted(h.name for h in one)))
    assert order == ["ab", "ac", "d"]
    posteriors = {"a": 0.0, "ab": -1.0, "c": -2.0}
    ranked = exploration(posteriors, monkeypatch=monkeypatch).ranked()
    assert [is_outdone(m, p, ranked) for m, p in ranked] == [False, True, False]
    assert next_model(exploration(posteriors, "a", monkeypatch=monkeypatch)) == model("c")
    assert next_model(exploration(posteriors, "ac", monkeypatch=monkeypatch)) is None


def test_what_was_only_forecast_is_fitted_before_it_counts(monkeypatch):
    """The first that lead may be refused where they are fitted; those behind them are as wrong."""
    found, asked = exploration({"": 0.0, "z": -WINDOW - 1.0}, monkeypatch=monkeypatch), []
    ahead = [
        Mock(posterior=p, proposal=Mock(hypothesis=Hypothesis("record", n))) for n, p in zip("abcd", (9, 30, -9, 1))
    ]
    found.forecasts = {model(""): ahead, model("z"): ahead}
    found.noise, found.refused, found.take_or_refuse = Mock(), set(), lambda key, fit: found.refused.add(key)
    monkeypatch.setattr(search, "expansion_of", Mock())
    monkeypatch.setattr(search, "limit_of", Mock())
    monkeypatch.setattr(search, "trial_of", lambda _, of, about, one, limit: [
        (of | {one.proposal.hypothesis}, lambda: asked.append(one.proposal.hypothesis.name))])  # fmt: skip
    assert not search.fit_what_counts(found)
    assert asked == ["b", "a", "d"]


def test_a_model_in_another_form_that_is_as_probable_has_the_same_neighbours(monkeypatch):
    root, tanh, sharp = (frozenset([Hypothesis("effect", "a", form)]) for form in ("root", "tanh", "sharp"))
    assert has_expanded_form(tanh, 1.0, [(root, 0.0)])
    assert not has_expanded_form(tanh, WINDOW + 1.0, [(root, 0.0)])
    assert not has_expanded_form(tanh, 1.0, [(tanh, 1.0), (model("b"), 0.0)])
    # one that is less probable by more may hold beside it what the other makes up for
    found = exploration({}, monkeypatch=monkeypatch)
    found.forecasts = {root: []}
    ranked = [(root, 0.0), (tanh, -1.0), (sharp, -HOPELESS + 1.0), (model("b"), -HOPELESS + 2.0)]
    found.fits = {m: SimpleNamespace(records=SimpleNamespace(data=SimpleNamespace(cover=None))) for m, _ in ranked}
    monkeypatch.setattr(found, "ranked", lambda: ranked)
    assert next_model(found) == sharp
    found.forecasts[sharp] = []
    assert next_model(found) is None


def test_where_more_than_noise_is_left_the_best_of_each_size_lead_on(monkeypatch):
    """A strong second effect misleads the choice of the first."""
    singles = {name: -1000.0 - i for i, name in enumerate("abcdefg")}
    posteriors = {"xy": 0.0, **singles}
    order = []
    while (one := next_model(exploration(posteriors, order, True, monkeypatch))) is not None:
        order.append("".join(sorted(h.name for h in one)))
    assert order == [*"abcdefg"[:BEAM], "xy"]
    assert next_model(exploration(posteriors, ["xy"], False, monkeypatch)) is None
    # where none leads, one with an effect may show what another does
    order = []
    while (one := next_model(exploration({"": 0.0, **singles}, ["", *order], True, monkeypatch))) is not None:
        order.append("".join(sorted(h.name for h in one)))
    assert order == [*"abcdefg"[:BEAM]]
    large = "abcdefgh"
    assert len(large) == MOST_EFFECTS
    assert next_model(exploration({large: 0.0}, (), False, monkeypatch)) is None


def test_a_search_with_another_noise_goes_on_from_what_led_before(monkeypatch):
    fault, signal = Hypothesis("record", "late"), Hypothesis("unknown", "torque")
    ranked = [frozenset({signal}), frozenset({*model("a"), fault}), model("a"), frozenset(), *map(model, "bcd")]
    before = exploration({}, monkeypatch=monkeypatch)
    before.fits = {m: Mock() for m in ranked}
    monkeypatch.setattr(before, "ranked", lambda: [(m, -float(i)) for i, m in enumerate(ranked)])
    leaders = search.leaders_of(before)
    assert list(leaders) == [model("a"), model("b"), model("c")]
    assert leaders[model("a")] is before.fits[ranked[1]]
    begun = exploration({"": 0.0}, monkeypatch=monkeypatch)
    taken, looked = Mock(), Mock(side_effect=AssertionError)
    for name, one in {
        "begun": lambda *_: begun,
        "expand_all": Mock(return_value=False),
        "finish_all": Mock(),
        "some_records": lambda _: None,
        "take_carried": taken,
        "add_unknown": Mock(),
        "take_from_some_records": looked,
        "fit_what_counts": Mock(return_value=False),
    }.items():
        monkeypatch.setattr(search, name, one)
    begun.library, begun.forecasts = Mock(), {frozenset(): []}
    assert search.explore(Mock(), Mock(), led_by=leaders) is begun
    assert taken.call_args.args[:2] == (begun, leaders)


def test_a_fit_from_a_nearer_start_takes_the_place_of_a_local_one_and_its_evidence_is_its_own(monkeypatch):
    local, better = Mock(chi2=120.0), Mock(chi2=100.0)
    monkeypatch.setattr(moves, "expansion_of", lambda fit, *_: fit)
    monkeypatch.setattr(moves, "log_evidence", lambda fit: -0.5 * fit.chi2)
    monkeypatch.setattr(Exploration, "scale", lambda _: None)
    found = Exploration(None, {})
    key = model("ab")
    assert found.take(key, local)
    found.forecasts[key] = []
    assert found.take(key, better)
    assert key not in found.forecasts, "they were made about a worse fit"
    assert not found.take(key, local)
    assert not found.take(key, None)
    assert not found.take(key, Mock(chi2=np.nan))
    assert found.fits == {key: better}
    # what is freed leaves its address to what comes next
    for chi2 in range(20):
        found.fits.clear()
        found.fits[key] = Mock(chi2=float(chi2))
        assert found.log_posterior(key, "a scale") == -0.5 * chi2


def test_keys_and_what_they_own():
    key = EffectKey("flux_saturation", "atan", free_shape=True)
    assert (key.compiled, key.public, key.declared) == (
        "flux_saturation_atan", "flux_saturation", EffectKey("flux_saturation", "atan"),
    )  # fmt: skip
    assert key.owns("flux_saturation_atan.level")
    assert not key.owns("flux_saturation_atan2.level")
    assert EffectKey("error_of_R").public == "constant:R"


CARRY_OVER = import_module("armid.inference.carry_over")
NONE, ONE, TWO = (frozenset(Hypothesis("effect", n) for n in names) for names in ((), ("a",), ("a", "b")))
LIBRARY = SimpleNamespace(say=lambda _: None, each=lambda work, items: [work(x) for x in items])


@pytest.mark.parametrize(("squares", "best"), [
    # Two effects miss each part by half as much, but for the loudest one, which alone would decide a mean.
    ([[9e3, 40, 30, 20, 60], [5e3, 20, 16, 10, 32], [6e3, 10, 7, 5, 15]], TWO),
    # A second effect predicts parts better and worse in turn: the fewest effects within one standard error.
    ([[90, 80, 99, 85, 95], [20, 21, 22, 19, 20], [14, 26, 24, 13, 21]], ONE),
    ([[2, 2, 2, 2, 2], [3, 3, 3, 3, 3], [4, 4, 4, 4, 4]], NONE),
    ([[2, 2, 2, 2, 2], [1, 1, 1, 1, 1], [1, np.inf, 1, 1, 1]], ONE),
])  # fmt: skip
def test_the_fewest_effects_that_predict_as_the_best_are_in_force(monkeypatch, squares, best):
    fits = dict(zip((NONE, ONE, TWO), squares, strict=True))
    monkeypatch.setattr(CARRY_OVER, "misses", np.log)
    assert CARRY_OVER.predicting_best((TWO, NONE, ONE), fits, LIBRARY) == best


def test_a_record_is_wrong_in_one_way_and_most_records_are_not_wrong():
    late, fast, bias, other, second = (
        Hypothesis("record", name, record=record) for name, record in
        (("late", ("a.csv", "")), ("clock", ("a.csv", "")), ("offset of speed", ("a.csv", "speed")),
         ("offset of angle", ("a.csv", "angle")), ("late b", ("b.csv", "")))
    )  # fmt: skip
    effect = Hypothesis("effect", "coulomb", "tanh")
    assert not may_join(frozenset({late}), fast, 9)
    assert not may_join(frozenset({late}), bias, 9)
    assert may_join(frozenset({bias}), other, 9)
    assert [may_join(frozenset({late}), second, n) for n in (2, 3, 4)] == [False, False, True]
    assert may_join(frozenset(), late, 2)
    assert may_join(frozenset({late}), effect, 2)
    assert not may_join(frozenset({effect}), Hypothesis("effect", "coulomb"), 2)
