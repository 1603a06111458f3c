"""Manoeuvres that could be made next: what the reader accepts, what the machine can do, what a record would buy."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armid.estimation.design import (
    Feasible,
    Motions,
    Offer,
    as_recorded,
    expected_levels,
    gain,
    is_place,
    key_travel,
    manoeuvre_grid,
    offers,
    words,
)
from armid.estimation.information import information_at
from armid.estimation.noise_model import Level
from armid.model import ManoeuvreKey, Model
from armid.problem.problem import replays
from armid.problem.space import space_of
from armid.record import read_campaign
from armid.record.reader import record_constants
from armid.record.schema import RecordSheet
from changed_records import with_noise

TRUTH = np.array([3.05e6, 1.0, 0.55, 1.4])
DEGREE = np.pi / 180.0


def test_the_grid_of_the_arm_is_what_campaign_toml_could_say(paper_arm, arm):
    grid = manoeuvre_grid(arm, paper_arm.train)
    assert 100 <= len(grid) <= 200
    for f in grid:
        sheet = RecordSheet(file="new.csv", role="train", keys=f.keys)
        told = record_constants(arm.plant, paper_arm.constants, sheet, "new.csv")
        for name, value in told.items():
            assert f.manoeuvre.constants[name] == pytest.approx(value, abs=1e-12)
        assert abs(f.keys["start_angle_deg"] - f.keys["target_angle_deg"]) >= 15.0
        assert min(f.keys["start_angle_deg"], f.keys["target_angle_deg"]) > -55.0
        assert f.manoeuvre.n_samples == 1201
    assert {f.keys["shell"] for f in grid} == {True, False}
    assert {f.keys["supply_V"] for f in grid} == {28.0, 24.0}
    # what was recorded is there once and first, in the window of the records
    assert [f.repeats for f in grid if f.repeats] == ["lower.csv", "raise.csv", "short.csv"]
    assert [bool(f.repeats) for f in grid[:4]] == [True, True, True, False]
    short = paper_arm.with_window(0.1, 0.7)
    for f in manoeuvre_grid(arm, short.train)[::20]:
        assert (f.window, f.manoeuvre.n_samples) == (slice(100, 701), 701)


def test_words_of_a_manoeuvre_and_places_among_its_keys(arm):
    stroke = {"start_angle_deg": 20.0, "target_angle_deg": -40.0, "shell": False, "supply_V": 24.0}
    assert words(stroke, "") == "raise, empty, 24 V from 20 to -40 deg"
    assert words(stroke | {"target_angle_deg": 44.0, "shell": True}, "a.csv") == (
        "a.csv once more (lower, with shell, 24 V from 20 to 44 deg)"
    )
    assert words({"speed_rad_s": 2.0, "clutch": True, "brake": False, "gear": 3.0}, "") == (
        "speed 2 rad/s, clutch, no brake, gear 3"
    )
    assert words({"like": "a.csv", "size": -0.5, "pace": 2.0}, "") == (
        "the inputs of a.csv reversed, 0.5 of their size, 2 times as fast"
    )
    assert words({"like": "a.csv"}, "a.csv") == "a.csv once more"
    plant = arm.plant
    assert [k.key for k in plant.keys if is_place(plant, k)] == ["start_angle_deg", "target_angle_deg"]
    assert key_travel(plant) == {"theta": (-55.0 * DEGREE, 45.0 * DEGREE)}
    load = ManoeuvreKey("load_kg", "m_loaded", 1.0, 0.0, 500.0, required=True)
    assert not is_place(replace(plant, keys=(*plant.keys, load)), load)


def test_a_stroke_that_leaves_the_travel_or_does_not_move_is_passed_over(paper_arm, arm, arm_space):
    template, ready = as_recorded(arm.plant, paper_arm.train[0]), replays(paper_arm.train[2:], arm, arm_space)

    def told(**constants):
        changed = {**template.manoeuvre.constants, **constants}
        return Feasible({}, replace(template.manoeuvre, constants=changed), template.window)

    fine = told()
    hung = told(U=1.0, m_loaded=72.5, L_loaded=0.41)
    over = told(theta_D=44.9 * DEGREE, K_d=1.0, theta_C=-54.0 * DEGREE)
    found = dict(Motions(ready, TRUTH, None).signals([fine, over, hung], TRUTH[np.newaxis]))
    assert set(found) >= {fine}
    assert over not in found
    # nor does the sensor show what is too fast for it
    grid = manoeuvre_grid(arm, paper_arm.train)
    able, slow = (dict(Motions(ready, TRUTH, limit * DEGREE).signals(grid, TRUTH[np.newaxis]))
                  for limit in (200.0, 100.0))  # fmt: skip
    assert 0 < len(slow) < len(able) <= len(grid)
    assert max(np.abs(s).max() for s in slow.values()) <= 100.0 * DEGREE < max(np.abs(s).max() for s in able.values())


def test_recorded_inputs_are_changed(write_axis, axis_model, tmp_path):
    """Of an axis under a drive that changes its sign, with a supply that does not."""
    campaign = read_campaign(write_axis(tmp_path / "axis"))
    (record,) = campaign.train
    times = record.times
    inputs = {"u": 8.0 * np.sin(6.0 * times), "supply": np.full(times.size, 24.0)}

    def with_inputs(manoeuvre, **more):
        return replace(manoeuvre, inputs=inputs, **more)

    def told(**more):
        pieces = tuple(replace(p, manoeuvre=with_inputs(p.manoeuvre, **more)) for p in record.pieces)
        return replace(record, pieces=pieces)

    made = told()
    grid = {f.name.removeprefix("the inputs of move.csv "): f for f in manoeuvre_grid(Model(campaign.plant), [made])}
    u = inputs["u"]
    assert len(grid) == 12
    half = grid["reversed, 0.5 of their size"].manoeuvre.inputs
    np.testing.assert_allclose(half["u"], -0.5 * u)
    assert all((f.manoeuvre.inputs["supply"] == 24.0).all() for f in grid.values())
    fast = grid["2 times as fast"].manoeuvre.inputs["u"]
    np.testing.assert_allclose(fast[:201], u[::2])
    slow = grid["0.5 times as fast"].manoeuvre.inputs["u"]
    np.testing.assert_allclose(slow[::2], u[:201])
    # a held input stays held
    held = {f.name: f for f in manoeuvre_grid(Model(campaign.plant), [told(hold="zero")])}
    slow = held["the inputs of move.csv 0.5 times as fast"].manoeuvre.inputs["u"]
    np.testing.assert_array_equal(slow[:400:2], slow[1:400:2])
    # the axis moves no further and no faster than it did
    space = space_of(axis_model, bounds={"mass": (1.0, 4.0), "viscous.slope": (1.0, 10.0)})
    candidate = space.complete(np.array([[2.0, 5.0]]))
    motions = Motions(replays([made], axis_model, space), candidate[0])
    able = {f.name for f, _ in motions.signals(manoeuvre_grid(axis_model, [made]), candidate)}
    assert able >= {"move.csv once more", "the inputs of move.csv 0.5 of their size"}
    assert "the inputs of move.csv 0.5 times as fast" not in able


NOISE = 0.25 * np.pi / 180.0


def test_they_are_the_intervals_of_a_record_that_was_made(paper_arm, arm, arm_space):
    """Offers after one lowering, by what they are ranked; the raising and the short stroke are among them."""
    records = [with_noise(r, rms=NOISE, effective_fraction=1.0) for r in paper_arm.train]
    told = replays(records, arm, arm_space)
    one = told[:1]
    information = information_at(one, arm_space, TRUTH)
    grid = manoeuvre_grid(arm, [r.record for r in told])
    motions = Motions(told, TRUTH, paper_arm.gyro_range)

    def ranked(by, level=Level(NOISE, 1.0)):
        return offers(motions, grid, arm_space, TRUTH, information.fisher, [level], by)

    repeated = {o.feasible.repeats: o for o in ranked("volume") if o.feasible.repeats}
    for file, replay in (("raise.csv", told[3]), ("short.csv", told[4]), ("lower.csv", told[1])):
        made = information_at((told[0], replay), arm_space, TRUTH)
        np.testing.assert_allclose(repeated[file].after, made.deviation, rtol=2e-3)
        np.testing.assert_allclose(repeated[file].before, information.deviation, rtol=1e-6)
    np.testing.assert_allclose(repeated["lower.csv"].after, information.deviation / np.sqrt(2.0), rtol=2e-3)
    assert repeated["lower.csv"].gain == pytest.approx(np.sqrt(2.0), rel=1e-3)
    for found in map(ranked, ("volume", "worst", "shrinkage")):
        gains = [o.gain for o in found]
        assert gains == sorted(gains, reverse=True)
        assert min(gains) >= 1.0
        assert all((o.after <= o.before * (1 + 1e-9)).all() for o in found)
    # coloured noise buys less
    white = {o.feasible: o for o in ranked("volume")}
    for offer in ranked("volume", Level(NOISE, 0.1))[::10]:
        assert (offer.after >= white[offer.feasible].after).all()
        assert offer.gain < white[offer.feasible].gain


def test_what_is_ranked_by_is_what_it_says_at_the_level_to_expect():
    before, after = np.diag([100.0, 400.0]), np.diag([400.0, 3600.0])
    # with the box as a first record: 112, 412 and 412, 3612
    assert gain(before, after, "volume") == pytest.approx((412 * 3612 / (112 * 412)) ** 0.25)
    assert gain(before, after, "worst") == pytest.approx(np.sqrt(412 / 112))
    assert gain(before, after, "shrinkage") == pytest.approx(np.sqrt(3612 / 412))
    # what was not determined counts with its box
    seen = np.diag([100.0, 0.0])
    assert gain(seen, np.diag([100.0, 36.0]), "shrinkage") == pytest.approx(2.0)
    offer = Offer(None, np.array([0.1, np.inf]), np.array([0.1, 0.5]), 2.0)
    assert offer.best == 1
    assert Offer(None, np.array([0.1, np.inf]), np.array([0.05, np.inf]), 2.0).best == 0
    told = [SimpleNamespace(place=place) for place in (0, 1, 0)]
    level, other = expected_levels(told, [Level(1.0, 1.0), Level(0.1, 1.0), Level(7.0, 0.5)])
    assert other.rms == 0.1
    assert (level.rms, level.effective_fraction) == (5.0, 0.75)
