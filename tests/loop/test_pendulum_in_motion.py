"""A pendulum whose records begin in motion, with noise that correlates from sample to sample and no rest to show it."""

import numpy as np
import pytest
from scipy.signal import lfilter

from armid.estimation.least_squares import with_fitted_starts
from armid.inference import prepared
from armid.inference.shooting import on_short_pieces, on_whole_records
from armid.loop import close_loop, report_of
from armid.model import EFFECTS, Model
from armid.problem.problem import by_record, replays
from armid.problem.space import space_of
from armid.record import read_campaign
from synthetic import moved, write_records

INERTIA, GRAVITY_MOMENT, NOISE, STEP_S = 0.02, 0.5, 0.02, 0.005
TOML = 'name = "swinging"\nplant = "driven_axis"\nhold = "zero"\n[constants]\ngain = 1.0\ngravity_moment = 0.5\n'


def swing(torque, friction, start):
    """Angle [rad] and speed [rad/s] of each sample, from a start (angle, speed)."""

    def rates(x, u):
        return np.array([x[1], (u - GRAVITY_MOMENT * np.sin(x[0]) - friction * x[1]) / INERTIA])

    return moved(rates, torque, STEP_S, start, "zero").T


def swinging(folder, friction, rho=0.35, n_records=4, seed=3, toml=TOML):
    """Write a campaign of swings, the last one held out; return it with the true starts."""
    rng, tables, starts = np.random.default_rng(seed), {}, []
    times = STEP_S * np.arange(500)
    for i in range(n_records):
        waves = zip(rng.uniform(0.3, 2.0, 4), rng.uniform(0.0, 6.0, 4), strict=True)
        torque = 0.07 * sum(np.sin(2.0 * np.pi * f * times + p) for f, p in waves)
        starts.append((rng.uniform(-0.3, 0.3), rng.uniform(-0.5, 0.5)))
        angle, speed = swing(torque, friction, starts[-1])
        noise = NOISE * lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], rng.standard_normal(len(times)))
        tables[f"r{i}.csv"] = {"time_s": times, "angular_velocity_rad_s": speed + noise, "drive_N_m": torque,
                               "angle_rad": angle + 1e-4 * rng.standard_normal(len(times))}  # fmt: skip
    return read_campaign(write_records(folder, toml, tables)), starts


def test_the_start_of_an_axis_is_fitted(tmp_path):
    """Its speed is known no better than noise lets the first samples tell, and a free swing keeps that for long."""
    campaign, starts = swinging(tmp_path / "c", 0.0)
    model = Model(campaign.plant)
    space = space_of(model)
    started = with_fitted_starts(replays(campaign.train, model, space), space)
    read, fitted = ([piece.manoeuvre.constants["start_speed"] for piece in pieces] for pieces in
                    ([r.pieces[0] for r in campaign.train], [r.pieces[0] for r in started]))  # fmt: skip
    truth = [speed for _, speed in starts[:-1]]
    assert np.abs(np.subtract(fitted, truth)).max() < 0.006 < np.abs(np.subtract(read, truth)).max()
    for replay in started:
        residual = replay.measured - replay.signal(np.array([[INERTIA]]))[0]
        assert np.sqrt(np.mean(residual**2)) == pytest.approx(NOISE, rel=0.1)
    assert not campaign.holdout[0].pieces[0].shown_start


def over_the_top(folder, commands, limit=np.inf):
    """Return a campaign of a pendulum that goes over the top, with a limit of its drive [N m]; the last is held out."""
    rng, tables = np.random.default_rng(1), {}
    for i, command in enumerate(commands):
        angle, _ = swing(np.clip(command, -limit, limit), 0.01, (0.0, 0.0))
        tables[f"r{i}.csv"] = {"time_s": STEP_S * np.arange(len(command)), "drive_N_m": command,
                               "angle_rad": angle + 1e-3 * rng.standard_normal(len(command))}  # fmt: skip
    assert max(np.ptp(table["angle_rad"]) for table in tables.values()) > 2.0 * np.pi
    toml = 'name = "over"\nplant = "rotary_arm"\nhold = "zero"\n[parameters.gain]\nfixed = 1.0\n'
    return read_campaign(write_records(folder, toml, tables))


def test_a_pendulum_that_goes_over_the_top_is_estimated_from_the_beginning_of_its_records(tmp_path):
    """Simulated for long from a parameter that is a little off, it goes over the top another time."""
    rng = np.random.default_rng(1)
    commands = [np.repeat([0.0, *rng.choice([-0.45, 0.0, 0.45], 11)], 100) for _ in range(3)]
    campaign = over_the_top(tmp_path / "c", commands)
    _, declared = prepared(Model(campaign.plant), campaign, {})
    assert declared.x == pytest.approx([INERTIA, GRAVITY_MOMENT, 0.01], rel=1e-3)


@pytest.mark.nightly
def test_what_its_drive_lacks_is_found_on_short_pieces_of_its_records(tmp_path):
    """Over a whole record the motion without it has nothing in common with what was measured."""
    rng, messages = np.random.default_rng(2), []
    commands = [np.repeat([0.0, *rng.uniform(-0.7, 0.7, 11)], 100) for _ in range(3)]
    campaign = over_the_top(tmp_path / "c", commands, limit=0.4)
    candidates = {n: EFFECTS[n] for n in ("drive_saturation", "viscous")}
    found = close_loop(Model(campaign.plant), campaign, candidates, told=messages.append)
    assert "looking at short pieces of the records" in messages
    assert [(s.effect, s.form) for s in found.steps] == [("drive_saturation", "hard")]
    sharpness = next(e for e in found.after.estimates if e.name == "drive_saturation.sharpness")
    assert sharpness.value == pytest.approx(1.0 / 0.4, rel=5e-3)


def test_short_pieces_are_all_of_a_record_and_start_where_it_is(tmp_path):
    campaign, _ = swinging(tmp_path / "c", 0.01, toml=TOML.replace("driven_axis", "rotary_arm").replace(
        "[constants]\ngain = 1.0\ngravity_moment = 0.5\n", "[parameters.gain]\nfixed = 1.0\n"))  # fmt: skip
    library, declared = prepared(Model(campaign.plant), campaign, {})
    short, fit = on_short_pieces(library, declared)
    assert [len(r.pieces) for r in short.data.records] == [4] * 3
    assert [sum(r.lengths) for r in short.data.records] == [sum(r.lengths) for r in library.data.records]
    for record in (ready.record for ready in by_record(fit.records.replays)):
        for piece in record.pieces:
            there = record.signals[0].measured[piece.start_index]
            assert piece.manoeuvre.constants["start_angle"] == pytest.approx(there, abs=1e-3)
    again = on_whole_records(fit, library)
    assert again.x == pytest.approx(declared.x, rel=1e-4)
    assert again.chi2 == pytest.approx(declared.chi2, rel=1e-4)
    assert declared.chi2 < 1.3 * len(declared.residual)
    problem = declared.records
    assert problem.beginning(0.25).chi2(declared.z)[0] < 0.5 * problem.chi2(declared.z)[0]


@pytest.mark.slow
def test_friction_that_is_a_parameter_of_the_plant_is_not_looked_for(tmp_path):
    """No record can tell two shares of one damping: an interval from none to all of it would help nobody."""
    campaign, _ = swinging(tmp_path / "c", 0.01, toml='name = "swinging"\nplant = "rotary_arm"\nhold = "zero"\n')
    candidates = {name: EFFECTS[name] for name in ("coulomb", "viscous", "quadratic_drag")}
    found = close_loop(Model(campaign.plant), campaign, candidates)
    assert (found.verdict, found.steps) == ("no_discrepancy", ())
    assert report_of(found)["probabilities"]["among"][0] == 2
    assert "viscous would do what damping does already, and was not looked for" in found.known_together
    damping = next(e for e in found.before.estimates if e.name == "damping")
    assert damping.low < 0.01 < damping.high < 0.015


@pytest.mark.nightly
def test_nothing_is_missing_where_noise_has_a_colour_that_no_rest_shows(tmp_path):
    candidates = {name: EFFECTS[name] for name in ("coulomb", "viscous", "torque_offset")}
    clean, _ = swinging(tmp_path / "clean", 0.0)
    found = close_loop(Model(clean.plant), clean, candidates)
    assert (found.verdict, found.also, found.steps, found.suspects) == ("no_discrepancy", (), (), ())
    # how the held-out record starts is known from few samples: that is doubt, and no misfit
    assert found.before.holdout.doubted
    estimate = found.before.estimates[0]
    assert estimate.low < INERTIA < estimate.high
    damped, _ = swinging(tmp_path / "damped", 0.01)
    found = close_loop(Model(damped.plant), damped, candidates)
    assert (found.verdict, [s.effect for s in found.steps], found.suspects) == ("explained", ["viscous"], ())
