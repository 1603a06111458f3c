"""What numba compiles, run as the plain Python that it is: the same numbers, and every line is seen to run."""

import math
import sys

import numpy as np
import pytest

import armid
from armid.engine import simd_math

# What the operations on lanes are for one number.
ONE_LANE = {
    "select": lambda a, b, x, y: x if a > b else y, "any_above": lambda a, b: a > b, "fabs": abs,
    "floor_of": np.floor, "nearest": np.rint, "fused": lambda a, b, c: a * b + c, "square_root": math.sqrt,
    "two_to_the": lambda k: 2.0**k, "mantissa_of": lambda x: 2.0 * np.frexp(x)[0],
    "exponent_of": lambda x: math.frexp(x)[1] - 1.0, "LANE_WIDTH": 1, "lane": lambda x, i: x,
    "with_lane": lambda x, i, value: value,
}  # fmt: skip
NUMBERS = (-700.0, -40.5, -3.0, -1.0, -0.7, -1e-3, 1e-9, 0.01, 0.3, 0.7, 1.0, 2.0, 2.5, 19.0, 650.0)
ONE = {
    "lanes_exp": np.exp, "lanes_log": np.log, "lanes_sin": np.sin, "lanes_cos": np.cos, "lanes_arctan": np.arctan,
    "lanes_tanh": np.tanh, "lanes_sign": np.sign,
}  # fmt: skip
TWO = {
    "lanes_power": np.power, "smaller": np.minimum, "larger": np.maximum, "with_sign": np.copysign,
    "length": np.hypot, "arctan2": np.arctan2,
}  # fmt: skip


@pytest.fixture
def plain(monkeypatch):
    """Return a function that puts the plain functions of a module in the place of the compiled ones."""

    def put(module, **others):
        for name, thing in [*vars(module).items()]:
            if hasattr(thing, "py_func"):
                monkeypatch.setattr(module, name, thing.py_func)
        for name, function in others.items():
            monkeypatch.setattr(module, name, function)

    return put


@pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning")
def test_functions_of_lanes_are_those_of_numpy(plain):
    plain(simd_math, **ONE_LANE)
    for name, function in ONE.items():
        numbers = [x for x in NUMBERS if x > 0.0] if name == "lanes_log" else (*NUMBERS, 2e5, -3e5)
        if name == "lanes_exp":
            numbers = NUMBERS
        found = [getattr(simd_math, name)(x) for x in map(np.float64, numbers)]
        np.testing.assert_allclose(found, function(np.array(numbers)), rtol=1e-9, atol=1e-12, err_msg=name)
    for name, function in TWO.items():
        pairs = np.array([(a, b) for a in NUMBERS for b in NUMBERS if abs(a) < 100 and abs(b) < 20])
        if name == "lanes_power":
            pairs = np.array([(a, b) for a, b in pairs if a > 0.0 or b.is_integer()])
        found = [getattr(simd_math, name)(a, b) for a, b in pairs]
        np.testing.assert_allclose(found, function(*pairs.T), rtol=1e-9, atol=1e-12, err_msg=name)


def test_a_fitness_is_what_its_plain_text_says(plain):
    generator = np.random.default_rng(3)
    times = np.arange(120) / 100.0
    measured = np.sin(7.0 * times) * np.exp(-times)
    rows = measured + 0.2 * generator.normal(size=(12, 120)).cumsum(axis=1) / 10.0
    rows[3] = np.nan
    rows[4] = 0.5
    rows[5] = measured

    def told():
        squares = [armid.FITNESS[name].function(measured, rows) for name in ("rmse", "nrmse")]
        return [*squares, *armid.similarity(measured, rows, 0.01), armid.numerical_similarity(measured, rows)]

    compiled = told()
    for module in [module for name, module in sys.modules.items() if name.startswith("armid.problem.")]:
        plain(module)
    for found, wanted in zip(told(), compiled, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-12)
