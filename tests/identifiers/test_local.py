"""Local searches: the very steps of NLopt, derivatives by differences, starts, failures."""

from contextlib import suppress

import nlopt
import numpy as np
import pytest
from searches import Bowl, identifier, ran

from armid.identifiers.local import ALGORITHMS, CENTRAL, NO_PROGRESS, slopes, stencil
from armid.identifiers.search import Calls

FREE = ("nelder_mead", "bobyqa", "sbplx", "cobyla")
# A seed whose start is in the middle of the box, where no step has to turn.
INNER = 6


def nlopt_alone(name, problem, start, n):
    """The points that NLopt asks for when it calls the function itself, no thread and no pymoo around it."""
    asked = []

    def height(u, gradient):
        asked.append(u.copy())
        r = problem.A @ u - problem.b
        if gradient.size:
            gradient[:] = 2.0 * problem.A.T @ r / scale
        return float(r @ r) / scale

    first = problem.A @ start - problem.b
    scale = float(first @ first)
    search = nlopt.opt(getattr(nlopt, ALGORITHMS[name][1]), 3)
    search.set_lower_bounds(np.zeros(3))
    search.set_upper_bounds(np.ones(3))
    search.set_initial_step(0.05)
    search.set_maxeval(n)
    search.set_min_objective(height)
    search.optimize(start)
    return np.array(asked)


@pytest.mark.parametrize("name", ALGORITHMS)
def test_asks_for_what_nlopt_alone_asks_for(name):
    problem = Bowl()
    ran(name, problem, 60)
    asked = problem.unit(np.array([batch[0] for batch in problem.batches]))
    alone = nlopt_alone(name, problem, asked[0], min(len(asked), 12 if name in FREE else 4))
    np.testing.assert_allclose(asked[: len(alone)], alone, atol=1e-7 if name in FREE else 1e-5)


@pytest.mark.parametrize("name", FREE)
def test_the_first_step_is_the_one_that_was_asked_for(name):
    for step in (0.05, 0.2):
        problem = Bowl()
        ran(name, problem, 2, seed=INNER, initial_step=step)
        first, second = problem.unit(np.concatenate(problem.batches)[:2])
        assert np.abs(second - first).max() == pytest.approx(step, rel=1e-9)


@pytest.mark.parametrize("name", [*FREE, "lbfgs", "slsqp", "least_squares"])
def test_a_start_without_fitness_is_drawn_again(name):
    problem = Bowl(fail_above=0.1)
    result = ran(name, problem, 200, seed=6)
    starts = problem.unit(problem.batches[0])[0, 0], problem.unit(problem.batches[1])[0, 0]
    assert starts[0] > 0.1
    assert np.isfinite(result.F[0])
    assert problem.unit(result.X)[0] <= 0.1


def test_where_all_fails_the_budget_is_the_end_and_a_tolerance_ends_a_search_earlier():
    result = ran("bobyqa", Bowl(fail_above=-1.0), 30)
    assert result.algorithm.evaluator.n_eval == 30
    assert result.X is None
    used = [ran("bobyqa", Bowl(), 300, tolerance=t).algorithm.evaluator.n_eval for t in (1e-2, 1e-9)]
    assert used[0] < used[1] < 300
    assert identifier("bobyqa", tolerance=0).build(10).budget == 10


def quadratic(u):
    """Two functions of three parameters, (n, 3) -> (n, 2), and their gradient at u by hand below."""
    return np.column_stack([u[:, 0] ** 2 + 3.0 * u[:, 1] * u[:, 2], 2.0 * u[:, 0] - u[:, 2] ** 2])


def gradient(u):
    return np.array([[2.0 * u[0], 2.0], [3.0 * u[2], 0.0], [3.0 * u[1], -2.0 * u[2]]])


@pytest.mark.parametrize("u", [(0.3, 0.6, 0.5), (1.0, 0.0, 0.9999), (0.0, 1.0, 5e-4)])
def test_central_differences_are_exact_for_parabolas_also_at_bounds(u):
    here = np.array(u)
    points, offsets = stencil(here, 1e-3, CENTRAL)
    assert points.shape == (6, 3)
    assert ((points >= 0.0) & (points <= 1.0)).all()
    assert (np.count_nonzero(points != here, axis=1) == 1).all()
    found = slopes(points, offsets, quadratic(here[np.newaxis])[0], quadratic(points))
    np.testing.assert_allclose(found, gradient(here), atol=1e-9)


@pytest.mark.parametrize(("kind", "size"), [("forward", 3), ("central", 6)])
def test_derivatives_are_one_population_and_counted(kind, size):
    for name in ("lbfgs", "slsqp", "least_squares"):
        problem = Bowl()
        result = ran(name, problem, 60, differences=kind)
        sizes = [len(batch) for batch in problem.batches]
        # a gradient's population holds the point itself, a Jacobian's does not; a line search may need no gradient
        batch = size if name == "least_squares" else size + 1
        assert set(sizes) - {1} == {batch}
        assert batch in sizes[:2]
        assert result.algorithm.evaluator.n_eval == sum(sizes)
    assert sizes[:4] == [1, size, 1, size]
    # linear residuals: the first Gauss-Newton step is the solution
    assert result.F[0] == pytest.approx(float(np.linalg.lstsq(problem.A, problem.b, rcond=None)[1][0]), rel=1e-9)
    assert "residuals" not in result.pop[0].data


class EnoughError(Exception):
    """Raised by an objective that has had enough."""


@pytest.mark.parametrize("seed", range(12))
def test_an_error_of_the_objective_arrives_whatever_nlopt_makes_of_it(seed):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((4, 4))
    A = A @ A.T * 10.0 ** rng.uniform(0, 4)
    centre, start = rng.uniform(0.2, 0.8, 4), rng.uniform(0.1, 0.9, 4)
    for enough in range(80, 145, 3):
        called = []

        def value(u, _, enough=enough, called=called):
            called.append(1)
            if len(called) > enough:
                raise EnoughError
            return float((u - centre) @ A @ (u - centre))

        search, calls = nlopt.opt(nlopt.LN_BOBYQA, 4), Calls(value)
        search.set_lower_bounds(np.zeros(4))
        search.set_upper_bounds(np.ones(4))
        search.set_initial_step(0.05)
        search.set_xtol_abs(1e-10)
        search.set_min_objective(calls)
        # of these stops NLopt loses the error of a few, and Python raises a SystemError in its place
        with suppress(EnoughError):
            with calls, suppress(*NO_PROGRESS):
                search.optimize(start)
            assert len(called) <= enough
