"""What one more record buys, against the intervals of records that were made."""

from dataclasses import replace

import numpy as np
import pytest

from armid.estimation.design import Motions, Offer, expected_level, gain, manoeuvre_grid, offers
from armid.estimation.information import Level, information_at
from armid.estimation.least_squares import refine
from armid.problem.replay import replays

TRUTH = np.array([3.05e6, 1.0, 0.55, 1.4])
NOISE = 0.25 * np.pi / 180.0


def with_noise(replay, rms=NOISE, effective_fraction=1.0):
    noise = replace(replay.record.noise, rms=rms, effective_fraction=effective_fraction)
    return replace(replay, record=replace(replay.record, noise=noise))


@pytest.fixture(scope="module")
def bought(paper_arm, arm, arm_space):
    """Offers after one lowering, by what they are ranked; the raising and the short stroke are among them."""
    told = tuple(with_noise(r) for r in replays(paper_arm.train, arm, arm_space))
    one = told[:1]
    information = information_at(one, arm_space, TRUTH)
    grid = manoeuvre_grid(arm, [r.record for r in told])
    motions = Motions(told, TRUTH, paper_arm.gyro_range)

    def ranked(by, level=Level(NOISE, 1.0)):
        return offers(motions, grid, arm_space, TRUTH, information.fisher, level, by)

    return told, information, ranked


def test_they_are_the_intervals_of_a_record_that_was_made(bought, arm_space):
    told, information, ranked = bought
    repeated = {o.feasible.repeats: o for o in ranked("volume") if o.feasible.repeats}
    for file, replay in (("raise.csv", told[3]), ("short.csv", told[4]), ("lower.csv", told[1])):
        made = information_at((told[0], replay), arm_space, TRUTH)
        np.testing.assert_allclose(repeated[file].after, made.deviation, rtol=2e-3)
        np.testing.assert_allclose(repeated[file].before, information.deviation, rtol=1e-6)
    np.testing.assert_allclose(repeated["lower.csv"].after, information.deviation / np.sqrt(2.0), rtol=2e-3)
    assert repeated["lower.csv"].gain == pytest.approx(np.sqrt(2.0), rel=1e-3)


def test_coloured_noise_buys_less(bought):
    _, _, ranked = bought
    white = {o.feasible: o for o in ranked("volume")}
    for offer in ranked("volume", Level(NOISE, 0.1))[::10]:
        assert (offer.after >= white[offer.feasible].after).all()
        assert offer.gain < white[offer.feasible].gain


@pytest.mark.parametrize("by", ["volume", "worst", "shrinkage"])
def test_they_are_ranked_and_none_does_harm(bought, by):
    _, _, ranked = bought
    found = ranked(by)
    gains = [o.gain for o in found]
    assert gains == sorted(gains, reverse=True)
    assert min(gains) >= 1.0
    assert all((o.after <= o.before * (1 + 1e-9)).all() for o in found)


def test_what_is_ranked_by_is_what_it_says():
    before, after = np.diag([100.0, 400.0]), np.diag([400.0, 3600.0])
    # with the box as a first record: 112, 412 and 412, 3612
    assert gain(before, after, "volume") == pytest.approx((412 * 3612 / (112 * 412)) ** 0.25)
    assert gain(before, after, "worst") == pytest.approx(np.sqrt(412 / 112))
    assert gain(before, after, "shrinkage") == pytest.approx(np.sqrt(3612 / 412))


def test_what_was_not_determined_counts_with_its_box():
    seen = np.diag([100.0, 0.0])
    assert gain(seen, np.diag([100.0, 36.0]), "shrinkage") == pytest.approx(2.0)
    offer = Offer(None, np.array([0.1, np.inf]), np.array([0.1, 0.5]), 2.0)
    assert offer.best == 1
    assert Offer(None, np.array([0.1, np.inf]), np.array([0.05, np.inf]), 2.0).best == 0


def test_the_level_to_expect():
    level = expected_level([Level(1.0, 1.0), Level(7.0, 0.5, from_residual=True)])
    assert (level.rms, level.effective_fraction, level.from_residual) == (5.0, 0.75, True)


def test_the_best_offer_holds_in_60_noises(bought, paper_arm, arm, arm_space):
    """Make the record that was advised, in 60 noises, and estimate: the spread is the one that was promised."""
    told, _, ranked = bought
    best = ranked("volume")[0]
    like = told[0]
    (piece,) = like.pieces
    new = replace(like, pieces=(replace(piece, manoeuvre=best.feasible.manoeuvre),))
    rng, found = np.random.default_rng(2), []
    clean = [r.signal(TRUTH[np.newaxis])[0] for r in (like, new)]
    for _ in range(60):
        noisy = tuple(
            replace(r, pieces=(replace(r.pieces[0], measured=s + NOISE * rng.normal(size=s.size)),))
            for r, s in zip((like, new), clean)
        )
        found.append(refine(noisy, arm_space, TRUTH))
    np.testing.assert_allclose(np.std(found, axis=0) / best.after, 1.0, atol=0.35)
    assert (np.std(found, axis=0) < 0.7 * best.before).any()
