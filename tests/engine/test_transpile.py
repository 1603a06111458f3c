"""A user's functions in the generated module: what can be written, and that it computes the same as in Python."""

from collections.abc import Callable
from typing import Any

import equations_of_a_user as user
import numpy as np
import pytest
from numpy.typing import NDArray

from armid.engine import Schedule, Simulation, simulate
from armid.engine.transpile import SourceText
from armid.model import PLANTS, Effect, Guard, Manoeuvre, Model, Parameter, Plant, Scales, State

ALL = [*user.VECTOR, *user.BY_LANE]
LEVELS = np.array([0.0, 0.25, 0.6])
N_SAMPLES = 97


def one():
    return 1.0


def begin():
    """Start before 0, so that the speed runs through it."""
    return -0.5


def recorded(output):
    """What the effects add, and nothing else."""
    return output


ramp = Plant(
    name="ramp",
    parameters=(Parameter("unused", "1", 0.0, 1.0),),
    states=(State("omega", "rad/s", one, begin),),
    quantities={"recorded": recorded},
    output="recorded",
    output_unit="rad/s",
    ports={"output": "rad/s"},
    scales=Scales(effort=1.0, speed=1.0),
)


def name_of(function: Callable[..., Any]) -> str:
    return f"{function.__name__.strip('<>')}_{function.__code__.co_firstlineno}"


@pytest.fixture(scope="module")
def found() -> Simulation:
    """The ramp with every equation as an effect; in each candidate one of them is not at its null, one level each."""
    effects = tuple(
        Effect(f"e{i}", (Parameter("level", "1", 0.0, 1.0, null=0.0),), {"output": f}) for i, f in enumerate(ALL)
    )
    population = np.zeros((len(ALL) * len(LEVELS), 1 + len(ALL)))
    for i in range(len(ALL)):
        population[i * len(LEVELS) : (i + 1) * len(LEVELS), 1 + i] = LEVELS
    return simulate(Model(ramp, effects), Manoeuvre(1 / 64, N_SAMPLES), population, Schedule(), states=True)


def rows_of(found: Simulation, function: Callable[..., Any]) -> NDArray[np.float64]:
    """What the engine makes of an equation, (n_levels, n_samples)."""
    i = ALL.index(function)
    return found.output[i * len(LEVELS) : (i + 1) * len(LEVELS)]


@pytest.mark.parametrize("function", ALL, ids=name_of)
def test_computes_the_same_as_python(function: Callable[..., Any], found: Simulation) -> None:
    speeds = found.states["omega"][0]
    assert np.array_equal(speeds, -0.5 + np.arange(N_SAMPLES) / 64)
    expected = [[float(function(float(w), float(level))) for w in speeds] for level in LEVELS]
    np.testing.assert_allclose(rows_of(found, function), expected, rtol=1e-14, atol=1e-15)


def test_runs_lane_by_lane_only_where_it_must() -> None:
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


def on_lanes(np, abs, span, x):
    return np**2 * (1.0 if abs > 0.0 else span) + x


def falls(h):
    """A guard, so that the part which cuts steps is there too."""
    return h - 0.2


def waits(clock):
    return 0.5 - clock


def after(on, clock, level):
    """Nothing before the switch, then in proportion to the time since."""
    return level * on * (clock - 0.5)


def zero():
    return 0.0


@pytest.mark.slow
def test_names_of_the_loop_numpy_and_builtins_and_an_own_clock_and_switch_can_be_used() -> None:
    states = tuple(State(n, "1", one, one) for n in NAMES)
    guards = (Guard("kink", falls), Guard("n", falls, latch=True))
    parameters = (Parameter("x", "1", 0.0, 1.0, null=0.0), Parameter("time_of", "1", 0.0, 1.0))
    odd = Effect("odd", parameters, {"output": with_names_of_the_loop}, states, guards)
    few = tuple(State(n, "1", one, one) for n in ("np", "abs", "span"))
    more = Effect("more", (Parameter("x", "1", 0.0, 1.0, null=0.0),), {"output": on_lanes}, few)
    late = Effect("late", (Parameter("level", "1", 0.0, 1.0, null=0.0),), {"output": after},
                  (State("clock", "s", one, zero),), (Guard("on", waits, latch=True),))  # fmt: skip
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


def test_selections_work_on_plain_numbers_too() -> None:
    push = Effect("push", (Parameter("unused", "1", 0.0, 1.0, null=0.0),), {"torque": of_constants})
    rest = Manoeuvre(0.01, 11, {"gain": 2.0}, {"u": np.zeros(11)})
    found = simulate(Model(PLANTS["driven_axis"]) + push, rest, [[1.0, 0.0]])
    np.testing.assert_allclose(found.output[0], (1.0 + 3.0 + 2.0 + 10.0 + 2.0) * 0.01 * np.arange(11), atol=1e-12)
