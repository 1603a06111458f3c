"""How finely time is cut: as finely as the error asks for."""

from importlib import import_module

import numpy as np

from arm_cases import box_of
from armid.engine import Schedule, calibrate, probes, simulate
from armid.inference.library import quickly_calibrated
from armid.model import EFFECTS, PLANTS, Manoeuvre, Model


def test_probes_fill_the_box_and_what_cannot_be_reached_is_said(arm):
    low, high = box_of(arm)
    spread = (probes(low, high, 200) - low) / (high - low)
    assert spread.shape == (200, 4)
    assert np.all((spread > 0.0) & (spread < 1.0))
    # every tenth of every side is visited about as often as it should
    for side in spread.T:
        assert np.histogram(side, 10, (0.0, 1.0))[0].min() >= 14
    assert probes(np.empty(0), np.empty(0), 3).shape == (3, 0)
    axis = Model(PLANTS["driven_axis"])
    coarse = Manoeuvre(10.0, 30, {"gravity_moment": 4000.0}, {"u": np.sin(np.arange(30.0))})
    assert not calibrate(axis, coarse, np.array([[1.0]]), "fine").reached


def test_a_finer_accuracy_takes_more_steps_errors_are_honest_and_a_long_record_is_cut_in_parts(
    arm, manoeuvres, monkeypatch
):
    """Within a factor of two of the difference to a much finer run."""
    spread = probes(*box_of(arm))
    standard, fine = (calibrate(arm, manoeuvres["empty"], spread, a, spans=False) for a in ("standard", "fine"))
    assert standard.schedule.substeps < fine.schedule.substeps
    assert (standard.reached, fine.reached, fine.error < standard.error) == (True, True, True)
    run, finest = (simulate(arm, manoeuvres["empty"], spread, s).output for s in (standard.schedule, Schedule(24)))
    assert 0.5 <= standard.error / np.abs(run - finest).max() <= 2.0
    whole = calibrate(arm, manoeuvres["lower"], spread, spans=False)
    monkeypatch.setattr(import_module("armid.engine.calibrate"), "MOST_OF_PROBES", 1000)
    parts = calibrate(arm, manoeuvres["lower"], spread)
    assert parts.schedule.substeps == whole.schedule.substeps
    assert parts.schedule.plan is None
    assert parts.reached
    assert whole.error <= parts.error <= 3.0 * whole.error


def test_long_steps_are_taken_where_candidates_could_try_them(arm, manoeuvres):
    spread = probes(*box_of(arm))
    for name in ("lower", "raise_empty"):
        found = calibrate(arm, manoeuvres[name], spread, "fine")
        assert found.schedule.plan is not None
        switched = simulate(arm, manoeuvres[name], spread, Schedule(2)).switch_times["closed"]
        longest_from = int(np.argmax(found.schedule.plan == found.schedule.plan.max()))
        assert np.count_nonzero(switched > 1e-3 * longest_from) >= 8
    # where all have switched none is long
    assert calibrate(arm, manoeuvres["inside_E"], spread).schedule.plan is None


RUBBED = Model(PLANTS["driven_axis"], (EFFECTS["coulomb"], EFFECTS["viscous"]))


def rubbing():
    """Return a motion that turns back often, in friction whose sign changes between two samples, and 20 candidates."""
    times = 0.01 * np.arange(400)
    drive = 2.0 * np.sin(2.0 * times) + 1.5 * np.sin(7.3 * times)
    middle = {"mass": 1.0, "coulomb.level": 0.5, "coulomb.width": 0.01, "viscous.slope": 0.2}
    values = np.array([middle[n] for n in RUBBED.parameters])
    spread = np.random.default_rng(4).uniform(0.9, 1.1, (20, len(values)))
    return Manoeuvre(0.01, 400, {}, {"u": drive}), values * spread


def test_only_rough_samples_are_cut():
    manoeuvre, candidates = rubbing()
    finest = simulate(RUBBED, manoeuvre, candidates, Schedule(64)).output
    ranges = np.ptp(finest, axis=1).max() * np.ones(len(RUBBED.states))
    error, steps = {}, {}
    for share in (1e-3, 1e-4, 1e-5):
        run = simulate(RUBBED, manoeuvre, candidates, Schedule(8, rough=share * ranges))
        error[share], steps[share] = np.abs(run.output - finest).max(), run.n_steps
    even = {n: np.abs(simulate(RUBBED, manoeuvre, candidates, Schedule(n)).output - finest).max() for n in (1, 2, 4)}
    assert error[1e-3] > error[1e-4] > error[1e-5]
    assert steps[1e-3] < steps[1e-4] < steps[1e-5]
    # with half of the steps it is nearer than with four everywhere
    assert steps[1e-5] < 2.0
    assert error[1e-5] < even[4] < even[2] < even[1]
    # whatever runs beside it
    schedule = Schedule(8, rough=1e-4 * ranges)
    alone = [simulate(RUBBED, manoeuvre, c, schedule).output[0] for c in candidates]
    assert np.array_equal(np.array(alone), simulate(RUBBED, manoeuvre, candidates, schedule, threads=2).output)


def test_the_loop_spares_steps_where_friction_asks_for_many_and_what_is_cut_changes_smoothly():
    manoeuvre, candidates = rubbing()
    found = quickly_calibrated(RUBBED, manoeuvre, candidates[:8])
    assert found.reached
    assert found.schedule.rough is not None
    run, finest = (simulate(RUBBED, manoeuvre, candidates, s) for s in (found.schedule, Schedule(64)))
    assert run.n_steps < found.schedule.substeps
    assert np.abs(run.output - finest.output).max() < 5e-6 * RUBBED.plant.sizes[0]
    # The slope of a misfit along a fine line is the same over a short and a long way.
    schedule = Schedule(8, rough=1e-4 * np.array([1.0] * len(RUBBED.states)))
    line = candidates[0] * (1.0 + 1e-6 * np.arange(400)[:, np.newaxis] * np.array([1.0, -0.7, 0.5, 0.9]))
    record = simulate(RUBBED, manoeuvre, candidates[1], schedule).output[0]
    misfit = np.sqrt(np.mean((simulate(RUBBED, manoeuvre, line, schedule).output - record) ** 2, axis=1))
    short, long = ((misfit[100 + n : 300 + n] - misfit[100 - n : 300 - n]) / (2 * n) for n in (10, 100))
    assert np.max(np.abs(short - long)) < 1e-2 * np.max(np.abs(long))


def test_steps_are_spared_where_more_than_eight_are_asked_for_and_next_to_what_no_steps_follow():
    manoeuvre, candidates = rubbing()
    sharp, width = candidates[:8].copy(), list(RUBBED.parameters).index("coulomb.width")
    sharp[:, width] /= 4.0
    stiff = np.vstack([sharp, sharp[:1]])
    stiff[-1, width] = 1e-5
    for tried, is_reached in ((sharp, True), (stiff, False)):
        found = quickly_calibrated(RUBBED, manoeuvre, tried)
        assert found.reached == is_reached
        assert found.schedule.rough is not None
        assert found.schedule.refinement >= found.schedule.substeps > 8
        run, finest = (simulate(RUBBED, manoeuvre, sharp, s) for s in (found.schedule, Schedule(128)))
        assert run.n_steps < 0.6 * found.schedule.substeps
        assert np.abs(run.output - finest.output).max() < 5e-6 * RUBBED.plant.sizes[0]
