"""Every function that lanes have, against numpy, over wide ranges and at the corners."""

import builtins
import math
import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from armid.engine import simd_math as lane_numpy
from armid.engine.simd import LANE_WIDTH, load, splat, store
from armid.engine.simd_math import FAR_ANGLE

Array = NDArray[np.float64]
EPS = np.finfo(float).eps
CORNERS = np.array([0.0, 1.0, -1.0, 0.5, -0.5, 2.0, -2.0, 1e-300, -1e-300, 1e-8, -1e-8, np.pi, 709.5, -707.0,
                    1e5, -1e5, 1e9, 1e17, -1e200, 1e300, np.inf, -np.inf, np.nan])  # fmt: skip


class Case(NamedTuple):
    """One function: what lanes get, what numpy says, and how far apart they may be.

    text: expression of x and y; expected: numpy's; inputs: pairs of values, (2, n); tolerance: relative, in eps.
    """

    text: str
    expected: Callable[..., Any]
    inputs: Array
    tolerance: float = 0.0


def spread(low=1e-300, high=1e300, sign=True):
    """Values over many decades, both signs, with the corners."""
    random = np.random.default_rng(7)
    decades = 10.0 ** random.uniform(np.log10(low), np.log10(high), 400)
    near = random.normal(size=200) * min(3.0, high)
    values = np.concatenate([decades, np.abs(near)])
    return np.concatenate([values, -values, CORNERS] if sign else [values, np.abs(CORNERS)])


def pairs(values):
    """Each value with another, and all pairs of corners."""
    other = np.random.default_rng(8).permutation(values)
    a, b = np.meshgrid(CORNERS, CORNERS)
    return np.array([np.concatenate([values, a.ravel()]), np.concatenate([other, b.ravel()])])


def single(values):
    return np.array([values, values])


def without(inputs, *conditions):
    for condition in conditions:
        inputs = inputs[:, ~condition(*inputs)]
    return inputs


def both_infinite(x, y):
    return np.asarray(np.isinf(x) & np.isinf(y))


def square_leaves_range(x, y):
    """The length of two lanes is the root of squares: those must neither overflow nor vanish."""
    return np.asarray(np.logical_or.reduce([(np.abs(v) > 1e150) | ((np.abs(v) < 1e-150) & (v != 0.0)) for v in (x, y)]))


def subnormal(*values):
    return np.asarray(np.logical_or.reduce([(np.abs(v) < 2.3e-308) & (v != 0.0) for v in values]))


ANY, TWO = single(spread()), pairs(spread())
ANGLES = single(spread(1e-12, FAR_ANGLE))
SQUARES = without(pairs(spread(1e-140, 1e140)), square_leaves_range)
POWERS = pairs(np.concatenate([spread(1e-6, 1e6), np.arange(-6.0, 7.0)]))

CASES = [
    Case("np.sqrt(x)", np.sqrt, ANY, 1.0), Case("math.sqrt(x)", np.sqrt, ANY, 1.0), Case("np.abs(x)", np.abs, ANY),
    Case("np.fabs(x)", np.abs, ANY), Case("math.fabs(x)", np.abs, ANY), Case("abs(x)", np.abs, ANY),
    Case("np.floor(x)", np.floor, ANY), Case("np.rint(x)", np.rint, ANY),
    Case("np.exp(x)", np.exp, without(ANY, lambda x, y: x < -708.0), 4.0),
    Case("math.exp(x)", np.exp, single(np.linspace(-700.0, 709.7, 999)), 4.0), Case("np.log(x)", np.log, ANY, 4.0),
    Case("math.log(x)", np.log, ANY, 4.0), Case("np.arctan(x)", np.arctan, ANY, 4.0),
    Case("math.atan(x)", np.arctan, ANY, 4.0), Case("np.tanh(x)", np.tanh, ANY, 30.0),
    Case("math.tanh(x)", np.tanh, ANY, 30.0), Case("np.sign(x)", np.sign, ANY),
    Case("np.square(x)", np.square, ANY, 1.0),
    Case("np.reciprocal(x)", np.reciprocal, without(ANY, lambda x, y: (x == 0.0) & np.signbit(x)), 1.0),
    Case("np.negative(x)", np.negative, ANY), Case("-x", np.negative, ANY), Case("+x", np.positive, ANY),
    Case("np.logical_not(x)", np.logical_not, ANY), Case("~(x > 0)", lambda x, y: ~(x > 0), ANY),
    Case("np.minimum(x, y)", np.minimum, TWO), Case("np.maximum(x, y)", np.maximum, TWO),
    Case("np.fmin(x, y)", np.fmin, TWO), Case("np.fmax(x, y)", np.fmax, TWO),
    Case("min(x, y)", np.vectorize(min), TWO), Case("max(x, y)", np.vectorize(max), TWO),
    Case("np.minimum(x, 2)", lambda x, y: np.minimum(x, 2), TWO),
    Case("np.minimum(2, x)", lambda x, y: np.minimum(2, x), TWO),
    Case("np.maximum(0.5, x)", lambda x, y: np.maximum(0.5, x), TWO),
    Case("np.clip(x, -1.0, 2.0)", lambda x, y: np.clip(x, -1.0, 2.0), TWO),
    Case("np.clip(x, y, 5.0)", lambda x, y: np.minimum(np.maximum(x, y), 5.0), TWO),
    Case("np.logical_and(x, y)", np.logical_and, TWO), Case("np.logical_or(x, y)", np.logical_or, TWO),
    Case("(x > 0) & (y < 1)", lambda x, y: (x > 0) & (y < 1), TWO),
    Case("(x > 0) | (y < 1)", lambda x, y: (x > 0) | (y < 1), TWO),
    Case("np.where(x, y, 3.0)", lambda x, y: np.where(x, y, 3.0), TWO),
    Case("np.where(x > y, x, -y)", lambda x, y: np.where(x > y, x, -y), TWO),
    Case("np.where(x > 0, 1, 2)", lambda x, y: np.where(x > 0, 1, 2), TWO),
    Case("np.copysign(x, y)", np.copysign, without(TWO, lambda x, y: np.isnan(y))),
    Case("math.copysign(x, y)", np.copysign, without(TWO, lambda x, y: np.isnan(y))),
    Case("np.hypot(x, y)", np.hypot, SQUARES, 4.0), Case("math.hypot(x, y)", np.hypot, SQUARES, 4.0),
    Case("np.arctan2(x, y)", np.arctan2, without(TWO, both_infinite), 4.0),
    Case("math.atan2(x, y)", np.arctan2, without(TWO, both_infinite), 4.0),
    Case("np.power(x, y)", np.power, POWERS, 3000.0), Case("math.pow(x, y)", np.power, POWERS, 3000.0),
    Case("x ** y", np.power, POWERS, 3000.0), Case("x ** 2.5", lambda x, y: x**2.5, POWERS, 3000.0),
    Case("1.7 ** x", lambda x, y: 1.7**x, without(POWERS, lambda x, y: x < -1300), 3000.0),
    Case("x + y", np.add, TWO, 1.0), Case("x - 2", lambda x, y: x - 2, TWO, 1.0),
    Case("3 * x", lambda x, y: 3 * x, TWO, 1.0), Case("x * y", np.multiply, TWO, 1.0),
    Case("x / y", np.divide, without(TWO, lambda x, y: (y == 0.0) & np.signbit(y)), 1.0),
    Case("1 / x", lambda x, y: 1 / x, TWO, 1.0), Case("x < y", np.less, TWO), Case("x <= y", np.less_equal, TWO),
    Case("x > y", np.greater, TWO), Case("x >= y", np.greater_equal, TWO), Case("x == y", np.equal, TWO),
    Case("x != y", np.not_equal, TWO), Case("0 < x", lambda x, y: x > 0, TWO),
]  # fmt: skip
# Sine and cosine are right to a few eps of 1, not of their own value near a zero.
ANGLE_CASES = [
    Case("np.sin(x)", np.sin, ANGLES), Case("math.sin(x)", np.sin, ANGLES),
    Case("np.cos(x)", np.cos, ANGLES), Case("math.cos(x)", np.cos, ANGLES),
]  # fmt: skip
ALL = [*CASES, *ANGLE_CASES]


@pytest.fixture(scope="module")
def results():
    """What lanes make of every case; one compilation for all of them."""
    lines = [f"store(out, {k} * n + i, splat(0.0) + 1.0 * ({c.text}))" for k, c in enumerate(ALL)]
    loads = [f"x, y = load(given, {2 * k} * n + i), load(given, {2 * k + 1} * n + i)" for k in range(len(ALL))]
    body = "\n".join(f"        {load}\n        {line}" for load, line in zip(loads, lines))
    text = f"def apply(given, n, out):\n    for i in range(0, n, {LANE_WIDTH}):\n{body}\n"
    names = {"np": np, "math": math, "load": load, "store": store, "splat": splat}
    exec(text, names)
    n = -(-max(c.inputs.shape[1] for c in ALL) // LANE_WIDTH) * LANE_WIDTH
    given = np.ones((len(ALL), 2, n))
    for k, case in enumerate(ALL):
        given[k, :, : case.inputs.shape[1]] = case.inputs
    out = np.empty((len(ALL), n))
    numba.njit(error_model="numpy")(names["apply"])(given.ravel(), n, out.ravel())
    return {c.text: out[k, : c.inputs.shape[1]] for k, c in enumerate(ALL)}


def expected_of(case):
    with np.errstate(all="ignore"):
        wants_one = isinstance(case.expected, np.ufunc) and case.expected.nin == 1
        return np.asarray(case.expected(*case.inputs[: 1 if wants_one else 2]), dtype=float)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda c: c.text)
def test_agrees_with_numpy(case, results):
    found, expected = results[case.text], expected_of(case)
    expected = np.where(subnormal(expected), 0.0, expected) if case.tolerance else expected
    same = (found == expected) | (np.isnan(found) & np.isnan(expected))
    with np.errstate(all="ignore"):
        near = np.abs(found - expected) <= case.tolerance * EPS * np.abs(expected) + 2.3e-308
    wrong = np.flatnonzero(~(same | near))
    assert wrong.size == 0, [(case.inputs[:, i], found[i], expected[i]) for i in wrong[:5]]


@pytest.mark.slow
@pytest.mark.parametrize("case", ANGLE_CASES, ids=lambda c: c.text)
def test_sine_and_cosine_agree_with_numpy(case, results):
    found, expected = results[case.text], expected_of(case)
    assert np.array_equal(np.isnan(found), np.isnan(expected))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=4 * EPS)


def test_every_function_of_lanes_has_a_case():
    spelt = {operator.pow: "**", operator.and_: "&", operator.or_: "|", operator.invert: "~", operator.neg: "-x",
             operator.pos: "+x"}  # fmt: skip
    for function in lane_numpy.LANE_FUNCTIONS:
        name = getattr(function, "__name__", str(function))
        texts = [f"np.{name}(", f"math.{name}("]
        if getattr(builtins, name, None) is function:
            texts = [f"{name}("]
        if function in spelt:
            texts = [spelt[function]]
        alias = {np.abs: "np.abs("}.get(function)
        texts += [alias] if alias else []
        assert any(t in c.text for t in texts for c in ALL), name
