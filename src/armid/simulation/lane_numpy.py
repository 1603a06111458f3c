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
    lane,
    mixes_lanes,
    nearest,
    select,
    square_root,
    with_lane,
)


def define_unary(names: tuple[Any, ...], implementation: Callable[..., Any]) -> None:
    """Give numba the functions of one lane argument."""
    for name in names:

        @overload(name)
        def act(x):  # type: ignore[no-untyped-def]
            return (lambda x: implementation(x)) if isinstance(x, Lanes) else None


def define_by_lane(names: tuple[Any, ...], scalar: Callable[..., Any]) -> None:
    """Give numba functions of one argument that are computed lane by lane with a scalar function."""
    for name in names:

        @overload(name)
        def act(x):  # type: ignore[no-untyped-def]
            if not isinstance(x, Lanes):
                return None
            width = x.width

            def by_lane(x):  # type: ignore[no-untyped-def]
                result = x
                for i in range(width):
                    result = with_lane(result, i, scalar(lane(x, i)))
                return result

            return by_lane


def define_binary(names: tuple[Any, ...], implementation: Callable[..., Any]) -> None:
    """Give numba functions of two arguments of which at least one is lanes."""
    for name in names:

        @overload(name)
        def act(a, b):  # type: ignore[no-untyped-def]
            return (lambda a, b: implementation(a, b)) if mixes_lanes(a, b) else None


@numba.njit
def smaller(a, b):  # type: ignore[no-untyped-def]
    return select(a, b, b, a)


@numba.njit
def larger(a, b):  # type: ignore[no-untyped-def]
    return select(b, a, b, a)


@numba.njit
def both(a, b):  # type: ignore[no-untyped-def]
    return select(abs(a), 0.0, select(abs(b), 0.0, 1.0, 0.0), 0.0)


@numba.njit
def either(a, b):  # type: ignore[no-untyped-def]
    return select(abs(a) + abs(b), 0.0, 1.0, 0.0)


@numba.njit
def neither(a):  # type: ignore[no-untyped-def]
    return select(abs(a), 0.0, 0.0, 1.0)


@numba.njit
def with_sign(a, b):  # type: ignore[no-untyped-def]
    return select(-b, 0.0, -abs(a), abs(a))


@numba.njit
def length(a, b):  # type: ignore[no-untyped-def]
    return square_root(a * a + b * b)


@numba.njit
def arctan2(y, x):  # type: ignore[no-untyped-def]
    half = lane_math.lanes_arctan(y / x) + select(-x, 0.0, with_sign(np.pi, y), 0.0 * x)
    return select(abs(x), 0.0, half, with_sign(0.5 * np.pi, y) * abs(lane_math.lanes_sign(y)))


@overload(np.where)
def where(condition, a, b):  # type: ignore[no-untyped-def]
    """Choose by a condition; also for plain numbers, which numba's own `where` refuses."""
    if mixes_lanes(condition, a, b):
        return lambda condition, a, b: select(abs(1.0 * condition), 0.0, a, b)
    if all(is_number(t) for t in (condition, a, b)):
        return lambda condition, a, b: (a * 1.0) if condition else (b * 1.0)
    return None


@overload(np.clip)
def clip(x, low, high):  # type: ignore[no-untyped-def]
    return (lambda x, low, high: smaller(larger(x, low), high)) if mixes_lanes(x, low, high) else None


def define_power(name: Any) -> None:
    """Give numba the power of lanes."""

    @overload(name)
    def act(a, b):  # type: ignore[no-untyped-def]
        if not mixes_lanes(a, b):
            return None
        width = a.width if isinstance(a, Lanes) else b.width
        return lambda a, b: lane_math.lanes_power(select(1.0, 0.0, a, b), select(1.0, 0.0, b, a), width)


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
define_binary((np.minimum, np.fmin, builtins.min), smaller)
define_binary((np.maximum, np.fmax, builtins.max), larger)
define_binary((np.logical_and, operator.and_), both)
define_binary((np.logical_or, operator.or_), either)
define_binary((np.copysign, math.copysign), with_sign)
define_binary((np.hypot, math.hypot), length)
define_binary((np.arctan2, math.atan2), arctan2)
define_by_lane((np.tan, math.tan), math.tan)
define_by_lane((np.arcsin, math.asin), math.asin)
define_by_lane((np.arccos, math.acos), math.acos)
define_by_lane((np.sinh, math.sinh), math.sinh)
define_by_lane((np.cosh, math.cosh), math.cosh)
define_by_lane((np.expm1, math.expm1), math.expm1)
define_by_lane((np.log1p, math.log1p), math.log1p)
define_by_lane((np.log10, math.log10), math.log10)
