"""Any text for options: values, or one sentence; and an identifier that was built also runs."""

import warnings

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st
from pymoo.core.algorithm import Algorithm
from pymoo.optimize import minimize
from reading_whatever import many, outcome

from armid.cli.options import assignments, interval, intervals, numbers, value_of
from armid.contract.identifier import Trial
from armid.identifiers import IDENTIFIERS, identifier_of
from armid.model import PLANTS, Model
from armid.problem.meter import Meter, MeterTermination
from armid.problem.space import space_of

BUDGET = 30
OPTIONS = (
    "n_particles", "n_iterations", "c1", "first_inertia", "velocity_limit", "pop_size", "n_offsprings", "CR", "F", "w",
    "variant", "adaptive", "initial_velocity", "eliminate_duplicates", "initial_step", "tolerance", "differences",
    "step", "n_candidates", "growth", "share", "seed", "budget", "self", "termination", "pso.c1", "bobyqa.tolerance", ""
)  # fmt: skip
NAMES = (*IDENTIFIERS, "pso+bobyqa", "de+least_squares", "multistart:nelder_mead", "random+slsqp")
TEXTS = st.one_of(
    st.sampled_from(["nan", "inf", "-inf", "1e400", "-1", "0", "1", "2", "0.5", "1e-300", "true", "rand", "literal",
                     "forward", "9" * 5000, "0.5:0.3", "1_000", "DE/rand/2/bin", "\u0661", "0x10"]),
    st.text(max_size=6), st.floats().map(repr), st.integers(-5, 60).map(str),
)  # fmt: skip
PARTS = st.one_of(st.sampled_from(["p0", "k", "eta3", "n", "q", "", "=", ":"]), TEXTS)
ARM = Model(PLANTS["shell_transfer_arm"])


@many(160)
@given(st.sampled_from(NAMES), st.lists(st.tuples(st.one_of(st.sampled_from(OPTIONS), st.text(max_size=5)), TEXTS),
                                        min_size=1, max_size=2))  # fmt: skip
@example("pso", [("seed", "2")])
@example("pso", [("self", "1")])
@example("pso", [("budget", "3")])
@example("pso", [("display", "1")])
@example("pso", [("n_particles", "1000000000000")])
@example("bobyqa", [("initial_step", "1")])
@example("de", [("variant", "a/b")])
@example("pso", [("", "\n")])
def test_any_option(name, options):
    def built() -> Algorithm:
        given = assignments([f"{option}={text}" for option, text in options], "--option")
        told = {option: value_of(text) for option, text in given.items()}
        return identifier_of(name, IDENTIFIERS).with_options(told).build(BUDGET)

    algorithm = outcome(built)
    if algorithm is None:
        return
    meter = Meter(BUDGET)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        minimize(Trial(meter), algorithm, MeterTermination(meter), seed=1, copy_algorithm=False)
    assert 0 < meter.used <= BUDGET


@many(100)
@given(st.text(alphabet="pso+bqya:multirde_ ", max_size=16))
def test_any_name_of_an_identifier(name):
    outcome(lambda: identifier_of(name, IDENTIFIERS).build(BUDGET))


@many(100)
@given(st.lists(st.tuples(PARTS, PARTS, PARTS), max_size=2), st.lists(st.tuples(PARTS, PARTS), max_size=2))
def test_any_bounds_and_fixed_values(bounds, fixed):
    def space():
        wide = intervals([f"{name}={low}:{high}" for name, low, high in bounds], "--bounds")
        return space_of(ARM, {}, wide, numbers([f"{name}={value}" for name, value in fixed], "--fix"))

    found = outcome(space)
    if found is not None:
        assert np.isfinite([found.low, found.high]).all()
        assert (found.low < found.high).all()


@many(100)
@given(st.one_of(st.text(max_size=10), st.tuples(TEXTS, TEXTS).map(":".join)))
def test_any_window(text):
    outcome(lambda: interval(text, "--window"))
