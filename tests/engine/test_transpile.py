"""A user's functions in the generated module: what can be written, and that it computes the same as in Python."""

import functools
import random

import equations_of_a_user as user
import numpy as np
import pytest

from armid.engine import Schedule, simulate
from armid.engine.transpile import SourceText
from armid.errors import ArmidError
from armid.model import PLANTS, Effect, Guard, Manoeuvre, Model, Parameter, Plant, Scales, State

ALL = [*user.VECTOR, *user.BY_LANE]
LEVELS = np.array([0.0, 0.25, 0.6])
N_SAMPLES = 97


def one():
    return 1.0


# It starts before 0, so that the speed runs through it, and records what the effects add, and nothing else.
ramp = Plant(
    name="ramp", parameters=(Parameter("unused", "1", 0.0, 1.0),), ports={"output": "rad/s"},
    states=(State("omega", "rad/s", one, lambda: -0.5),), scales=Scales(effort=1.0, speed=1.0),
    quantities={"recorded": lambda output: output}, output="recorded", output_unit="rad/s",
)  # fmt: skip


def name_of(function):
    return f"{function.__name__.strip('<>')}_{function.__code__.co_firstlineno}"


@pytest.fixture(scope="module")
def found():
    """The ramp with every equation as an effect; in each candidate one of them is not at its null, one level each."""
    effects = tuple(
        Effect(f"e{i}", (Parameter("level", "1", 0.0, 1.0, null=0.0),), {"output": f}) for i, f in enumerate(ALL)
    )
    population = np.zeros((len(ALL) * len(LEVELS), 1 + len(ALL)))
    for i in range(len(ALL)):
        population[i * len(LEVELS) : (i + 1) * len(LEVELS), 1 + i] = LEVELS
    return simulate(Model(ramp, effects), Manoeuvre(1 / 64, N_SAMPLES), population, Schedule(), states=True)


@pytest.mark.slow
@pytest.mark.parametrize("function", ALL, ids=name_of)
def test_computes_the_same_as_python(function, found):
    speeds = found.states["omega"][0]
    assert np.array_equal(speeds, -0.5 + np.arange(N_SAMPLES) / 64)
    expected = [[float(function(float(w), float(level))) for w in speeds] for level in LEVELS]
    i = ALL.index(function)
    made = found.output[i * len(LEVELS) : (i + 1) * len(LEVELS)]
    np.testing.assert_allclose(made, expected, rtol=1e-14, atol=1e-15)


def test_runs_lane_by_lane_only_where_it_must():
    for function in ALL:
        sources = SourceText()
        sources.add("f__x", function)
        assert ("f__x" in sources.by_lane) == (function in user.BY_LANE), name_of(function)


NAMES = ("h", "np", "math", "i", "lane", "k1_x", "result")


def with_names_of_the_loop(h, np, math, i, lane, k1_x, result):
    """Names that the generated module uses itself, and those of modules and builtins."""
    if i > 100.0:
        return 0.0
    return h + 8 * np + math**2 + i + lane + k1_x + result


def falls(h):
    """A guard, so that the part which cuts steps is there too."""
    return h - 0.2


@pytest.mark.slow
def test_names_of_the_loop_numpy_and_builtins_and_an_own_clock_and_switch_can_be_used():
    states = tuple(State(n, "1", one, one) for n in NAMES)
    guards = (Guard("kink", falls), Guard("n", falls, latch=True))
    parameters = (Parameter("x", "1", 0.0, 1.0, null=0.0), Parameter("time_of", "1", 0.0, 1.0))
    odd = Effect("odd", parameters, {"output": with_names_of_the_loop}, states, guards)
    few = tuple(State(n, "1", one, one) for n in ("np", "abs", "span"))
    more = Effect("more", (Parameter("x", "1", 0.0, 1.0, null=0.0),),
                  {"output": lambda np, abs, span, x: np**2 * (1.0 if abs > 0.0 else span) + x}, few)  # fmt: skip
    # nothing before the switch, then in proportion to the time since
    late = Effect("late", (Parameter("level", "1", 0.0, 1.0, null=0.0),),
                  {"output": lambda on, clock, level: level * on * (clock - 0.5)},
                  (State("clock", "s", one, lambda: 0.0),),
                  (Guard("on", lambda clock: 0.5 - clock, latch=True),))  # fmt: skip
    candidates = [[0.0, 0.0, 0.5, 0.25, level] for level in (0.0, 2.0)]
    found = simulate(Model(ramp) + odd + more + late, Manoeuvre(0.03, 41), candidates, states=True)
    times = 0.03 * np.arange(41)
    now = 1.0 + times
    expected = (1 + 8 + 4) * now + now**2 + now**2 + 0.25
    np.testing.assert_allclose(found.output[0], expected, rtol=1e-14)
    assert set(found.states) >= {"omega", *(f"odd.{n}" for n in NAMES), "more.np", "more.abs", "more.span"}
    assert found.switch_times["late.on"] == pytest.approx(0.5, abs=1e-12)
    np.testing.assert_allclose(found.output[1] - expected, 2.0 * np.maximum(times - 0.5, 0.0), atol=1e-12)


def of_constants(gain, gravity_moment):
    """Selections among plain numbers, which numba alone refuses."""
    low = np.where(gain > 1.0, 1.0, -1.0) + np.clip(gain, 3.0, 4.0) + np.minimum(gain, 7.0)
    return low + (10.0 if gravity_moment == 0.0 and gain > 0 else 20.0) + max(gain, gravity_moment, 1.5)


def test_selections_work_on_plain_numbers_too():
    push = Effect("push", (Parameter("unused", "1", 0.0, 1.0, null=0.0),), {"torque": of_constants})
    rest = Manoeuvre(0.01, 11, {"gain": 2.0}, {"u": np.zeros(11)})
    found = simulate(Model(PLANTS["driven_axis"]) + push, rest, [[1.0, 0.0]])
    np.testing.assert_allclose(found.output[0], (1.0 + 3.0 + 2.0 + 10.0 + 2.0) * 0.01 * np.arange(11), atol=1e-12)


MANOEUVRE = Manoeuvre(0.01, 20, inputs={"u": np.ones(20)})
TABLE = {"a": 1.0}


def itself(omega, level):
    """Call itself."""
    return itself(omega, level)


def unknown_object(omega, level):
    return TABLE["a"] * omega * level


def nothing_returned(omega, level):
    omega + level


def odd_default(omega, level, table=TABLE):
    return omega * level


def sometimes_nothing(omega, level):
    if omega > 0:
        return None
    return level


def imports(omega, level):
    import math

    return math.sin(omega) * level


def plain(omega, level):
    return -omega * level


class Owner:
    """Something with a method."""

    def method(self, omega, level):
        return -omega * level


def always_raises(omega, level):
    raise ValueError(omega)


def misspelt(omega, level):
    return omega * levle  # noqa: F821


typed = {}
exec("def typed_in(omega, level): return -omega * level", typed)

TOLD = {
    "or": (lambda omega, level: -level / (omega or 1e-9),
            "'omega or 1e-09' joins numbers by `or`: conditions are expected"),
    "calls itself": (itself, "the equation itself calls itself: write it as a loop"),
    "object": (unknown_object, r"the equation unknown_object uses 'TABLE' \(dict\), which cannot be compiled: numpy"),
    "module": (lambda omega, level: random.random() * level, r"uses 'random' \(module\), which cannot be compiled"),
    "builtin": (lambda omega, level: sorted([omega, level]), "uses 'sorted', which cannot be compiled"),
    "unknown name": (misspelt, "uses 'levle', which is neither an argument of it nor defined in its file: did you mean "
                               "'level'"),
    "raises": (always_raises, "the equation always_raises raises an error and returns nothing: a number is expected"),
    "no return": (nothing_returned, "the equation nothing_returned returns nothing: a number is expected"),
    "default": (odd_default, "the equation odd_default has the default {'a': 1.0}: a number is expected"),
    "no source": (typed["typed_in"], "the source of the equation typed_in cannot be read: define it in a file"),
    "partial": (functools.partial(plain), "is not a plain Python function: write it as a def"),
    "method": (Owner().method, "the equation Owner.method is not a plain Python function: write it as a def"),
}  # fmt: skip
COMPILED = {
    "arrays": (lambda omega, level: level * np.linalg.norm(omega),
               r"the equation 'bad.torque' cannot be compiled \(numba has no norm\(float64\)\): numpy"),
    "several": (lambda omega, level: np.array([omega, level]),
                r"\(it returns several numbers\): one number is expected"),
    "import": (imports, r"the equation 'bad.torque' cannot be compiled \(numba: Use of unsupported opcode"),
    "None": (sometimes_nothing, r"the equation 'bad.torque' cannot be compiled \(it does not return a number in every"),
}  # fmt: skip


def refused(function, sentence):
    bad = Effect("bad", (Parameter("level", "effort", 0, 1, null=0.0),), {"torque": function})
    with pytest.raises(ArmidError, match=sentence) as caught:
        simulate(Model(PLANTS["driven_axis"]) + bad, MANOEUVRE, [[1.0, 0.1]])
    assert "\n" not in str(caught.value)
    return caught.value


@pytest.mark.parametrize(("function", "sentence"), TOLD.values(), ids=TOLD)
def test_what_cannot_be_written_down(function, sentence):
    refused(function, sentence)


@pytest.mark.slow
@pytest.mark.parametrize(("function", "sentence"), COMPILED.values(), ids=COMPILED)
def test_what_numba_cannot_compile(function, sentence):
    error = refused(function, sentence)
    assert error.__cause__ is not None, "the cause must not be lost"


def test_a_rate_that_is_several_numbers_is_told_in_the_same_words():
    lag = State("lag", "rad/s", lambda lag, omega: (omega, lag), lambda: 0.0)
    bad = Effect("bad", (Parameter("c", "effort/speed", 0, 1, null=0.0),), {"torque": lambda lag, c: -c * lag}, (lag,))
    with pytest.raises(ArmidError, match=r"\(it returns several numbers\): one number is expected"):
        simulate(Model(PLANTS["driven_axis"]) + bad, MANOEUVRE, [[1.0, 0.1]])
