"""Advice on the next record: chances against brute force, and records that were then made."""

from dataclasses import replace

import numpy as np
import pytest
from linear_records import linear_records
from scipy.stats import multivariate_normal

from armid.engine import Calibration, Schedule, simulate
from armid.errors import ArmidError
from armid.estimation.advice import (
    BETTER_BY,
    OFTEN,
    Advice,
    Prediction,
    Rival,
    advice_of,
    advise,
    chance,
    entropy,
    normal_draws,
    outside,
    simulate_refits,
    spread_of,
)
from armid.estimation.design import Motions, manoeuvre_grid
from armid.estimation.least_squares import estimate, refine, weighted_records
from armid.model import EFFECTS
from armid.problem.problem import ReadyRecord, Replay
from armid.problem.space import space_of
from armid.record import Noise, Piece, Record, Signal

DEGREE = np.pi / 180.0
NOISE = 0.5 * DEGREE
APART = (0.3, 0.6, 0.8, 1.2)
TRUTH = {"p0": 3.05e6, "k": 1.0, "eta3": 0.55, "n": 1.4, "coulomb.level": 10.0, "viscous.slope": 5.0}


def linear_rivals(rng, apart):
    """Return two linear rivals that fit 30 old samples about equally well, and their designs old and new.

    apart: how far the two differ on a new record.
    """
    common = 60.0 * rng.normal(size=(30, 3))
    old = [common, common + 0.1 * rng.normal(size=(30, 3))]
    new = [20.0 * rng.normal(size=(25, 3)), apart * rng.normal(size=(25, 3))]
    new[1] = new[0] + new[1]
    seen = old[0] @ np.array([0.4, 0.5, 0.6]) + rng.normal(size=30)
    rivals = []
    for name, design in zip("AB", old):
        records = linear_records(design, seen)
        z = np.linalg.lstsq(design, seen)[0]
        rivals.append(Rival(name, records, z, float(records.chi2(z)[0])))
    return rivals, old, new, seen


def least(design, seen):
    return float(np.sum((seen - design @ np.linalg.lstsq(design, seen)[0]) ** 2))


def brute_force(rivals, old, new, seen, rng, n=1500):
    """Return how often A wins by more than the threshold: draw its parameters and a new record, fit both again."""
    right, wins = rivals[0], 0
    for _ in range(n):
        z = right.z + right.root @ rng.normal(size=3)
        record = np.concatenate([seen, new[0] @ z + rng.normal(size=25)])
        d = least(np.vstack([old[1], new[1]]), record) - least(np.vstack([old[0], new[0]]), record)
        wins += d > BETTER_BY
    return wins / n


def brute_entropy(rivals, new, rng, n=1500):
    """Return the mean entropy of the posterior after a record of A, by the normal distribution of all its samples."""
    spreads = [design @ r.root for design, r in zip(new, rivals)]
    normals = [multivariate_normal(d @ r.z, np.eye(25) + s @ s.T) for d, r, s in zip(new, rivals, spreads)]
    records = normals[0].rvs(n, random_state=rng)
    logs = np.array([-0.5 * r.criterion + m.logpdf(records) for r, m in zip(rivals, normals)])
    share = 1.0 / (1.0 + np.exp(np.clip(logs[1] - logs[0], -50.0, 50.0)))
    return float(np.mean([-sum(p * np.log2(p) for p in (s, 1.0 - s) if p > 0.0) for s in share]))


def test_chances_of_linear_models_are_those_of_brute_force():
    told, entropies = [], []
    for seed, apart in enumerate(APART):
        rng = np.random.default_rng(seed)
        rivals, old, new, seen = linear_rivals(rng, apart)
        told.append(brute_force(rivals, old, new, seen, rng))
        a, b = (Prediction(n @ r.z, n @ r.root) for n, r in zip(new, rivals))
        forecast, _ = chance(a, b, rivals[1].criterion - rivals[0].criterion, normal_draws(7, 512))
        assert forecast == pytest.approx(told[-1], abs=0.05)
        of = dict(zip("AB", new))
        won, delta, left = simulate_refits(rivals, 0, lambda r, Z, of=of: Z @ of[r.name].T, normal_draws(3, 60))
        entropies.append(brute_entropy(rivals, new, rng))
        assert left == pytest.approx(entropies[-1], abs=0.08)
        assert won[0] == 1.0
        assert won[1] == pytest.approx(told[-1], abs=0.08)
        assert delta[0] == 0.0 < delta[1]
    # neither all nor nothing
    assert min(told) < 0.3
    assert max(told) > 0.7
    assert sum(0.1 < t < 0.9 for t in told) >= 2
    assert max(entropies) > min(entropies) + 0.2


def test_what_the_box_cuts_off_does_not_count():
    """A draw stays in the box where its mirror does."""
    rng = np.random.default_rng(0)
    (rival, _), *_ = linear_rivals(rng, 1.0)
    held = replace(rival, z=np.array([0.0, 0.5, 0.5]))
    for draw in normal_draws(3, 40):
        assert held.drawn(draw)[0] >= 0.0
    np.testing.assert_allclose(outside(np.array([[0.2, 1.0], [-0.1, 1.3]])), [0.0, 0.3])
    here, above, below = np.zeros(5), np.full((2, 5), 3.0), np.full((2, 5), -1.0)
    np.testing.assert_array_equal(spread_of(here, above, below, np.array([0.5, 1.0]))[0], [2.0, 3.0])


def candidate(model):
    return np.array([TRUTH.get(name, p.fixed) for name, p in model.parameters.items()])


def made(model, manoeuvre, window, rng, file):
    """Return the record that the truth gives, with noise."""
    run = simulate(model, manoeuvre, candidate(model)[np.newaxis], Schedule(4))
    measured = run.output[0] + NOISE * rng.normal(size=manoeuvre.n_samples)
    piece, noise = Piece(manoeuvre, window), Noise(NOISE, 0.0, 1.0, 1000, "rest")
    return Record(file, "train", manoeuvre, (Signal("", "rad/s", measured, np.empty(0), noise),), (piece,), (piece,))


def fitted(name, model, records, start=None):
    space = space_of(model)
    calibrations = (Calibration(Schedule(2), 1e-6, True),)
    ready = tuple(Replay(ReadyRecord(r, model, calibrations)) for r in records)
    x = estimate(ready, space) if start is None else refine(ready, space, start)
    problem = weighted_records(ready, space)
    return Rival(name, problem, problem.shares(x), float(problem.chi2(problem.shares(x))[0]))


def whitening(rivals):
    """Return signals of a new record of one output in units of the noise of the only old one."""
    (weight,) = rivals[0].records.weights
    return lambda signals: weight * signals[0]


@pytest.fixture(scope="module")
def models(arm):
    return {name: arm + EFFECTS[name] for name in ("coulomb", "viscous")}


@pytest.fixture(scope="module")
def stroke(paper_arm):
    """The manoeuvre of the lowering, 0.7 s of it."""
    return paper_arm.train[0].pieces[0].manoeuvre.shortened(701)


@pytest.fixture(scope="module")
def rivals(models, stroke):
    record = made(models["viscous"], stroke, slice(0, 701), np.random.default_rng(4), "lower.csv")
    return [fitted(name, model, [record]) for name, model in models.items()]


@pytest.mark.nightly
def test_a_louder_sensor_tells_less_apart_and_twins_nothing_does(rivals):
    (replay,) = rivals[0].records.replays
    repeated, *others = manoeuvre_grid(replay.model, [replay.record])
    some = others[4::30]
    with pytest.raises(ArmidError, match="1 model was given: at least two are expected"):
        advise(rivals[:1], whitening(rivals), some)
    twin = replace(rivals[1], name="twin")
    for advice in advise([*rivals, twin], whitening(rivals), some):
        assert not {"viscous", "twin"} <= set(advice.separates)
    for advice in advise([rivals[1], twin], whitening(rivals), some):
        assert max(advice.power, abs(advice.gain), 0.5 * advice.delta) < 0.05
    white = whitening(rivals)
    advised = advise(rivals, white, (repeated, *some))
    assert all(a.separates == ("coulomb", "viscous") and 0.0 <= a.power <= 1.0 for a in advised)
    odds = np.exp(-0.5 * (rivals[1].criterion - rivals[0].criterion))
    shares = [round(a.gain / entropy(np.array([1.0, odds]) / (1.0 + odds)), 2) for a in advised]
    assert 1.0 >= shares[0] > 0.0
    assert shares == sorted(shares, reverse=True)
    assert advised[0].words != "lower.csv once more"
    quiet = {a.words: a for a in advised}
    # and where the residual is a misfit, the old records tell less, too
    unsure = [replace(r, trust=0.05**2) for r in rivals]
    for known in (rivals, unsure):
        loud = {a.words: a for a in advise(known, lambda signals: 0.05 * white(signals), some)}
        assert len(loud) >= 2
        for words, advice in loud.items():
            assert advice.delta < quiet[words].delta
            assert advice.power < quiet[words].power
            assert advice.gain < quiet[words].gain
    assert np.all(unsure[0].root.diagonal() >= rivals[0].root.diagonal())


@pytest.mark.slow
def test_the_largest_set_that_is_told_apart_is_named(rivals):
    three = [replace(rivals[0], name=n) for n in "xyz"]
    (feasible, *_) = manoeuvre_grid(rivals[0].records.replays[0].model, [rivals[0].records.replays[0].record])
    clear = {(0, 1): (0.9, 5.0), (0, 2): (0.7, 4.0), (1, 2): (0.8, 3.0)}
    assert advice_of(three, feasible, 1.0, clear).separates == ("x", "y", "z")
    assert advice_of(three, feasible, 1.0, clear).power == 0.7
    partly = clear | {(0, 2): (OFTEN - 0.1, 1.0)}
    found = advice_of(three, feasible, 1.0, partly)
    assert (found.separates, found.power, found.delta) == (("x", "y"), 0.9, 5.0)
    hardly = {pair: (0.1 * sum(pair), 1.0) for pair in clear}
    assert advice_of(three, feasible, 1.0, hardly) == Advice(
        dict(feasible.keys), feasible.name, 1.0, ("y", "z"), pytest.approx(0.3), 1.0
    )


@pytest.mark.nightly
def test_the_advised_record_tells_apart_and_beats_a_random_one(models, stroke):
    """One stroke leaves friction open. Make the advised record, and a random one, 4 times: fit both rivals again."""
    rng = np.random.default_rng(7)
    margins = {"advised": [], "random": []}
    for turn in range(4):
        right = ("coulomb", "viscous")[turn % 2]
        old = made(models[right], stroke, slice(0, 701), rng, "lower.csv")
        rivals = [fitted(name, model, [old]) for name, model in models.items()]
        grid = manoeuvre_grid(models[right], [old])
        best = advise(rivals, whitening(rivals), grid, 200.0 * DEGREE)[0]
        motions = Motions(rivals[0].records.replays, rivals[0].candidate, 200.0 * DEGREE)
        able = [f for f, _ in motions.signals(grid, rivals[0].candidate[np.newaxis])]
        chosen = {"advised": next(f for f in grid if f.keys == best.manoeuvre), "random": able[rng.integers(len(able))]}
        for how, feasible in chosen.items():
            new = made(models[right], feasible.manoeuvre, feasible.window, rng, "new.csv")
            again = {r.name: fitted(r.name, models[r.name], [old, new], r.records.values(r.z)) for r in rivals}
            wrong = next(name for name in models if name != right)
            margins[how].append(again[wrong].criterion - again[right].criterion)
    won = {how: np.mean(np.array(values) > BETTER_BY) for how, values in margins.items()}
    assert won["advised"] >= 0.8
    assert won["advised"] >= won["random"]
    assert np.median(margins["advised"]) > 2.0 * np.median(margins["random"])
