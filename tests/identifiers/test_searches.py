"""Every identifier of the catalogue, and some composed ones, as pymoo sees them."""

import copy
import pickle
from dataclasses import dataclass

import numpy as np
import pytest
from pymoo.optimize import minimize
from pymoo.problems import get_problem
from pymoo.problems.functional import FunctionalProblem
from pymoo.util.display.single import SingleObjectiveOutput
from scipy.optimize import lsq_linear
from searches import COMPOSED, Bowl, identifier, ran

from armid.contract.check import Trial, run
from armid.errors import ArmidError
from armid.identifiers import IDENTIFIERS, as_identifier
from armid.identifiers.identifier import declared
from armid.identifiers.local import ByValues
from armid.identifiers.search import SearchAlgorithm
from armid.problem.fitness import FITNESS
from armid.problem.meter import Meter

ALL = (*(n for n, i in IDENTIFIERS.items() if not i.package), *COMPOSED)
OURS = [name for name in ALL if isinstance(identifier(name).build(10), SearchAlgorithm)]


@pytest.mark.parametrize("name", [name for name in ALL if "least_squares" in name])
def test_least_squares_refuses_a_problem_without_residuals(name):
    with pytest.raises(ArmidError, match="gives no residual vectors, least_squares expects one that does"):
        ran(name, get_problem("rastrigin", n_var=3))


LOCAL_OR_BETTER = [
    name for name in ALL if name not in ("pso", "pymoo_pso", "ga", "de", "random", "sobol", "ga+cobyla+sbplx")
]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_cmaes_in_one_dimension_when_its_step_grows_to_the_range(seed):
    problem = FunctionalProblem(1, lambda x: (x[0] - 1.0) ** 2, xl=0.0, xu=1.0)
    assert ran("cmaes", problem, 200, seed=seed, initial_step=0.9).X[0] > 0.999


@pytest.mark.parametrize(("problem", "n_at_bounds", "near"), [
    (Bowl, 0, 2e-5), (lambda: Bowl((3.5, 1.0, 3.0, 2.5)), 2, 1e-4)], ids=["inside", "on two bounds"])  # fmt: skip
@pytest.mark.parametrize("name", LOCAL_OR_BETTER)
def test_finds_what_linear_algebra_finds(name, problem, n_at_bounds, near):
    problem = problem()
    expected = lsq_linear(problem.A, problem.b, (0.0, 1.0), tol=1e-14).x
    assert (expected > 1.0 - 1e-9).sum() == n_at_bounds
    found = ran(name, problem, 600)
    np.testing.assert_allclose(problem.unit(found.X), expected, atol=near)
    assert all((batch >= problem.xl).all() and (batch <= problem.xu).all() for batch in problem.batches)


@pytest.mark.parametrize("name", OURS)
def test_pymoo_s_trimmings(name, capsys):
    seen = []
    told = {"seed": 3, "save_history": True, "callback": lambda algorithm: seen.append(algorithm.evaluator.n_eval)}
    result = minimize(Bowl(), identifier(name).build(60), ("n_gen", 4), **told)
    assert len(result.history) == len(seen) == 4
    assert [h.evaluator.n_eval for h in result.history] == seen
    bests = [h.opt[0].F[0] for h in result.history]
    assert bests == sorted(bests, reverse=True)
    assert capsys.readouterr().out == ""
    with pytest.raises(ArmidError, match="has run before"):
        result.history[0].run()
    shown = identifier(name).build(60)
    shown.output = SingleObjectiveOutput()
    minimize(Bowl(), shown, ("n_gen", 2), seed=3, verbose=True)
    assert "f_min" in capsys.readouterr().out


@pytest.mark.parametrize("name", ALL)
def test_identifiers_travel_to_other_processes_and_algorithms_copy_before_they_run(name):
    kept = identifier(name)
    algorithm = pickle.loads(pickle.dumps(kept)).build(100)
    results = [minimize(Bowl(), a, ("n_eval", 100), seed=5).X for a in (copy.deepcopy(algorithm), algorithm)]
    np.testing.assert_array_equal(*results)


def test_what_minimize_would_swallow_and_more_offspring_than_parents_are_refused():
    with pytest.raises(ArmidError, match="no option 'sede', did you mean 'seed'"):
        minimize(Bowl(), identifier("bobyqa").build(10), sede=3)
    with pytest.raises(ArmidError, match="no option 'terminaton'"):
        SearchAlgorithm(lambda task: None, 10, terminaton=3)
    with pytest.raises(ArmidError, match="the search has no problem"):
        identifier("bobyqa").build(10).run()
    for step in ("ask", "next"):
        with pytest.raises(ArmidError, match="has no ask"):
            getattr(identifier("bobyqa").build(10).setup(Bowl()), step)()
    with pytest.raises(ArmidError, match="2 objectives"):
        minimize(get_problem("zdt1"), identifier("cmaes").build(10))
    with pytest.raises(ArmidError, match="n_offsprings of 'de' is 60, at most its pop_size of 40 is expected"):
        IDENTIFIERS["de"].with_options({"n_offsprings": 60}).build(200)


def test_capabilities_are_true():
    asks_residuals = {name for name in ALL if identifier(name).needs_residuals}
    assert asks_residuals == {name for name in ALL if "least_squares" in name}
    assert {n for n in IDENTIFIERS if IDENTIFIERS[n].uses_gradient} == {"lbfgs", "slsqp", "least_squares"}
    assert {name for name in IDENTIFIERS if IDENTIFIERS[name].is_global} == {
        "pso", "pymoo_pso", "ga", "de", "cmaes", "bipop_cmaes", "random", "lshade", "ngopt", "tpe", "sobol",
    }  # fmt: skip
    for name in asks_residuals:
        identifier(name).refuse(FITNESS["rmse"])
        with pytest.raises(ArmidError, match=r"'similarity' has none: rmse or likelihood is expected"):
            identifier(name).refuse(FITNESS["similarity"])
    identifier("pso+bobyqa").refuse(FITNESS["similarity"])


def wrapping(value, low, high):
    """Search as a compiled library does: an error of a call comes out as one of its own."""
    try:
        while True:
            assert value(low + 0.9 * (high - low)) < 1e6
    except BaseException as error:
        raise RuntimeError("in the library") from error


def test_an_error_that_a_library_wraps_comes_out_and_a_package_that_is_missing_is_named():
    meter, _ = run(as_identifier("wrapping", wrapping), 1)
    assert meter.used == 403
    with pytest.raises(RuntimeError, match="in the library"):
        run(as_identifier("wrapping", wrapping), 1, Trial(Meter(403), holes=True))
    with pytest.raises(ArmidError, match="'absent' needs the package no_such_package, which is not installed"):
        declared("absent", "", Absent, "LN_BOBYQA").build(100)


@dataclass(frozen=True)
class Absent(ByValues):
    package = "no_such_package"
