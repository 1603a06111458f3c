"""The paper's swarm: its equations, particle by particle, and what pymoo expects of it."""

import numpy as np
import pytest
from pymoo.core.evaluator import Evaluator
from pymoo.core.problem import Problem
from pymoo.optimize import minimize

from armid.identifiers import IDENTIFIERS, as_identifier
from armid.identifiers.pso import PaperPSO


def valley(x):
    """Return the height of a narrow curved valley in four dimensions, (n, 4) -> (n,); 0 at 1, 1, 1, 1."""
    a, b, c, d = x.T
    steps = ((a, b), (b, c), (c, d))
    return np.asarray(sum(100.0 * (v - u * u) ** 2 + (1.0 - u) ** 2 for u, v in steps))


class Valley(Problem):
    """The valley in [-2, 2]^4, with all that was asked."""

    def __init__(self):
        super().__init__(n_var=4, n_obj=1, xl=-2.0, xu=2.0)
        self.seen = []

    def _evaluate(self, x, out, *_, **__):
        self.seen.append(x.copy())
        out["F"] = valley(x)


def literal_swarm(seed, n_particles, n_iterations, limit):
    """Eqs 8-9 particle by particle in [-2, 2]^4; returns positions, (n_iterations, n_particles, 4), and the bests."""
    random = np.random.default_rng(seed)
    draw = lambda: random.random((n_particles, 4))  # noqa: E731
    x, v = -2.0 + 4.0 * draw(), np.minimum(0.2 * 4.0, limit) * (2.0 * draw() - 1.0)
    p, f = x.copy(), valley(x)
    visited, bests = [x.copy()], [f.min()]
    for t in range(1, n_iterations):
        sigma = 0.4 + (0.9 - 0.4) * (n_iterations - t) / n_iterations
        r1, r2, g = draw(), draw(), p[np.argmin(f)].copy()
        for i in range(n_particles):
            for d in range(4):
                faster = sigma * v[i, d] + 1.2 * r1[i, d] * (p[i, d] - x[i, d]) + 1.7 * r2[i, d] * (g[d] - x[i, d])
                v[i, d] = min(max(faster, -limit[d]), limit[d])
                x[i, d] = min(max(x[i, d] + v[i, d], -2.0), 2.0)
        now = valley(x)
        for i in range(n_particles):
            if now[i] < f[i]:
                p[i], f[i] = x[i], now[i]
        visited.append(x.copy())
        bests.append(f.min())
    return np.array(visited), np.array(bests)


@pytest.mark.parametrize(("limit", "fraction"), [("literal", 0.5), (0.1, 0.1)])
def test_moves_as_the_equations_say(limit, fraction):
    problem, bests = Valley(), []
    swarm = PaperPSO(n_particles=13, n_iterations=40, velocity_limit=limit)
    minimize(problem, swarm, seed=3, callback=lambda algorithm: bests.append(float(algorithm.opt[0].F[0])))
    visited, literal = literal_swarm(3, 13, 40, np.full(4, fraction * 4.0))
    np.testing.assert_array_equal(np.array(problem.seen), visited)
    np.testing.assert_array_equal(bests, literal)


def test_the_paper_s_settings_make_12000_evaluations_and_every_evaluator_gives_the_same_run():
    for termination in (("n_eval", 12000), ("n_iter", 150), None):
        result = minimize(Valley(), PaperPSO(), termination, seed=1)
        assert result.algorithm.evaluator.n_eval == 12000
        assert sum(map(len, result.problem.seen)) == 12000
        assert result.algorithm.n_gen - 1 == 150
    assert minimize(Valley(), PaperPSO(), ("n_gen", 200), seed=1).algorithm.evaluator.n_eval == 16000
    assert minimize(Valley(), PaperPSO(termination=("n_gen", 3)), seed=1).algorithm.evaluator.n_eval == 240
    light = minimize(Valley(), PaperPSO(), seed=5)
    plain = minimize(Valley(), PaperPSO(), seed=5, evaluator=Evaluator())
    given = minimize(Valley(), PaperPSO(evaluator=Evaluator()), seed=5)
    for other in (plain, given):
        np.testing.assert_array_equal(other.pop.get("X"), light.pop.get("X"))
        assert other.algorithm.evaluator.n_eval == light.algorithm.evaluator.n_eval == 12000

    class Talkative(Valley):
        def _evaluate(self, x, out, *args, **kwargs):
            super()._evaluate(x, out, *args, **kwargs)
            out["twice"] = 2.0 * valley(x)

    pop = minimize(Talkative(), PaperPSO(), ("n_gen", 3), seed=1).pop
    np.testing.assert_array_equal(pop.get("twice"), 2.0 * pop.get("F")[:, 0])


@pytest.mark.parametrize(("problem", "sentence"), [
    (Problem(n_var=2, n_obj=2, xl=0.0, xu=1.0), "2 objectives"),
    (Problem(n_var=2, n_obj=1, n_ieq_constr=1, xl=0.0, xu=1.0), "1 constraints"),
    (Problem(n_var=2, n_obj=1), "bounds are None and None"),
    (Problem(n_var=2, n_obj=1, xl=0.0, xu=np.inf), "expected a finite box"),
    (Problem(n_var=2, n_obj=1, xl=1.0, xu=0.0), "expected a finite box"),
])  # fmt: skip
def test_refuses_problems_it_cannot_search(problem, sentence):
    with pytest.raises(ValueError, match=sentence):
        minimize(problem, PaperPSO(), seed=1)


def test_the_catalogue_stretches_the_schedule_over_the_budget():
    for budget, n_particles, n_iterations in ((12000, 80, 150), (81, 80, 2), (80, 80, 1), (7, 7, 1)):
        problem, other = Valley(), Valley()
        minimize(problem, IDENTIFIERS["pso"].build(budget), ("n_gen", 2), seed=1)
        minimize(other, PaperPSO(n_particles, n_iterations), ("n_gen", 2), seed=1)
        np.testing.assert_array_equal(np.array(problem.seen), np.array(other.seen))
    given = IDENTIFIERS["pso"].with_options({"velocity_limit": 0.2, "c1": 2, "n_particles": 20}).build(200)
    problem, other = Valley(), Valley()
    minimize(problem, given, seed=1)
    minimize(other, PaperPSO(20, 10, velocity_limit=0.2, c1=2.0), seed=1)
    np.testing.assert_array_equal(np.array(problem.seen), np.array(other.seen))
    assert IDENTIFIERS["pso"].with_options({}) is IDENTIFIERS["pso"]
    for wrong in (0, -5, 1.5, "12"):
        with pytest.raises(ValueError, match="expected a whole number above 0"):
            IDENTIFIERS["pso"].build(wrong)


@pytest.mark.parametrize(("obj", "sentence"), [
    (3, "is 3, expected a subclass of pymoo's Algorithm, a function of the budget"),
    (dict, "expected a subclass"), (lambda budget, more: PaperPSO(), "expected a subclass"),
    (lambda budget: budget, "identifier 'mine' returned a int, expected an Algorithm"),
])  # fmt: skip
def test_as_identifier_refuses(obj, sentence):
    with pytest.raises(ValueError, match=sentence):
        as_identifier("mine", obj).build(10)
    with pytest.raises(ValueError, match="takes no options"):
        as_identifier("mine", lambda budget: PaperPSO(n_particles=4)).with_options({"pop_size": 10})
    used = PaperPSO(n_particles=4)
    used.problem = object()
    with pytest.raises(ValueError, match="is a PaperPSO that was used already, expected a subclass"):
        as_identifier("mine", used)
