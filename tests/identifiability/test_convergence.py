"""Where a search has not come to the minimum, and what the noise of a measured start does to an estimate."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from armid.engine import calibrate, probes
from armid.estimation.information import information_at
from armid.model import EFFECTS, Manoeuvre, Model
from armid.model.plants.driven_axis import linear_axis
from armid.problem.replay import Replay
from armid.problem.space import space_of
from armid.record import Noise, Piece, Record

TRUTH = np.array([3.05e6, 1.0, 0.55, 1.4])
INTERVAL, NOISE, MASS, SLOPE, SPEED = 2e-3, 0.01, 1.8, 0.4, 0.3


def test_at_the_minimum_the_step_is_small_and_away_from_it_is_large(lowering_replays, arm_space):
    span = arm_space.high - arm_space.low
    replay = lowering_replays[0]

    def residual(z):
        return (replay.signal((z * span)[np.newaxis])[0] - replay.measured) / replay.record.noise.rms

    bounds = (arm_space.low / span, arm_space.high / span)
    best = least_squares(residual, TRUTH / span, bounds=bounds, x_scale="jac", diff_step=1e-5).x * span
    at_best = information_at(lowering_replays, arm_space, best)
    assert np.abs(at_best.step).max() < 0.2
    away = best + 8.0 * np.array([0.0, 1.0, 0.0, 0.0]) * at_best.deviation
    assert information_at(lowering_replays, arm_space, away).step[1] == pytest.approx(-8.0, rel=0.2)


def axis_replay(rng, start_noise):
    """A linear axis with viscous friction, started from a speed that was measured with noise."""
    model = Model(replace(linear_axis, scales=replace(linear_axis.scales, effort=2.0, speed=0.5))) + EFFECTS["viscous"]
    times = INTERVAL * np.arange(1501)
    drive = 2.0 * np.sin(4.0 * times)
    given = {"u": drive}
    true = Manoeuvre(INTERVAL, 1501, {"start_speed": SPEED}, given)
    told = Manoeuvre(INTERVAL, 1501, {"start_speed": SPEED + start_noise * rng.normal()}, given)
    space = space_of(model, bounds={"mass": (1.0, 3.0), "viscous.slope": (0.1, 1.0)})
    calibration = calibrate(model, told, space.complete(probes(space.low[space.free], space.high[space.free])))
    noise = Noise(NOISE, None, 0.0, 1.0, 1501, "differences")

    def replay(manoeuvre, measured):
        piece = Piece(manoeuvre, measured, slice(0, 1501), start_deviation={"start_speed": start_noise})
        record = Record("a.csv", "train", "m/s", manoeuvre, measured, np.empty(0), noise, (piece,), (piece,))
        return Replay(record, model, (piece,), (calibration,))

    clean = replay(true, np.zeros(1501)).signal(np.array([[MASS, SLOPE]]))[0]
    return replay(told, clean + NOISE * rng.normal(size=1501)), space


def test_intervals_cover_the_truth_in_spite_of_a_noisy_start():
    rng = np.random.default_rng(11)
    start_noise = NOISE * np.sqrt(4.0 / 11.0)
    z = []
    for _ in range(40):
        replay, space = axis_replay(rng, start_noise)
        x = np.array([MASS, SLOPE])
        for _ in range(4):
            information = information_at((replay,), space, x)
            without = information_at((surely_started(replay),), space, x)
            x = x + without.step * without.deviation
        z.append((x - [MASS, SLOPE]) / information.deviation)
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.4
    assert (information.deviation > 2.0 * without.deviation).any()


def surely_started(replay):
    """The same record, said to start from a state that is known: no noise of the start is reckoned with."""
    return replace(replay, pieces=tuple(replace(piece, start_deviation={}) for piece in replay.pieces))
