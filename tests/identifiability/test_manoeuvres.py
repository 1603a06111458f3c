"""Manoeuvres that could be made next: what the reader would accept, and what the machine could do."""

from dataclasses import replace

import numpy as np
import pytest

from armid.estimation.design import Feasible, Motions, as_recorded, is_place, key_travel, manoeuvre_grid, words
from armid.model import ManoeuvreKey, Model
from armid.problem.replay import replays
from armid.problem.space import space_of
from armid.record import read_campaign
from armid.record.reader import record_constants
from armid.record.schema import RecordSheet

TRUTH = np.array([[3.05e6, 1.0, 0.55, 1.4]])
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


def test_what_was_recorded_is_there_once_and_first(paper_arm, arm):
    grid = manoeuvre_grid(arm, paper_arm.train)
    assert [f.repeats for f in grid if f.repeats] == ["lower.csv", "raise.csv", "short.csv"]
    assert [bool(f.repeats) for f in grid[:4]] == [True, True, True, False]


def test_the_window_is_that_of_the_records(paper_arm, arm):
    short = paper_arm.with_window(0.1, 0.7)
    for f in manoeuvre_grid(arm, short.train)[::20]:
        assert (f.window, f.manoeuvre.n_samples) == (slice(100, 701), 701)


def test_places_are_told_from_other_keys(arm):
    plant = arm.plant
    assert [k.key for k in plant.keys if is_place(plant, k)] == ["start_angle_deg", "target_angle_deg"]
    assert key_travel(plant) == {"theta": (-55.0 * DEGREE, 45.0 * DEGREE)}
    load = ManoeuvreKey("load_kg", "m_loaded", 1.0, 0.0, 500.0, required=True)
    assert not is_place(replace(plant, keys=(*plant.keys, load)), load)


def test_words():
    arm = {"start_angle_deg": 20.0, "target_angle_deg": -40.0, "shell": False, "supply_V": 24.0}
    assert words(arm, "") == "raise, empty, 24 V from 20 to -40 deg"
    assert words(arm | {"target_angle_deg": 44.0, "shell": True}, "a.csv") == (
        "a.csv once more (lower, with shell, 24 V from 20 to 44 deg)"
    )
    assert words({"speed_rad_s": 2.0, "clutch": True, "brake": False, "gear": 3.0}, "") == (
        "speed 2 rad/s, clutch, no brake, gear 3"
    )
    assert words({"like": "a.csv", "size": -0.5, "pace": 2.0}, "") == (
        "the inputs of a.csv reversed, 0.5 of their size, 2 times as fast"
    )
    assert words({"like": "a.csv"}, "a.csv") == "a.csv once more"


@pytest.fixture(scope="module")
def motions(paper_arm, arm, arm_space):
    ready = replays(paper_arm.train[2:], arm, arm_space)
    return lambda limit: Motions(ready, TRUTH[0], limit)


def test_what_the_arm_cannot_do_is_passed_over(motions, paper_arm, arm):
    grid = manoeuvre_grid(arm, paper_arm.train)
    able = dict(motions(200.0 * DEGREE).signals(grid, TRUTH))
    slow = dict(motions(100.0 * DEGREE).signals(grid, TRUTH))
    assert 0 < len(slow) < len(able) <= len(grid)
    assert all(np.abs(s).max() <= 100.0 * DEGREE for s in slow.values())
    assert any(np.abs(s).max() > 100.0 * DEGREE for s in able.values())


def test_a_stroke_that_leaves_the_travel_or_does_not_move_is_passed_over(motions, paper_arm, arm):
    template = as_recorded(arm.plant, paper_arm.train[0])

    def told(**constants):
        changed = {**template.manoeuvre.constants, **constants}
        return Feasible({}, replace(template.manoeuvre, constants=changed), template.window)

    fine = told()
    hung = told(U=1.0, m_loaded=72.5, L_loaded=0.41)
    over = told(theta_D=44.9 * DEGREE, K_d=1.0, theta_C=-54.0 * DEGREE)
    found = dict(motions(None).signals([fine, over, hung], TRUTH))
    assert set(found) >= {fine}
    assert over not in found


@pytest.fixture
def driven(write_axis, tmp_path):
    """An axis under a drive that changes its sign, with a supply that does not."""
    campaign = read_campaign(write_axis(tmp_path / "axis"))
    (record,) = campaign.train
    times = record.times
    inputs = {"u": 8.0 * np.sin(6.0 * times), "supply": np.full(times.size, 24.0)}

    def with_inputs(manoeuvre, **more):
        return replace(manoeuvre, inputs=inputs, **more)

    def told(**more):
        pieces = tuple(replace(p, manoeuvre=with_inputs(p.manoeuvre, **more)) for p in record.pieces)
        return replace(record, pieces=pieces)

    return campaign, told


def test_recorded_inputs_are_changed(driven):
    campaign, told = driven
    record = told()
    grid = {f.name.removeprefix("the inputs of move.csv "): f for f in manoeuvre_grid(Model(campaign.plant), [record])}
    u = record.pieces[0].manoeuvre.inputs["u"]
    assert len(grid) == 12
    half = grid["reversed, 0.5 of their size"].manoeuvre.inputs
    np.testing.assert_allclose(half["u"], -0.5 * u)
    assert all((f.manoeuvre.inputs["supply"] == 24.0).all() for f in grid.values())
    fast = grid["2 times as fast"].manoeuvre.inputs["u"]
    np.testing.assert_allclose(fast[:201], u[::2])
    slow = grid["0.5 times as fast"].manoeuvre.inputs["u"]
    np.testing.assert_allclose(slow[::2], u[:201])


def test_a_held_input_stays_held(driven):
    campaign, told = driven
    record = told(hold="zero")
    grid = {f.name: f for f in manoeuvre_grid(Model(campaign.plant), [record])}
    slow = grid["the inputs of move.csv 0.5 times as fast"].manoeuvre.inputs["u"]
    np.testing.assert_array_equal(slow[:400:2], slow[1:400:2])


def test_an_axis_moves_no_further_and_no_faster_than_it_did(driven, axis_model):
    _, told = driven
    record = told()
    space = space_of(axis_model, bounds={"mass": (1.0, 4.0), "viscous.slope": (1.0, 10.0)})
    ready = replays([record], axis_model, space)
    candidate = space.complete(np.array([[2.0, 5.0]]))
    able = {f.name for f, _ in Motions(ready, candidate[0]).signals(manoeuvre_grid(axis_model, [record]), candidate)}
    assert "move.csv once more" in able
    assert "the inputs of move.csv 0.5 of their size" in able
    assert "the inputs of move.csv 0.5 times as fast" not in able
