"""What the search finds: free shapes, other forms, smaller models found later, sets beside constants; shared work."""

import sys
import threading
from types import SimpleNamespace

import numpy as np
import pytest

from armid.estimation.least_squares import side_by_side
from armid.inference.library import EffectKey, Library, library_of
from armid.inference.refit import best_along, finished, likest, substitutes, with_free_shapes
from armid.inference.whitening import whitened
from armid.loop import constants
from armid.loop import search as search_of
from armid.loop.close_loop import Decision, unless_belied
from armid.loop.constants import ConstantModel, is_outdone
from armid.loop.equivalence import WITHIN, group_of
from armid.loop.fit import Comparison, behind
from armid.loop.search import Search, SearchLevel
from armid.loop.suspects import is_earned, is_next_to_nothing
from armid.model import EFFECTS, Model
from armid.record import read_campaign

closing = sys.modules[unless_belied.__module__]
MANOEUVRES = ("--manoeuvres", "lower,raise,short,empty", "--holdout", "", "--repeats", "1", "--duration", "1.0")


SHAPES = {
    "shell_rocking": (("rocking_hz=6", "rocking_stop=0.008"), "hardening", 0.0077, 0.001),
    "stribeck": (("stribeck=60", "stribeck_exponent=1"), "exponent", 1.0, 0.15),
    "controller_delay": (("controller_period=0.012",), "period", 0.012, 0.0015),
    "winding_heating": (("winding_heating=5e-5", "winding_cooling=2.5"), "cooling", 2.5, 0.4),
}


def library(folder):
    """Return the effects of SHAPES as candidates, which are compiled together."""
    campaign = read_campaign(folder)
    model = Model(campaign.plant)
    data = whitened(campaign.train, model.plant)
    return library_of(model, {n: EFFECTS[n] for n in SHAPES}, data, campaign.parameters, {}, {})


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_that_is_not_the_usual_one_is_found(stand, name, monkeypatch):
    """Each with itself as the only candidate, in the compiled model of all four."""
    effect, shape, expected, within = SHAPES[name]
    monkeypatch.setattr(Library, "joinable", lambda _, active: [] if active else [EffectKey(name)])
    found = Search(library(stand(*MANOEUVRES, "--effect", *effect)))
    last = found.run()[-1].best
    assert last.active == (EffectKey(name, free_shape=True),)
    assert last.values[f"{name}.{shape}"] == pytest.approx(expected, abs=within)
    usual = found.fits[frozenset((EffectKey(name),))]
    assert last.chi2 < usual.chi2
    again = finished(with_free_shapes(usual, EffectKey(name), found.library), found.library)
    assert again.chi2 == pytest.approx(last.chi2, rel=1e-6)


class Narrow:
    """A sum of squares with a narrow valley along its second parameter."""

    def chi2(self, Z):
        return np.where(np.abs(Z[:, 1] - 0.7123) < 0.002, 1.0, 10.0) + (Z[:, 0] - 0.2) ** 2


def test_a_narrow_valley_is_found_along_one_parameter():
    best = best_along(Narrow(), np.array([0.5, 0.5]), 1)
    assert best[0] == 0.5
    assert best[1] == pytest.approx(0.7123, abs=0.002)


EARNED, NOT_EARNED = Comparison(1.0, 0.0, (2.0, 1.0)), Comparison(-1.0, 1.0, (np.nan, np.nan))
PREDICTS_WORSE = Comparison(1.0, 0.0, (1.0, 2.0))


def a_fit(chi2, names, rough=False):
    """Return what a search asks of a fit; each letter is an effect."""
    known = {
        "residual": np.ones(9),
        "independent": 100.0,
        "misfit": 1.0,
        "is_noise": False,
        "crept": False,
        "names": tuple(names),
        "records": SimpleNamespace(replays=()),
    }
    return SimpleNamespace(active=tuple(map(EffectKey, names)), chi2=chi2, n_free=len(names), rough=rough, **known)


def known(*fits):
    return {frozenset(f.active): f for f in fits}


def test_what_is_found_of_a_size_later_takes_the_place_of_its_best(monkeypatch):
    """The right pair turned up only as an exchange beside a third effect, which does not earn its place then."""
    none, one, wrong, right, three = map(a_fit, (1e6, 1e5, 1e4, 101.0, 100.0), ("", "a", "bc", "ad", "abd"))
    levels = [SearchLevel((none,)), SearchLevel((one,), EARNED), SearchLevel((wrong,), EARNED)]
    monkeypatch.setattr(Search, "judged", lambda _, fits, smaller: SearchLevel(tuple(fits), EARNED))
    monkeypatch.setattr(Search, "note_round", lambda *_: None)
    search = Search(None, known(none, one, wrong, right, three))
    assert [level.best for level in search.renewed([*levels, SearchLevel((three,), NOT_EARNED)])] == [none, one, right]
    assert search.renewed([*levels, SearchLevel((three,), EARNED)])[-1].best is three
    del search.fits[frozenset(right.active)]
    assert search.renewed(levels) == levels


def test_in_a_large_set_effects_are_exchanged_only_where_it_earns_them(monkeypatch):
    sizes = [a_fit(10.0 ** (7 - n), "abcde"[:n]) for n in range(6)]
    monkeypatch.setattr(search_of, "train_residuals", lambda _: SimpleNamespace(diagnosis=SimpleNamespace(p=0.0)))
    for name, result in {"extend": None, "reach_further": False, "note_round": None}.items():
        monkeypatch.setattr(Search, name, lambda *_, result=result: result)
    exchanged = []
    monkeypatch.setattr(Search, "exchange", lambda _, size, smaller: exchanged.append(size))
    for comparison in (EARNED, NOT_EARNED):
        monkeypatch.setattr(Search, "judged", lambda _, fits, smaller, c=comparison: SearchLevel(tuple(fits), c))
        for size in (4, 5):
            Search(None, known(*sizes)).next_level(SearchLevel((sizes[size - 1],)), sizes[size - 1])
    assert exchanged == [4, 5, 4]


def test_beside_a_fit_that_creeps_nothing_is_exchanged_and_nothing_more_is_looked_for(monkeypatch):
    """Its chi2 is not that of its estimate: whatever follows a valley to its end would win."""
    one, two = a_fit(1e4, "a"), a_fit(1e3, "ab")
    two.crept = True
    monkeypatch.setattr(search_of, "train_residuals", lambda _: SimpleNamespace(diagnosis=SimpleNamespace(p=0.0)))
    monkeypatch.setattr(Search, "extend", lambda *_: None)
    monkeypatch.setattr(Search, "reach_further", lambda *_: False)
    monkeypatch.setattr(Search, "judged", lambda _, fits, smaller: SearchLevel(tuple(fits), EARNED))
    set_free = []
    monkeypatch.setattr(Search, "free_shapes", lambda _, fits: set_free.extend(fits))
    search = Search(None, known(one, two))
    level = search.next_level(SearchLevel((one,)), one)
    assert (level.best, search.next_level(level, one), set_free) == (two, None, [two])
    assert [each["refused"].partition(":")[0] for each in search.rounds] == [
        "", "the fit of a + b creeps and does not arrive",
    ]  # fmt: skip


def test_no_curve_is_looked_for_where_the_next_effect_creeps(monkeypatch):
    one, two = a_fit(1e4, "a"), a_fit(1e3, "ab")
    looked = []
    monkeypatch.setattr(closing, "empirical_term", lambda chosen, _: looked.append(chosen) or (None, None))
    monkeypatch.setattr(closing, "replace", lambda found, missing: found)
    monkeypatch.setattr(closing, "is_significant", lambda _: True)
    for fits, crept, sought, said in (
        ([one], (False, False), 1, []), ([one, two], (False, False), 1, []), ([one, two], (True, False), 0, ["a"]),
        ([one, two], (False, True), 0, ["a + b"]),
    ):  # fmt: skip
        one.crept, two.crept = crept
        search = Search(None, known(*fits))
        found = SimpleNamespace(search=search, chosen=one, refused=None, constants=None)
        assert closing.with_curve(found) is found
        assert closing.with_curve(found) is found
        assert [r["refused"] for r in search.rounds] == [f"the fit of {names} {search_of.CREEPS}" for names in said]
        assert looked == [one] * 2 * sought
        looked.clear()


@pytest.mark.slow
def test_a_pair_is_found_where_steps_over_a_narrow_sign_creep(tmp_path):
    """Campaign c381 of the families of seed 149: the arm nearly stops, and the drive that brakes loses most of itself.

    By continuation chi2 falls from 1.5 a sample to 0.6.
    """
    from stand import families

    files, _ = families.make(families.read_suite(families.SUITE), 149, ("two", 47))
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    campaign = read_campaign(tmp_path)
    names = ("line_loss", "quadratic_drag", "viscous", "worm_direction")
    closed = closing.close_loop(Model(campaign.plant), campaign, {n: EFFECTS[n] for n in names})
    assert {step.effect for step in closed.steps} == {"viscous", "worm_direction"}
    assert closed.after.holdout.errors.rmse < 1.1 * closed.after.holdout.noise_rms


def test_a_rival_of_a_fault_may_be_a_better_model_of_the_same_size(monkeypatch):
    """It turned up while one effect more was looked for; without it a sound record would be accused."""
    monkeypatch.setattr(search_of, "is_significant", lambda fit: fit.chi2 > 150.0)
    wrong, right, more, low = a_fit(1e4, "bc"), a_fit(101.0, "ad"), a_fit(100.0, "abd"), a_fit(45.0, "a", rough=True)
    given_up, alone = a_fit(9e3, "ac", rough=True), a_fit(9e3, "c", rough=True)

    def found_on_the_way(beside, level, smaller):
        beside.fits |= known(right, more, given_up, low, alone)
        return SearchLevel((more,), NOT_EARNED)

    library = SimpleNamespace(about=lambda *_: None)
    monkeypatch.setattr(Search, "next_level", found_on_the_way)
    search = Search(library, known(wrong))
    assert search.further(SearchLevel((wrong,)), 200.0) is right
    assert search.fits == known(wrong, right, more, given_up, low, alone)
    # what was given up above the limit will be fitted when it is asked for, unless the best is far below that limit
    search = Search(library, known(wrong))
    assert search.further(SearchLevel((wrong,)), 50.0) is None
    assert search.fits == known(wrong, right, more, low)
    assert Search(library, known(right)).further(SearchLevel((right,)), 200.0) is None
    # a model that fits better and predicts worse speaks against a fault as well
    monkeypatch.setattr(Search, "next_level", lambda *_: SearchLevel((more,), PREDICTS_WORSE))
    assert Search(library, known(wrong)).further(SearchLevel((wrong,)), 200.0) is more


def test_a_search_goes_on_from_levels_that_are_known(monkeypatch):
    none, one, two = a_fit(1e6, ""), a_fit(1e5, "a"), a_fit(100.0, "ab")
    asked = []

    def next_level(search, last, smaller):
        asked.append(last.best)
        search.fits |= known(two)
        return SearchLevel((two,), EARNED) if last.best is one else None

    monkeypatch.setattr(Search, "next_level", next_level)
    library = SimpleNamespace()
    library.about = lambda *_: library
    levels = Search(library, known(none, one)).run(known=[SearchLevel((none,)), SearchLevel((one,), EARNED)])
    assert [level.best for level in levels] == [none, one, two]
    assert asked == [one, two]


def test_a_fit_from_a_nearer_start_takes_the_place_of_a_local_one():
    local, better = a_fit(120.0, "ab"), a_fit(100.0, "ab")
    library = SimpleNamespace(say=lambda _: None, each=lambda work, items: [work(i) for i in items])
    search, key = Search(library, known(local)), frozenset(local.active)
    search.fit_each({key: lambda: better})
    assert search.fits[key] is local
    search.fit_each({key: lambda: better}, {key})
    assert search.fits[key] is better
    search.fit_each({key: lambda: local}, {key})
    assert search.fits[key] is better


@pytest.mark.slow
def test_another_form_of_an_effect_is_a_substitute_of_it_alone(stand):
    """As the square of the current, what saturates otherwise looks like another effect; its own form is asked for."""
    campaign = read_campaign(stand(*MANOEUVRES, "--effect", "flux_saturation=90", "coulomb=40"))
    model = Model(campaign.plant)
    two = {n: EFFECTS[n] for n in ("flux_saturation", "coulomb")}
    search = Search(library_of(model, two, whitened(campaign.train, model.plant), campaign.parameters, {}, {}))
    wrong, right = EffectKey("flux_saturation", "arctangent"), EffectKey("flux_saturation")
    fit = search.reduced(search.start(), (wrong, EffectKey("coulomb")))
    (other,) = substitutes(fit, search.library)
    assert (other.place, other.key) == (wrong, right)
    search.exchange_substitutes(fit)
    assert search.of_size(2)[0].active == (EffectKey("coulomb"), right)


def test_a_set_of_effects_outdoes_constants_where_it_fits_clearly_better(monkeypatch):
    """Constants that are far off only have to fit worse; a single effect is compared elsewhere."""
    monkeypatch.setattr(constants, "is_significant", lambda fit: fit.chi2 > 200.0)

    def outdone(off, chi2, n=2, p=1e-6, gain=9.0):
        monkeypatch.setattr(constants, "compare", lambda *_, n_extra: Comparison(gain, p, (np.nan, np.nan)))
        names = {f"constant:{i}": off for i in range(3)}
        model = ConstantModel(SimpleNamespace(chi2=100.0), names, 1.0)
        return is_outdone(model, SimpleNamespace(active=(None,) * n, chi2=chi2), 50)

    assert outdone(1.0, 60.0)
    assert not outdone(1.0, 60.0, n=1)
    assert not outdone(1.0, 60.0, p=0.1)
    assert not outdone(1.0, 60.0, gain=-1.0)
    assert not outdone(1.0, 201.0)
    # three constants by 3.5 tolerances each cost 37 beside the 100
    assert outdone(3.5, 119.0, p=1.0)
    assert not outdone(3.5, 138.0)


def test_constants_explain_what_noise_leaves_once_in_a_hundred_campaigns(monkeypatch):
    def explains(chance, *off):
        seen = SimpleNamespace(diagnosis=SimpleNamespace(p=chance))
        monkeypatch.setattr(constants, "train_residuals", lambda _: seen)
        return ConstantModel(None, {f"constant:{i}": u for i, u in enumerate(off)}, 1.0).explains

    assert explains(0.004, 1.0, -2.0)
    assert not explains(0.0009, 1.0, -2.0)
    assert not explains(0.5, 1.0, -4.0)
    assert not explains(0.5, 3.1)


def test_a_fault_that_changes_next_to_nothing_accuses_nobody():
    """What is left passed for noise after it, at a chance of 1.2 %, and did not before, at one of 0.6 %."""
    before = a_fit(4856.5, "abc")
    before.independent = 4234.0
    assert not is_earned(before, before, 4856.1, 40)
    assert not is_earned(before, before, 4856.5 * np.exp(-16.0 / 4234.0), 40)
    assert is_earned(before, before, 4856.5 * np.exp(-18.0 / 4234.0), 40)


def test_a_fault_that_left_noise_is_belied_by_more_effects(monkeypatch):
    """Without the record four effects were found where two and its clock had left noise: an effect of no library."""
    monkeypatch.setattr(sys.modules[Decision.__module__], "is_significant", lambda fit: fit.chi2 > 150.0)

    def claimed(beside, chosen):
        fit = a_fit(100.0, chosen)
        decided = Decision(None, None, fit, fit, fit, (), frozenset(chosen))
        return unless_belied(SimpleNamespace(fit=beside), decided).claimed

    assert claimed(a_fit(100.0, "ab"), "abcd") == frozenset()
    assert claimed(a_fit(100.0, "ab"), "ac") == {"a", "c"}
    # it left more than noise, though next to nothing of what there was
    assert claimed(a_fit(1000.0, ""), "a") == {"a"}


def test_beside_a_record_that_is_left_out_nothing_is_claimed(monkeypatch):
    """Which of two faults it is cannot be told: the record may as well be sound, and deny what the others show."""
    fit = a_fit(100.0, "b")
    monkeypatch.setattr(closing, "decide", lambda _: Decision(None, None, fit, fit, fit, (), frozenset("b")))
    records = tuple(SimpleNamespace(file=f"{name}.csv") for name in "abc")
    late, label = (
        SimpleNamespace(index=0, chi2=chi2, suspect=lambda *_, kind=kind: kind)
        for kind, chi2 in (("late", 100.0), ("label", 102.0))
    )
    library = SimpleNamespace(declared=SimpleNamespace(plant=None), data=SimpleNamespace(records=records))
    decided, suspects, rest = closing.decided_without_fault(lambda _: None, [late, label], library, records)
    assert (decided.chosen.active, decided.claimed) == (fit.active, frozenset())
    assert suspects == ["late", "label"]
    assert rest == records[1:]


def test_next_to_nothing_is_left_only_of_what_was_clearly_more_than_noise():
    """Where the level of the noise is known too high, chi2 is below its expectation, and any fault would do."""
    assert is_next_to_nothing(5001.0, 6000.0, 5000)
    assert not is_next_to_nothing(5020.0, 6000.0, 5000)
    assert not is_next_to_nothing(4844.0, 4910.0, 5000)
    assert not is_next_to_nothing(4990.0, 5200.0, 5000)


def test_a_simpler_effect_that_fits_as_well_does_not_deny_one_with_a_shape_more():
    """A lag of first order, and one of second order whose damping is searched at eight places."""

    def lagging(name, chi2, *nulls):
        values = {f"{name}.p{i}": 1.0 for i in range(len(nulls))}
        parameters = {n: SimpleNamespace(null=null) for n, null in zip(values, nulls, strict=True)}
        return SimpleNamespace(
            active=(EffectKey(name),), chi2=chi2, n_free=len(nulls), independent=5000.0, values=values,
            model=SimpleNamespace(parameters=parameters),
        )  # fmt: skip

    first, second = lagging("output_lag", 3000.0, 0.0), lagging("gyro_lag", 3000.5, 0.0, None)
    assert behind(second, first) > WITHIN
    assert group_of(first, first.active[0], [first, second]).rivals == ("gyro_lag",)
    worse = lagging("gyro_lag", 3002.0, 0.0, None)
    assert group_of(first, first.active[0], [first, worse]).rivals == ()
    # one with another strength is what it was
    strength = lagging("gyro_lag", 3000.5, 0.0, 0.0)
    assert group_of(first, first.active[0], [first, strength]).rivals == ()


def test_what_has_no_strength_is_no_substitute():
    assert likest(np.ones(3), np.empty((0, 3)), np.empty((3, 0))) is None


def test_keys_and_what_they_own():
    key = EffectKey("flux_saturation", "atan", free_shape=True)
    assert (key.compiled, key.public, key.declared) == (
        "flux_saturation_atan", "flux_saturation", EffectKey("flux_saturation", "atan"),
    )  # fmt: skip
    assert key.owns("flux_saturation_atan.level")
    assert not key.owns("flux_saturation_atan2.level")
    assert EffectKey("unnamed_torque").public == "unnamed:torque"


def test_work_is_shared_among_threads_and_comes_in_order():
    for threads in (1, 2, 5):
        assert side_by_side(lambda x: x * x, range(20), threads) == [x * x for x in range(20)]
        assert side_by_side(lambda x: x, [], threads) == []
    both = threading.Barrier(2, timeout=30.0)
    assert side_by_side(lambda _: both.wait() >= 0, range(2), 2) == [True, True]
    with pytest.raises(ZeroDivisionError):
        side_by_side(lambda x: 1 / x, [1, 0], 2)
