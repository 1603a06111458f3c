"""Scores, what stands behind them, and what could take an effect's place: geometry that the score does not use."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import armid
from armid.estimation.mends import Suspicion
from armid.inference.checks import square_along
from armid.inference.library import EffectKey
from armid.inference.model import decomposed
from armid.inference.refit import likest
from armid.inference.score_test import proven_biases, rest_of, score
from armid.loop import close_loop
from armid.model import EFFECTS, Model
from armid.record import read_campaign

DRAG, GAIN = "quadratic_drag", "drive_gain"
NAMES = ("coulomb", DRAG, "viscous")
T = np.linspace(0.0, 1.0, 400)
BASIS = np.linalg.qr(np.column_stack([np.ones_like(T), T]))[0]
CHANGE = 3.0 * np.sin(9.0 * T) + 5.0 * T


@pytest.fixture(scope="module")
def axis(write_axis, tmp_path_factory):
    """Return a campaign of an axis whose viscous friction is not declared, recorded with a little noise."""
    times = np.arange(401) / 200.0
    noise = 1e-3 * np.random.default_rng(1).standard_normal(401)
    speed = 8.0 / 5.0 * (1.0 - np.exp(-5.0 * times / 2.0)) + noise
    bounds = "[parameters.mass]\nlow = 1\nhigh = 4\n"
    return read_campaign(write_axis(tmp_path_factory.mktemp("axis"), speed, bounds))


@pytest.fixture(scope="module")
def closed(axis):
    return close_loop(Model(axis.plant), axis, {n: EFFECTS[n] for n in (*NAMES, GAIN)})


def test_the_drop_is_what_the_change_takes_off_the_residual(closed):
    current, rest = closed.before.fit, rest_of(closed.before.fit)
    slopes = current.jacobian / np.linalg.norm(current.jacobian, axis=0)
    for name in NAMES:
        found, change = score(current, EffectKey(name), closed.library)
        assert rest @ rest - np.sum((rest - change) ** 2) == pytest.approx(found.drop, rel=1e-9)
        assert found.drop <= found.alignment**2 * (rest @ rest) * (1.0 + 1e-9)
        assert 0.0 < found.share <= 1.0
        # none that the parameters could make
        assert np.max(np.abs(slopes.T @ change)) < 1e-6 * np.linalg.norm(change)


def test_friction_that_takes_the_whole_drive_is_named_though_its_range_is_half_of_that(closed):
    """At its steady speed of 1.6 m/s the axis loses all of its 8 N: 5 N s/m, where the range ends at 2.5."""
    assert closed.effects == ("viscous",)
    assert closed.parameters["viscous.slope"] == pytest.approx(5.0, rel=1e-3)


def test_of_two_effects_that_do_the_same_one_stands_for_both_until_they_are_told(write_axis, tmp_path):
    """Cogging whose second harmonic is 0 is a ripple: 0.8 N every 0.18 m."""
    times = np.arange(401) / 200.0

    def rates(_, state):
        return [state[1], (8.0 - 5.0 * state[1] + 0.8 * np.sin(34.2 * state[0] + 0.5)) / 2.0]

    moved = solve_ivp(rates, (0.0, 2.0), [0.0, 0.0], "DOP853", times, rtol=1e-10, atol=1e-12)
    speed = moved.y[1] + 1e-3 * np.random.default_rng(2).standard_normal(401)
    campaign = read_campaign(write_axis(tmp_path, speed, "[parameters.mass]\nlow = 1\nhigh = 4\n"))
    names = (*NAMES, "cogging", "torque_ripple")
    closed = close_loop(Model(campaign.plant), campaign, {n: EFFECTS[n] for n in names})
    twins = {s.twin.name for found in closed.search.scores.values() for s in found if s.twin is not None}
    assert twins & {"cogging", "torque_ripple"}
    step = next(s for s in closed.steps if s.effect in ("cogging", "torque_ripple"))
    assert {step.effect, *step.alternatives} == {"cogging", "torque_ripple"}
    assert closed.parameters["viscous.slope"] == pytest.approx(5.0, rel=1e-2)


def test_the_part_along_columns_is_that_of_a_decomposition_whatever_their_rank():
    for rank in (1, 3, 5):
        rng = np.random.default_rng(rank)
        columns = rng.standard_normal((300, rank)) @ rng.standard_normal((rank, 5)) * np.logspace(-3, 3, 5)
        values = rng.standard_normal(300)
        basis, inverse = decomposed(columns)
        square, found = square_along(columns, values)
        assert found == rank == basis.shape[1]
        assert square == pytest.approx(float(np.sum((basis.T @ values) ** 2)), rel=1e-9)
        np.testing.assert_allclose(columns @ (inverse @ values), basis @ (basis.T @ values), atol=1e-8)


def test_what_moves_the_signal_alike_is_found_with_its_amplitude():
    moved = np.array([np.cos(9.0 * T), 12.0 * np.sin(9.0 * T) - 40.0, np.full_like(T, np.nan)])
    place, correlation, amplitude = likest(CHANGE, moved, BASIS)
    assert place == 1
    assert correlation == pytest.approx(1.0, abs=1e-9)
    assert amplitude == pytest.approx(0.25, rel=1e-9)


def test_none_is_near_where_it_moves_otherwise_the_other_way_or_not_at_all():
    for moved in (np.cos(9.0 * T), -np.sin(9.0 * T), 2.0 + 7.0 * T, np.zeros_like(T)):
        assert likest(CHANGE, moved[np.newaxis], BASIS) is None


def test_a_bias_is_proven_where_another_strength_and_other_parameters_move_alike(closed):
    """Force, mass and friction that grow alike leave the motion as it is: 30 % is the most that is tried.

    Dry friction takes from the constant force what a smaller gain would; drag shows.
    """
    fit = closed.after.fit
    assert list(fit.values) == ["mass", "viscous.slope"]
    proven = proven_biases(fit, closed.library, 0.01)
    first = next(iter(proven))
    assert first in (GAIN, "coulomb")
    assert proven[first] / fit.x == pytest.approx([0.3, 0.3], rel=0.03)
    library = replace(closed.library, candidates={k: e for k, e in closed.library.candidates.items() if k.name == DRAG})
    assert all(np.all(bias < 0.05 * fit.x) for bias in proven_biases(fit, library, 0.01).values())
    assert all("could bias it by" in doubt for e in closed.after.estimates[:2] for doubt in e.doubts)
    assert not any(e.trusted for e in closed.after.estimates)


def test_what_could_bias_a_parameter_unseen_holds_the_error_that_it_made():
    """One stroke, synthetic: friction of 25 N m that the records do not show puts p0 off its true 3.05 MPa."""
    found = armid.close_loop("studies/campaigns/one_stroke")
    off = abs(found.parameters["p0"] / 3.05e6 - 1.0)
    assert 0.05 < off < 0.1
    proven = proven_biases(found.after.fit, found.library, 0.01)
    place = list(found.after.fit.values).index("p0")
    assert off < max(bias[place] for bias in proven.values()) / found.parameters["p0"] < 6.0 * off


def test_what_the_screen_suspects_is_told_where_the_loop_found_nothing_better(axis, monkeypatch):
    seen = [Suspicion(kind, "axis.csv", f"axis.csv: {kind}.") for kind in ("late", "unjudged", "rest")]
    monkeypatch.setattr(import_module("armid.loop.close_loop"), "screen", lambda *_: seen)
    explained, at_a_loss = (
        close_loop(Model(axis.plant), axis, {n: EFFECTS[n] for n in names}, curve=False)
        for names in (["viscous"], ["drive_gain"])
    )
    assert (explained.verdict, at_a_loss.verdict) == ("explained", "unexplained")
    assert "axis.csv: late." not in explained.next_steps
    assert at_a_loss.next_steps[:2] == ("axis.csv: late.", "axis.csv: rest.")
    for found in (explained, at_a_loss):
        assert "axis.csv: rest." in found.next_steps
        assert "axis.csv: unjudged." not in found.next_steps
