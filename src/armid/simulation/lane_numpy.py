"""Names of numpy, math and builtins for lanes, so that one plain source serves arrays, scalars and lanes."""

import builtins
import math
import operator
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba.extending import overload

from armid.simulation import lane_math
from armid.simulation.lanes import (
    Lanes,
    fabs,
    floor_of,
    is_number,
    mixes_lanes,
    nearest,
    select,
    square_root,
)

# Every function that lanes have; what is not here is computed lane by lane.
LANE_FUNCTIONS: set[Any] = {np.where, np.clip}


def define_unary(names: tuple[Any, ...], implementation: Callable[..., Any]) -> None:
    """Give numba the functions of one lane argument."""
    LANE_FUNCTIONS.update(names)
    for name in names:

        @overload(name)
        def act(x):
            return (lambda x: implementation(x)) if isinstance(x, Lanes) else None


def define_binary(names: tuple[Any, ...], implementation: Callable[..., Any]) -> None:
    """Give numba functions of two arguments of which at least one is lanes."""
    LANE_FUNCTIONS.update(names)
    for name in names:

        @overload(name)
        def act(a, b):
            return (lambda a, b: implementation(a, b)) if mixes_lanes(a, b) else None


def define_extreme(name: Any, implementation: Callable[..., Any], passes_nan: bool) -> None:
    """Give numba a minimum or maximum that passes on the NaN of either argument, or of neither.

    `implementation(a, b)` returns a where one of them is NaN. Plain numbers come second: they are known to be finite.
    """
    LANE_FUNCTIONS.add(name)

    @overload(name)
    def act(a, b):
        if not mixes_lanes(a, b):
            return None
        if not isinstance(a, Lanes):
            return lambda a, b: implementation(b, a)
        if not isinstance(b, Lanes):
            return lambda a, b: implementation(a, b)
        if passes_nan:
            return lambda a, b: select(b != b, 0.5, b, implementation(a, b))
        return lambda a, b: select(a != a, 0.5, b, implementation(a, b))


@numba.njit
def smaller(a, b):
    return select(a, b, b, a)


@numba.njit
def larger(a, b):
    return select(b, a, b, a)


@numba.njit
def both(a, b):
    return select(a != 0.0, 0.5, b != 0.0, 0.0)


@numba.njit
def either(a, b):
    return select(a != 0.0, 0.5, 1.0, b != 0.0)


@numba.njit
def neither(a):
    return a == 0.0


@numba.njit
def with_sign(a, b):
    return select(-b, 0.0, -abs(a), abs(a))


@numba.njit
def length(a, b):
    """Return the root of the sum of squares, which must be neither too large nor too small for a double."""
    return square_root(a * a + b * b)


@numba.njit
def arctan2(y, x):
    half = lane_math.lanes_arctan(y / x) + select(-x, 0.0, with_sign(np.pi, y), 0.0)
    return select(x == 0.0, 0.5, with_sign(0.5 * np.pi, y) * abs(lane_math.lanes_sign(y)), half)


@overload(np.where)
def where(condition, a, b):
    """Choose by a condition; also for plain numbers, which numba's own `where` refuses."""
    if mixes_lanes(condition, a, b):
        return lambda condition, a, b: select(condition != 0.0, 0.5, a, b)
    if all(is_number(t) for t in (condition, a, b)):
        return lambda condition, a, b: (a * 1.0) if condition else (b * 1.0)
    return None


@overload(np.clip)
def clip(x, low, high):
    """Bound from below, then from above; also plain numbers, which numba's own `clip` returns as an array."""
    if mixes_lanes(x, low, high) or all(is_number(t) for t in (x, low, high)):
        return lambda x, low, high: np.minimum(np.maximum(x, low), high)
    return None


def define_power(name: Any) -> None:
    """Give numba the power of lanes."""
    LANE_FUNCTIONS.add(name)

    @overload(name)
    def act(a, b):
        if not mixes_lanes(a, b):
            return None
        return lambda a, b: lane_math.lanes_power(select(1.0, 0.0, a, b), select(1.0, 0.0, b, a))


for _name in (operator.pow, np.power, math.pow):
    define_power(_name)

define_unary((np.sqrt, math.sqrt), square_root)
define_unary((np.abs, np.fabs, math.fabs, builtins.abs), fabs)
define_unary((np.floor,), floor_of)
define_unary((np.rint,), nearest)
define_unary((np.exp, math.exp), lane_math.lanes_exp)
define_unary((np.log, math.log), lane_math.lanes_log)
define_unary((np.sin, math.sin), lane_math.lanes_sin)
define_unary((np.cos, math.cos), lane_math.lanes_cos)
define_unary((np.arctan, math.atan), lane_math.lanes_arctan)
define_unary((np.tanh, math.tanh), lane_math.lanes_tanh)
define_unary((np.sign,), lane_math.lanes_sign)
define_unary((np.square,), numba.njit(lambda x: x * x))
define_unary((np.reciprocal,), numba.njit(lambda x: 1.0 / x))
define_unary((np.negative,), numba.njit(lambda x: -x))
define_unary((np.logical_not, operator.invert), neither)
define_binary((builtins.min,), smaller)
define_binary((builtins.max,), larger)
define_extreme(np.minimum, smaller, passes_nan=True)
define_extreme(np.maximum, larger, passes_nan=True)
define_extreme(np.fmin, smaller, passes_nan=False)
define_extreme(np.fmax, larger, passes_nan=False)
define_binary((np.logical_and, operator.and_), both)
define_binary((np.logical_or, operator.or_), either)
define_binary((np.copysign, math.copysign), with_sign)
define_binary((np.hypot, math.hypot), length)
define_binary((np.arctan2, math.atan2), arctan2)
