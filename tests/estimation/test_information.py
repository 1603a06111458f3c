"""Sensitivities, intervals and correlations: what the records say about the parameters."""

from dataclasses import replace

import numpy as np
import pytest
from linear_records import linear_records
from scipy.optimize import least_squares, lsq_linear
from scipy.signal import lfilter
from scipy.stats import chi2

from armid.engine import Schedule
from armid.estimation.identify_document import details_of
from armid.estimation.information import (
    PROFILE_RISE,
    collinear,
    information_at,
    information_of,
    profiles,
    sensitivities,
)
from armid.estimation.least_squares import estimate, fit
from armid.problem.problem import replays
from armid.problem.space import space_of
from armid.record import read_campaign
from changed_records import noisy

TRUTH = np.array([3.05e6, 1.0, 0.55, 1.4])
DEGREE = np.pi / 180.0
NOISE = 0.25 * DEGREE


def with_noise(replay, rms, effective_fraction=1.0):
    return noisy(replay, rms=rms, effective_fraction=effective_fraction)


@pytest.fixture(scope="module")
def several(paper_arm, arm, arm_space):
    """One lowering, one raising, one short stroke, 0.7 s of each."""
    return tuple(with_noise(r, NOISE) for r in replays(paper_arm.with_window(0.0, 0.7).train[2:], arm, arm_space))


def test_the_reference_arm_on_one_stroke_with_more_with_coloured_and_without_noise(lowering_replays, arm_space):
    information = information_at((with_noise(lowering_replays[0], 0.3 * DEGREE),), arm_space, TRUTH)
    # one sigma of 0.26, 0.06, 0.39, 0.84 % was found with another program for white noise of 0.3 deg/s on 0 to 0.7 s
    np.testing.assert_allclose(100 * information.deviation / TRUTH, [0.26, 0.06, 0.39, 0.84], atol=0.006)
    np.testing.assert_allclose(information.half_width, 1.959963985 * information.deviation)
    plain, loud, coloured = (
        information_at((with_noise(lowering_replays[0], rms, share),), arm_space, TRUTH)
        for rms, share in ((NOISE, 1.0), (3 * NOISE, 1.0), (NOISE, 0.25))
    )
    np.testing.assert_allclose(loud.deviation, 3 * plain.deviation)
    np.testing.assert_allclose(coloured.deviation, 2 * plain.deviation)
    clean = lowering_replays[0].measuring(lowering_replays[0].signal(TRUTH[np.newaxis])[0])
    information = information_at((with_noise(clean, 0.0),), arm_space, TRUTH)
    (level,) = information.levels
    assert level.assumed
    assert not level.from_residual
    assert level.rms == pytest.approx(1e-3 * np.sqrt(np.mean(clean.measured**2)))
    assert collinear(information)


def test_correlations_of_one_stroke(lowering_replays, several, arm_space):
    one = information_at(lowering_replays, arm_space, TRUTH)
    np.testing.assert_allclose(np.diag(one.correlation), 1.0)
    np.testing.assert_allclose(one.correlation, one.correlation.T)
    pairs = collinear(one)
    assert {frozenset(pair[:2]) for pair in pairs} >= {frozenset(("p0", "n")), frozenset(("p0", "eta3"))}
    assert [abs(r) for *_, r in pairs] == sorted((abs(r) for *_, r in pairs), reverse=True)
    many = information_at(several, arm_space, TRUTH)
    assert (many.deviation < one.deviation).all()


def test_what_the_model_lacks_widens(lowering_replays, arm_space):
    replay = with_noise(lowering_replays[0], NOISE)
    swinging = 3.0 * DEGREE * np.sin(2 * np.pi * 8.0 * replay.times)
    lacking = information_at((replay.measuring(replay.measured + swinging),), arm_space, TRUTH)
    plain = information_at((replay,), arm_space, TRUTH)
    assert not plain.levels[0].from_residual
    level = lacking.levels[0]
    assert level.from_residual
    assert level.rms == pytest.approx(np.hypot(3.0 / np.sqrt(2), 0.25) * DEGREE, rel=0.02)
    assert level.effective_fraction < 0.1
    widening = level.rms / NOISE / np.sqrt(level.effective_fraction)
    np.testing.assert_allclose(lacking.deviation, widening * plain.deviation)
    # a slightly loud record is still one whose noise is known
    assert not information_at((with_noise(replay, 0.8 * NOISE),), arm_space, TRUTH).levels[0].from_residual


def test_what_probes_elsewhere_lose_in_the_engine_hides_no_misfit(lowering_replays, arm_space, lowering_found):
    """Probes over the top of an unbalanced disc said that the engine is off by more than the whole residual."""
    replay = with_noise(lowering_replays[0], NOISE)
    swinging = replay.measuring(replay.measured + 3.0 * DEGREE * np.sin(2 * np.pi * 8.0 * replay.times))
    off = tuple(replace(c, error=100.0, reached=False) for c in swinging.calibrations)
    level = information_at((swinging.changed(calibrations=off),), arm_space, TRUTH).levels[0]
    assert level.from_residual
    coarse = tuple(r.changed(calibrations=off) for r in lowering_found.train_replays)
    coarsely = replace(lowering_found, train_replays=coarse)
    assert not any("the engine is off" in text for text in details_of(coarsely)["remarks"])
    # where the engine itself is off at the estimate, what it leaves is not misfit
    rough = tuple(replace(c, schedule=Schedule(1, refinement=1)) for c in replay.calibrations)
    wrong = with_noise(replay, 1e-9).changed(calibrations=rough)
    clean = wrong.measuring(replay.signal(TRUTH[np.newaxis])[0])
    assert clean.engine_error_at(TRUTH) > 0.0
    assert not information_at((clean,), arm_space, TRUTH).levels[0].from_residual


def drawn(rng, n_samples, phi):
    """Return noise of rms NOISE with correlation phi from sample to sample."""
    return lfilter([1.0], [1.0, -phi], rng.normal(0.0, NOISE * np.sqrt(1.0 - phi**2), n_samples + 200))[200:]


@pytest.mark.parametrize("phi", [0.0, 0.7])
def test_intervals_cover_the_truth(several, arm_space, phi):
    """Estimate by least squares in 100 noises: 95 % intervals, where 85 to 100 may be right, spread as they say."""
    rng, span = np.random.default_rng(5), arm_space.high - arm_space.low
    told = tuple(with_noise(r, NOISE, (1 - phi) / (1 + phi)) for r in several)
    information = information_at(told, arm_space, TRUTH)
    clean = np.concatenate([r.signal(TRUTH[np.newaxis])[0] for r in told])
    steps = 1e-4 * np.diag(span)

    def signals(X):
        return np.concatenate([r.signal(X) for r in told], axis=1)

    def slopes(z, measured):
        both = signals(np.concatenate([z * span + steps, z * span - steps]))
        return (both[:4] - both[4:]).T / 2e-4

    def residual(z, measured):
        return signals(z[np.newaxis] * span)[0] - measured

    found = []
    for _ in range(100):
        measured = clean + np.concatenate([drawn(rng, r.measured.size, phi) for r in told])
        found.append(least_squares(residual, TRUTH / span, slopes, args=(measured,), xtol=1e-7).x * span)
    misses = np.array(found) - TRUTH
    covered = np.mean(np.abs(misses) <= information.half_width, axis=0)
    assert ((covered >= 0.85) & (covered <= 1.0)).all()
    np.testing.assert_allclose(misses.std(axis=0) / information.deviation, 1.0, atol=0.25)


def test_at_the_minimum_the_step_is_small_and_away_from_it_is_large(lowering_replays, arm_space):
    best = estimate(lowering_replays, arm_space)
    at_best = information_at(lowering_replays, arm_space, best)
    assert np.abs(at_best.step).max() < 0.2
    assert 0.0 <= at_best.gain < 0.01
    # where a bound holds one parameter, those that go with it have come as far as they can
    narrow = arm_space.with_bounds("eta3", 0.45, 0.545)
    held = estimate(lowering_replays, narrow)
    assert held[2] == 0.545
    assert np.abs(information_at(lowering_replays, narrow, held).step).max() < 0.2
    away = best + 8.0 * np.array([0.0, 1.0, 0.0, 0.0]) * at_best.deviation
    assert information_at(lowering_replays, arm_space, away).step[1] == pytest.approx(-8.0, rel=0.2)
    # where a search stops far off, what is left is smooth and widens the deviations, so that the step looks small
    far = information_at(lowering_replays, arm_space, best + 200.0 * np.array([0.0, 1.0, 0.0, 0.0]) * at_best.deviation)
    assert far.levels[0].from_residual
    assert far.gain > 0.9


@pytest.fixture(scope="module")
def axis(write_axis, axis_model, tmp_path_factory):
    campaign = read_campaign(write_axis(tmp_path_factory.mktemp("sensitivity")))
    space = space_of(axis_model, bounds={"mass": (1.0, 4.0), "viscous.slope": (1.0, 10.0)})
    return replays(campaign.train, axis_model, space, "fine")[0], space


def started(replay, error, deviation):
    """Return the replay, said to start from a speed that is off, known with some deviation."""

    def told(piece):
        speed = piece.manoeuvre.constants["start_speed"] + error
        manoeuvre = replace(piece.manoeuvre, constants=piece.manoeuvre.constants | {"start_speed": speed})
        return replace(piece, manoeuvre=manoeuvre, start_deviation=deviation, shown_start={})

    return replay.changed(record=replay.record.with_pieces(told))


def test_intervals_cover_the_truth_in_spite_of_a_noisy_start(axis):
    rng, (replay, space), truth = np.random.default_rng(11), axis, np.array([3.0, 1.5])
    noise, start_noise = 0.01, 0.01 * np.sqrt(4.0 / 11.0)
    clean, z = replay.signal(truth[np.newaxis])[0], []
    for _ in range(40):
        told = with_noise(replay, noise).measuring(clean + noise * rng.normal(size=clean.size))
        told, x = started(told, start_noise * rng.normal(), {"start_speed": start_noise}), truth
        for _ in range(4):
            information = information_at((told,), space, x)
            without = information_at((started(told, 0.0, {}),), space, x)
            x = x + without.step * without.deviation
        z.append((x - truth) / information.deviation)
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.4
    assert (information.deviation > 2.0 * without.deviation).any()


def closed_form(replay, mass, slope, drive=8.0):
    """Return d v/d mass and d v/d slope of v = F/c + (v0 - F/c) exp(-c t/m), (n_samples, 2)."""
    t, v0 = replay.times, replay.pieces[0].manoeuvre.constants["start_speed"]
    decay, away = np.exp(-slope * t / mass), v0 - drive / slope
    by_mass = away * decay * slope * t / mass**2
    by_slope = -drive / slope**2 * (1.0 - decay) - away * decay * t / mass
    return np.column_stack([by_mass, by_slope])


def test_agree_with_the_closed_form_of_an_axis(axis):
    replay, space = axis
    # the last on a corner of the box, where the step is moved inside
    for mass, slope, within in ((2.0, 5.0, 1e-4), (1.3, 9.0, 1e-4), (3.7, 1.5, 1e-4), (1.0, 10.0, 2e-3)):
        expected = closed_form(replay, mass, slope) * (space.high - space.low)[space.free]
        found = sensitivities(replay, space, np.array([mass, slope]))
        np.testing.assert_allclose(found, expected, atol=within * np.max(np.abs(expected)))


def test_linear_records_with_other_weights_than_those_of_the_noise_and_with_two_names_for_one_thing():
    """Two records that tell as much of one parameter, the second four times as loud, in a sum of squares of both alike.

    The mean of both has the variance (s1^2 + s2^2)/4n, not that of the weighted mean.
    """
    n, loud = 50, 4.0
    design = np.concatenate([np.ones(n), np.full(n, 1.0 / loud)])[:, np.newaxis]
    records = linear_records(design, 0.4 * design[:, 0])
    weighed = np.concatenate([np.ones(n), np.full(n, loud**2)])
    span = 10.0
    best = information_of(records, np.array([0.4])).deviation / span
    alike = information_of(records, np.array([0.4]), weighed=weighed).deviation / span
    assert best == pytest.approx([(n + n / loud**2) ** -0.5])
    assert alike == pytest.approx([np.sqrt(1.0 + loud**2) / np.sqrt(4.0 * n)])
    assert information_of(records, np.array([0.5]), weighed=weighed).step == pytest.approx(-0.1 * span / (alike * span))
    a, b = np.random.default_rng(1).normal(size=(2, 30))
    records = linear_records(np.column_stack([a, b, b]), 0.4 * a)
    np.testing.assert_array_equal(np.isinf(information_of(records, np.full(3, 0.4)).deviation), [False, True, True])


def seen_by(design, z, rng):
    return design @ z + rng.normal(size=len(design))


def test_of_a_linear_model_it_is_the_parabola():
    assert pytest.approx(chi2.ppf(0.95, 1)) == PROFILE_RISE
    rng = np.random.default_rng(3)
    design = 60.0 * rng.normal(size=(50, 3))
    design[:, 1] += 2.0 * design[:, 0]
    records = linear_records(design, seen_by(design, np.array([0.4, 0.5, 0.6]), rng))
    best, found = profiles(records, np.full(3, 0.5))
    deviation = 10.0 * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    np.testing.assert_allclose(best, np.linalg.lstsq(design, records.measured)[0], atol=1e-7)
    for p, d in zip(found, deviation, strict=True):
        assert p.bounded == (True, True)
        assert p.agrees
        np.testing.assert_allclose(p.deviation, d, rtol=1e-6)
        np.testing.assert_allclose([p.low, p.high], p.estimate + np.array([-1, 1]) * 1.95996 * d, atol=2e-3 * d)
        np.testing.assert_allclose(p.rise, ((p.values - p.estimate) / d) ** 2, atol=1e-5)
        assert (np.diff(p.values) >= 0.0).all()
        assert p.rise[[0, -1]].min() > PROFILE_RISE


@pytest.mark.parametrize("seed", range(3))
def test_with_bounds_it_is_the_bounded_solution(seed):
    """Hold a parameter, solve for the others in the box with another program: the same rise at every point."""
    rng = np.random.default_rng(seed)
    design = 10.0 * rng.normal(size=(30, 3))
    design[:, 0] = design[:, 1] - design[:, 2] + 0.5 * rng.normal(size=30)
    records = linear_records(design, seen_by(design, np.array([0.02, 0.5, 0.97]), rng))
    _, found = profiles(records, np.full(3, 0.5))
    least = 2.0 * lsq_linear(design, records.measured, bounds=(0.0, 1.0), tol=1e-14).cost
    for i, p in enumerate(found):
        others = [j for j in range(3) if j != i]
        for value, rise in zip(p.values, p.rise, strict=True):
            rest = records.measured - design[:, i] * (value - 10.0) / 10.0
            told = 2.0 * lsq_linear(design[:, others], rest, bounds=(0.0, 1.0), tol=1e-14).cost
            assert rise == pytest.approx(told - least, abs=1e-3)
        assert p.low == 10.0 or p.bounded[0]
        assert p.high == 20.0 or p.bounded[1]
        assert p.low <= p.estimate <= p.high
    assert any(not p.agrees for p in found)


def test_what_is_not_seen_a_bound_and_a_region_that_diverges_leave_their_sides_open_or_bounded():
    design = np.column_stack([40.0 * np.linspace(0.5, 1.0, 20), np.zeros(20)])
    _, (seen, unseen) = profiles(linear_records(design, design @ [0.5, 0.5]), np.array([0.4, 0.4]))
    assert seen.bounded == (True, True)
    assert unseen.bounded == (False, False)
    assert (unseen.low, unseen.high) == (10.0, 20.0)
    assert np.isinf(unseen.deviation)
    assert unseen.agrees
    np.testing.assert_allclose(unseen.rise, 0.0, atol=1e-9)
    design = 30.0 * np.eye(2)
    _, (held, _) = profiles(linear_records(design, design @ [-0.05, 0.5]), np.array([0.5, 0.5]))
    assert held.bounded == (False, True)
    assert held.estimate == held.low == 10.0
    # (30 z + 1.5)^2 - 1.5^2 = 3.84
    assert held.high == pytest.approx(10.0 + 10.0 * (np.sqrt(PROFILE_RISE + 2.25) - 1.5) / 30.0, abs=2e-3)
    assert len(held.values) > 5
    design = 5.0 * np.eye(2)
    _, (p, _) = profiles(linear_records(design, design @ [0.5, 0.5], lost=0.6), np.array([0.4, 0.4]))
    assert p.bounded[1]
    assert p.high == pytest.approx(16.0, abs=0.05)
    assert np.isfinite(p.rise).all()


class TwoValleys(type(linear_records(np.eye(1), np.zeros(1)))):
    """Signals whose sum of squares has a second, deeper valley."""

    def signals(self, Z):
        z = np.atleast_2d(Z)[:, :1]
        return np.concatenate([20.0 * (z - 0.2) * (z - 0.8), 2.0 * (z - 0.8)], axis=1)


def test_a_profile_that_finds_a_deeper_valley_starts_again_there():
    plain = linear_records(np.ones((2, 1)), np.zeros(2))
    records = TwoValleys((), plain.space, plain.design, np.zeros(2))
    assert fit(records, np.array([0.1]))[0] < 0.3
    best, (p,) = profiles(records, np.array([0.1]))
    assert best[0] == pytest.approx(0.8, abs=1e-6)
    assert p.rise.min() >= 0.0
