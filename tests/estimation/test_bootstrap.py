"""Intervals of a fitness that is not a sum of squares: the scatter of its own estimates over draws of the noise."""

from dataclasses import replace

import numpy as np
import pytest

from armid.estimation import bootstrap as bootstraps
from armid.estimation import identify as identifications
from armid.estimation.bootstrap import Scatter, Task, bootstrap, refined
from armid.estimation.identify import identify
from armid.estimation.identify_document import answer, details_of, parameter_table, result_of
from armid.estimation.information import information_at
from armid.estimation.noise_model import Level, coloured
from armid.identifiers import IDENTIFIERS
from armid.problem.fitness import FITNESS, Fitness
from armid.record import Noise
from changed_records import with_noise

TRUTH = np.array([3.05e6, 0.9, 0.57, 1.2])
NOISE = np.radians(0.25)
SQUARES = Fitness("squares", lambda measured, simulated: ((simulated - measured) ** 2).mean(axis=1))
MINIMAX = Fitness("minimax", lambda measured, simulated: np.abs(simulated - measured).max(axis=1))


@pytest.fixture(scope="module")
def stroke(lowering_replays):
    """One stroke of the arm, of which the noise is known and the motion is that of the truth."""
    replay = lowering_replays[0]
    noise = Noise(NOISE, 0.0, 1.0, 400, "rest")
    return noisy(replay.changed(record=with_noise(replay.record, **vars(noise))), 1)


def noisy(replay, seed):
    clean = replay.signal(TRUTH[np.newaxis])[0]
    return replay.measuring(clean + NOISE * np.random.default_rng(seed).standard_normal(len(clean)))


def minimum(fitness, replay, space):
    """Return the estimate of a fitness near the truth."""
    task = Task(fitness, (replay,), space, TRUTH, information_at((replay,), space, TRUTH))
    found = refined(task, task.measured[np.newaxis].repeat(4, axis=0), np.random.default_rng(0), lambda _: False)
    return found.draws[0]


@pytest.mark.slow
def test_least_squares_scatters_as_the_cramer_rao_bound_says(stroke, arm_space, monkeypatch):
    x = minimum(SQUARES, stroke, arm_space)
    information = information_at((stroke,), arm_space, x)
    seen = []
    found = bootstrap(SQUARES, (stroke,), arm_space, x, information, 0,
                      lambda state: seen.append((state.used, state.budget, state.what)))  # fmt: skip
    assert seen == sorted(seen)
    assert seen[0] == (0, 100, "draws of the noise")
    assert not found.doubt
    np.testing.assert_allclose(found.draws.std(axis=0) / information.deviation, 1.0, atol=0.25)
    np.testing.assert_allclose((found.high - found.low) / information.half_width, 2.0, atol=0.5)
    assert np.abs(found.moved).max() < 0.2
    # skewed estimates would get the quantiles of many draws
    monkeypatch.setattr(bootstraps, "SKEWED", 0.0)
    monkeypatch.setattr(bootstraps, "MANY_DRAWS", 150)
    found = bootstrap(SQUARES, (stroke,), arm_space, x, information)
    assert len(found.draws) == 150
    ends = np.quantile(found.draws, (0.025, 0.975), axis=0) + found.moved * found.draws.std(axis=0, ddof=1)
    np.testing.assert_allclose([found.low, found.high], ends)
    stopped = bootstrap(SQUARES, (stroke,), arm_space, x, information, 0, lambda _: True)
    assert stopped.doubt == "the bootstrap was interrupted"


@pytest.mark.slow
def test_the_intervals_of_a_minimax_hold_the_truth_and_those_of_least_squares_do_not(stroke, arm_space):
    """100 noises, each minimised from the truth; 95 % intervals, where 85 to 100 may be right."""
    information = information_at((stroke,), arm_space, TRUTH)
    task = Task(MINIMAX, (stroke,), arm_space, TRUTH, information)
    estimates = refined(task, task.noises(np.random.default_rng(8), 100), np.random.default_rng(9), lambda _: False)
    misses = np.abs(estimates.draws - TRUTH)
    found = bootstrap(MINIMAX, (stroke,), arm_space, minimum(MINIMAX, stroke, arm_space), information, seed=3)
    assert not found.doubt
    half = 0.5 * (found.high - found.low)
    assert ((misses <= half).mean(axis=0) >= 0.85).all()
    assert (half < 1.3 * 1.96 * misses.std(axis=0) / np.sqrt(1.0 - 2.0 / np.pi)).all()
    assert ((misses <= information.half_width).mean(axis=0) < 0.6).all()


def test_an_interval_lies_about_the_minimum_of_which_a_search_stopped_short(stroke, arm_space):
    least = minimum(SQUARES, stroke, arm_space)
    information = information_at((stroke,), arm_space, least)
    short = bootstrap(SQUARES, (stroke,), arm_space, least + information.deviation * [0, 1, 0, 0], information)
    assert not short.doubt
    np.testing.assert_allclose((0.5 * (short.low + short.high) - least) / information.deviation, 0.0, atol=0.1)


def test_where_the_minimum_is_a_plateau_the_estimates_scatter_over_it(stroke, arm_space):
    """Where the largest deviation lies the speed may hang on all parameters but k."""
    information = information_at((stroke,), arm_space, TRUTH)
    task = Task(MINIMAX, (stroke,), arm_space, TRUTH, information)
    noise = task.noises(np.random.default_rng(5), 12)
    one, other = (refined(task, noise, np.random.default_rng(seed), lambda _: False).draws for seed in (1, 2))
    apart = np.abs(one - other) / information.deviation
    assert apart[:, 1].max() > 1.0


@pytest.mark.slow
def test_without_convergence_or_noise_and_where_nothing_is_determined_there_is_no_interval(
    stroke, arm_space, monkeypatch
):  # fmt: skip
    monkeypatch.setattr(bootstraps, "FIRST_DRAWS", 25)
    information = information_at((stroke,), arm_space, TRUTH)
    stepped = bootstrap(FITNESS["shape_similarity"], (stroke,), arm_space, TRUTH, information)
    assert "does not converge in" in stepped.doubt
    assert np.isnan([stepped.low, stepped.high, stepped.bias]).all()
    away = bootstrap(MINIMAX, (stroke,), arm_space, TRUTH + 60.0 * information.deviation * [1, 0, 0, 0], information)
    assert away.doubt == "the search has not come to the minimum of minimax"
    silent = replace(information, levels=(Level(0.0, 1.0),))
    assert "holds no noise" in bootstrap(MINIMAX, (stroke,), arm_space, TRUTH, silent).doubt
    lost = replace(information, deviation=information.deviation * [1, np.inf, 1, 1])
    assert "do not determine k" in bootstrap(MINIMAX, (stroke,), arm_space, TRUTH, lost).doubt


def test_the_noise_that_is_drawn_has_the_level_and_the_colour_of_the_record():
    drawn = coloured(np.random.default_rng(2), (200, 3000), Level(0.3, 0.25))
    assert drawn.std() == pytest.approx(0.3, rel=0.02)
    assert drawn[:, 0].std() == pytest.approx(0.3, rel=0.15)
    # of independent samples one in four: the variance of a mean is four times as large
    assert drawn.mean(axis=1).std() == pytest.approx(0.3 * 2.0 / np.sqrt(3000), rel=0.15)


def test_draws_from_a_fitted_start_scatter_less_where_the_start_takes_up_noise(write_axis, axis_model, tmp_path):
    from armid.estimation.least_squares import with_fitted_starts
    from armid.problem.problem import replays
    from armid.problem.space import space_of
    from armid.record import read_campaign

    times = np.arange(401) / 200.0
    speed = 0.4 + 0.1 * times + 0.01 * np.random.default_rng(1).standard_normal(401)
    campaign = read_campaign(write_axis(tmp_path, speed))
    space = space_of(axis_model, bounds={"mass": (1.0, 40.0), "viscous.slope": (0.1, 30.0)})
    ready = with_fitted_starts(replays(campaign.train, axis_model, space), space)
    correction = ready[0].pieces[0].correction
    x = np.array([10.0, 15.0])
    task = Task(SQUARES, ready, space, x, information_at(ready, space, x))
    noise = np.random.default_rng(3).standard_normal((4, 401))
    taken = noise - task.beyond_starts(noise)
    slopes = correction.slopes[:, 0]
    # what is taken up is a change of the start, and less than the noise
    rest = taken.T - slopes.T @ np.linalg.lstsq(slopes.T, taken.T)[0]
    assert np.abs(rest).max() < 1e-9
    assert 0.0 < np.linalg.norm(taken) < 0.5 * np.linalg.norm(noise)


def test_identify_gives_the_interval_of_its_fitness(lowering, arm, arm_space):
    found = identify(lowering, arm, arm_space, FITNESS["mae"], IDENTIFIERS["cmaes"], budget=1500)
    least = identify(lowering, arm, arm_space, FITNESS["rmse"], IDENTIFIERS["least_squares"], budget=500)
    assert least.scatter is None
    assert (found.information.deviation > least.information.deviation).all()
    entries = result_of(found)["parameters"]
    for i, name in enumerate(arm_space.names):
        assert entries[name]["interval_holds"]
        assert (entries[name]["low"], entries[name]["high"]) == (found.scatter.low[i], found.scatter.high[i])
        assert entries[name]["bias"] == found.scatter.bias[i]
    assert any(text.startswith("The intervals come from") and "Bias of the estimate: p0" in text
               for text in details_of(found)["remarks"])  # fmt: skip
    biased = replace(found, scatter=replace(found.scatter, bias=np.array([0.0, 0.0, 0.0, 1.0])))
    assert "biased by" in result_of(biased)["parameters"]["n"]["interval_doubt"]


def test_the_interval_of_a_local_minimum_does_not_hold(stroke, arm_space, monkeypatch):
    """Of similarity one search in forty ended far from the truth, and its draws stayed there."""
    least = minimum(SQUARES, stroke, arm_space)
    bound = information_at((stroke,), arm_space, least).deviation

    def scattered(fitness, replays, space, x, *_):
        draws = x + 1.5 * bound * np.random.default_rng(4).standard_normal((100, 4))
        return Scatter(draws, x - bound, x + bound, np.zeros(4), np.zeros(4))

    monkeypatch.setattr(identifications, "bootstrap", scattered)
    for moved, doubted in ((1.0, False), (20.0, True)):
        x = least + moved * bound * [0, 1, 0, 0]
        _, scatter = identifications.judged(MINIMAX, (stroke,), arm_space, x, 1, None, True)
        assert ("standard deviations from the least-squares estimate" in scatter.doubt) is doubted


@pytest.mark.parametrize("fitness", ["rmse", "similarity"])
def test_no_interval_is_given_where_none_is_asked_for(lowering, arm, arm_space, fitness):
    given = (FITNESS[fitness], IDENTIFIERS["pso"], 160)
    found = identify(lowering, arm, arm_space, *given, interval=False)
    entries = result_of(found)["parameters"]
    assert all(entries[name]["low"] is None and not entries[name]["interval_holds"] for name in arm_space.names)
    assert answer(result_of(found), details_of(found))[0].startswith("Found, without intervals: none was asked for")
    assert {row[3] for row in parameter_table(result_of(found)).frame} == {"none"}
