"""How finely time is cut: as finely as the error asks for."""

from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest

from arm_cases import box_of
from armid.engine import Schedule, calibrate, probes, simulate
from armid.engine.calibrate import FINE, Calibration
from armid.engine.simulate import chebyshev, stages_as_stable_as
from armid.estimation.design import fine_schedule
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


def test_steps_are_spared_where_friction_asks_for_many_and_what_is_cut_changes_smoothly():
    manoeuvre, candidates = rubbing()
    for calibrated in (quickly_calibrated, calibrate):
        found = calibrated(RUBBED, manoeuvre, candidates[:8])
        assert found.reached
        assert found.schedule.rough is not None
        # a manoeuvre to come is simulated more finely, where it is rough as well
        schedules = (found.schedule, fine_schedule([SimpleNamespace(calibrations=(found,))]), Schedule(64))
        run, finer, finest = (simulate(RUBBED, manoeuvre, candidates, s) for s in schedules)
        assert run.n_steps < finer.n_steps < found.schedule.substeps
        error, less = (np.abs(one.output - finest.output).max() for one in (run, finer))
        assert less < error < 5e-6 * RUBBED.plant.sizes[0]
    assert calibrate(RUBBED, manoeuvre, candidates[:8], FINE).schedule.rough is None
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


def test_steps_at_hand_are_kept_where_they_are_accurate_enough_whatever_their_number():
    manoeuvre, candidates = rubbing()
    own = quickly_calibrated(RUBBED, manoeuvre, candidates[:8])
    everywhere = Calibration(Schedule(own.schedule.substeps), own.error, True)
    in_few = replace(own, schedule=replace(own.schedule, substeps=16, refinement=16, rough=1e3 * own.schedule.rough))
    for at_hand, is_kept in (
        (own, True),
        (everywhere, True),
        (in_few, False),
        (Calibration(Schedule(1), 0.0, True), False),
    ):
        found = quickly_calibrated(RUBBED, manoeuvre, candidates[:8], at_hand=at_hand)
        assert (found is at_hand) == is_kept
        assert found.error < 5e-6 * RUBBED.plant.sizes[0]


@pytest.mark.parametrize("n", [2, 3, 6, 12])
def test_stable_steps_are_of_second_order_and_bear_fast_decays(n):
    rows = chebyshev(n)

    def step(rate, y, h):
        slope = rate(0.0, y)
        older, newer = y, y + h * rows[0, 2] * slope
        for mu, nu, own, first, c in rows[1:n]:
            rest = h * (own * rate(c * h, newer) + first * slope)
            older, newer = newer, (1.0 - mu - nu) * y + mu * newer + nu * older + rest
        return newer

    def missed(h):
        halves = step(lambda t, y: np.cos(t + h / 2) - y**2, step(lambda t, y: np.cos(t) - y**2, 1.0, h / 2), h / 2)
        return abs(step(lambda t, y: np.cos(t) - y**2, 1.0, h) - halves)

    assert missed(0.05) / missed(0.025) == pytest.approx(8.0, rel=0.1)
    decays = np.linspace(0.05, 0.65, 1000) * (n**2 - 1)
    assert np.abs(step(lambda t, y: -decays * y, np.ones(1000), 1.0)).max() < 1.0
    assert np.all(rows[1:, 4] > rows[:-1, 4])
    assert [stages_as_stable_as(n) for n in (8, 32)] == [6, 12]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "share"),
    [((), 1e-4), (("drive_delay",), 1e-4), (("output_delay",), 1e-4), (("dead_zone",), 1e-4), (("backlash",), 1e-6)],
)
def test_friction_that_holds_takes_few_steps(more, share):
    """As accurate as with fine steps alone, in less than half of them; the last swings, and has kinks in stable steps.

    Where motion swings, stable steps are as accurate as they are asked to be, and spare nothing.
    """
    plant = PLANTS["flexible_link" if more == ("backlash",) else "driven_axis"]
    model = Model(plant, tuple(EFFECTS[name] for name in ("coulomb", *more)))
    middle = {"mass": 0.4, "coulomb.level": 0.9, "coulomb.width": 1e-3, "drive_delay.delay": 0.023,
              "output_delay.delay": 0.017, "hub_inertia": 0.4, "tip_inertia": 0.1, "stiffness": 4.0,
              "hub_damping": 0.2, "link_damping": 0.02}  # fmt: skip
    values = np.array([middle.get(n, 0.5 * (p.low + p.high)) for n, p in model.parameters.items()])
    candidates = values * np.random.default_rng(3).uniform(0.9, 1.1, (16, len(values)))
    times = 0.01 * np.arange(600)
    manoeuvre = Manoeuvre(0.01, 600, {}, {"u": 1.2 * np.sin(1.3 * times) + 0.4 * np.sin(7.1 * times)})
    finest = simulate(model, manoeuvre, candidates, Schedule(128), states=True)
    ranges = np.array([np.ptp(state) for state in finest.states.values()])
    fine = Schedule(16, refinement=16, rough=share * ranges)
    stable = replace(fine, stages=stages_as_stable_as(16))
    runs = [simulate(model, manoeuvre, candidates, s) for s in (Schedule(16), fine, stable)]
    even, finely, stably = (np.abs(run.outputs - finest.outputs).max() for run in runs)
    assert stably < 2.0 * max(finely, even)
    assert stably < 2e-4 * np.ptp(finest.outputs)
    assert more == ("backlash",) or runs[2].n_steps < 0.5 * runs[1].n_steps
    alone = [simulate(model, manoeuvre, c, stable).outputs[:, 0] for c in candidates]
    assert np.array_equal(np.swapaxes(alone, 0, 1), simulate(model, manoeuvre, candidates, stable, threads=2).outputs)
