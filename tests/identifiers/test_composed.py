"""Chains, multistart and CMA-ES with restarts: who gets how many simulations, and where each phase starts."""

import random
from typing import Annotated

import numpy as np
import pytest
from pymoo.algorithms.soo.nonconvex.cmaes import CMAES
from pymoo.algorithms.soo.nonconvex.de import DE
from pymoo.algorithms.soo.nonconvex.nelder import NelderMead
from pymoo.optimize import minimize
from searches import Bowl, asked_of, identifier, ran

from armid.errors import ArmidError
from armid.identifiers import IDENTIFIERS, as_identifier, identifier_of, options_of
from armid.identifiers.catalogue import spread
from armid.problem.fitness import FITNESS
from armid.problem.meter import Meter, MeterTermination
from armid.problem.problem import IdentificationProblem, replays
from armid.problem.space import space_of
from armid.record import read_campaign
from armid.study.tune import ranges_of

OWN = IDENTIFIERS | {
    "mine": as_identifier("mine", NelderMead), "evolution": as_identifier("evolution", lambda budget: DE(pop_size=10)),
    "adapted": as_identifier("adapted", CMAES),
}  # fmt: skip


@pytest.mark.parametrize(("share", "end"), [(None, 100), (0.3, 60), ("0.3", 60), ([0.3], 60), (0.005, 1)])
def test_the_first_phase_gets_its_share_exactly_and_the_second_starts_at_its_best(share, end):
    problem, alone = Bowl(), Bowl()
    options = {} if share is None else {"share": share}
    ran("random+bobyqa", problem, 200, **options, **{"random.n_candidates": 16})
    minimize(alone, identifier("random", n_candidates=16).build(end), ("n_eval", end), seed=1)
    asked, f = asked_of(problem)
    np.testing.assert_array_equal(asked[:end], asked_of(alone)[0][:end])
    assert len(problem.batches[-(-end // 16) - 1]) == (end - 1) % 16 + 1
    start = problem.unit(asked[end])
    # a quadratic model wants a step of room at the bounds
    best = np.clip(problem.unit(asked[np.argmin(f[:end])]), 0.05, 0.95)
    np.testing.assert_allclose(start, best, atol=1e-12)
    assert f.min() < f[:end].min()


def test_three_phases_the_budget_that_an_early_end_leaves_and_a_swarm_with_the_inertia_of_its_share():
    problem = Bowl()
    ran("random+bobyqa+nelder_mead", problem, 400, share="0.1:0.2", **{"random.n_candidates": 40})
    sizes = [len(batch) for batch in problem.batches]
    assert sizes[0] == 40
    assert sizes[1:] == [1] * len(sizes[1:])
    asked, f = asked_of(problem)
    # bobyqa converges within its 80, the simplex takes over at the best so far: its first point is an old one
    again = [i for i in range(60, 121) if (asked[:i] == asked[i]).all(axis=1).any()]
    assert again
    np.testing.assert_allclose(asked[again[0]], asked[np.argmin(f[: again[0]])], rtol=1e-12)
    problem, alone = Bowl(), Bowl()
    ran("pso+bobyqa", problem, 100, share=0.64, **{"pso.n_particles": 8, "pso.velocity_limit": 0.2})
    seed = int(np.random.default_rng(1).integers(1, 2**31 - 1))
    minimize(alone, identifier("pso", n_particles=8, velocity_limit=0.2).build(64), seed=seed)
    np.testing.assert_array_equal(asked_of(problem)[0][:64], asked_of(alone)[0])


def test_capabilities_of_the_composed_are_those_of_their_parts_and_options_reach_these():
    chain = identifier("random+multistart:least_squares+lbfgs")
    assert (chain.is_global, chain.uses_gradient, chain.is_stochastic, chain.needs_residuals) == (True,) * 4
    local = identifier("bobyqa+nelder_mead")
    assert (local.is_global, local.uses_gradient, local.needs_residuals) == (False,) * 3
    assert identifier("multistart:bobyqa").is_global
    assert identifier_of("pso", OWN) is IDENTIFIERS["pso"]
    for name in ("multistart:bobyqa", "random+multistart:bobyqa"):
        few, many = Bowl(), Bowl()
        ran(name, few, 200, **{"bobyqa.tolerance": 0.0})
        ran(name, many, 200, **{"bobyqa.tolerance": 0.02})
        assert jumps(many) > jumps(few) + 3


@pytest.mark.parametrize("name", ["evolution+bobyqa", "evolution+mine", "pso+mine+bobyqa", "multistart:mine",
                                  "evolution+adapted"])  # fmt: skip
def test_a_user_s_own_takes_part(name):
    problem = Bowl()
    algorithm = identifier_of(name, OWN).build(400)
    result = minimize(problem, algorithm, ("n_eval", 400), seed=1, copy_algorithm=False)
    asked, f = asked_of(problem)
    assert result.F[0] == f.min() < 1.0
    assert f.min() < f[:100].min()
    if name == "evolution+mine":
        np.testing.assert_allclose(asked[200], asked[np.argmin(f[:200])], rtol=1e-12)


def stepping(value, low, high, random, step: Annotated[float, (0.05, 0.5), "first step"] = 0.2, restarts=3, way="up"):
    """Step from the middle of the box.

    And again.
    """
    value((low + high) / 2)
    value(low + step * (high - low))


def test_arguments_with_a_default_are_options_of_a_user_s_search():
    own = as_identifier("stepping", stepping)
    assert own.note == "Step from the middle of the box."
    assert options_of(own) == {
        "step": {"default": 0.2, "unit": "", "meaning": "first step"},
        "restarts": {"default": 3, "unit": "", "meaning": ""}, "way": {"default": "up", "unit": "", "meaning": ""},
    }  # fmt: skip
    assert ranges_of(own) == {"step": (0.05, 0.5)}
    problem = Bowl()
    minimize(problem, own.with_options({"step": 1}).build(10), ("n_eval", 10), seed=1, copy_algorithm=False)
    middle, corner = problem.unit(asked_of(problem)[0])
    assert (set(middle), set(corner)) == ({0.5}, {1.0})
    wrong = (({"step": "big"}, "step is 'big', expected a number as its default 0.2"),
             ({"way": True}, "way is True, expected a text"), ({"stop": 1}, "did you mean 'step'"))  # fmt: skip
    for given, sentence in wrong:
        with pytest.raises(ArmidError, match=sentence):
            own.with_options(given).build(10)
    with pytest.raises(ArmidError, match="has an argument 'popsize' without a default, which an option needs: known"):
        as_identifier("mine", lambda value, popsize: None)
    with pytest.raises(ArmidError, match="an option cannot be called 'search'"):
        as_identifier("mine", lambda value, search=1: None)


def jumps(problem):
    """How often a search moved by more than a third of the box in one step."""
    steps = np.diff(problem.unit(np.array([batch[0] for batch in problem.batches])), axis=0)
    return int((np.abs(steps).max(axis=1) > 1.0 / 3.0).sum())


def test_starts_fill_the_box_evenly():
    points = spread(np.random.default_rng(1), 4)
    first = np.array([next(points) for _ in range(64)])
    assert ((first >= 0.0) & (first < 1.0)).all()
    for column in first.T:
        assert np.histogram(column, 8, (0.0, 1.0))[0].min() >= 4
        assert np.histogram(column, 4, (0.0, 1.0))[0].min() >= 13


def test_cma_es_starts_again_with_twice_the_population():
    problem = Bowl()
    result = ran("cmaes", problem, 3000, n_candidates=8)
    sizes = [len(batch) for batch in problem.batches]
    assert list(dict.fromkeys(sizes))[:3] == [8, 16, 32]
    assert sizes == sorted(sizes)
    assert result.algorithm.evaluator.n_eval >= 3000
    steady = Bowl()
    ran("cmaes", steady, 1500, n_candidates=6, growth=1.0)
    assert {len(batch) for batch in steady.batches} == {6}


@pytest.mark.parametrize("name", ["cmaes", "cmaes+bobyqa"])
def test_cma_es_is_silent_and_draws_from_nobody_else(name, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    random.seed(5)
    np.random.seed(5)
    before = random.getstate(), np.random.get_state()[1].copy()
    runs = []
    for _ in range(2):
        problem = Bowl()
        ran(name, problem, 1000, seed=0)
        runs.append(asked_of(problem)[0])
    np.testing.assert_array_equal(*runs)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")
    assert random.getstate() == before[0]
    np.testing.assert_array_equal(np.random.get_state()[1], before[1])


# The paper's Table I.
ROWS = {
    "row 1": (3.2e6, 1.0, 0.62, 1.0), "row 2": (3.1e6, 0.95, 0.60, 1.1), "row 3": (3.0e6, 0.90, 0.58, 1.2),
    "row 4": (2.9e6, 0.85, 0.55, 1.3), "row 5": (2.8e6, 0.80, 0.50, 1.4),
}  # fmt: skip
CLEAN = ("--noise-deg-s", "0", "--quantisation-deg-s", "0", "--repeats", "1", "--manoeuvres", "lower", "--holdout", "",
         "--duration", "0.7")  # fmt: skip


@pytest.mark.nightly
@pytest.mark.parametrize("truth", ROWS.values(), ids=ROWS)
@pytest.mark.parametrize("name", ["least_squares", "pso+least_squares"])
def test_all_four_within_a_millionth_of_the_truth(stand, arm, truth, name):
    told = [word for name, value in zip(("p0", "k", "eta3", "n"), truth) for word in (f"--{name}", repr(value))]
    campaign = read_campaign(stand(*CLEAN, *told))
    space = space_of(arm)
    ready = replays(campaign.train, arm, space)
    for seed in range(1, 11):
        meter = Meter(3000)
        problem = IdentificationProblem(space, ready, FITNESS["rmse"], meter)
        minimize(problem, identifier(name).build(3000), MeterTermination(meter), seed=seed, copy_algorithm=False)
        assert np.abs(meter.best_x / truth - 1.0).max() < 1e-6
        assert meter.used < 3000
