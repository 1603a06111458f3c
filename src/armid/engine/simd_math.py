"""Elementary functions of lanes.

exp, log, sin, cos and arctan are polynomials after a reduction of the argument (relative error a few 1e-16);
what is rare is computed lane by lane with the scalar function.
"""

import builtins
import math
import operator
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba.extending import overload

from armid.engine.simd import (
    LANE_WIDTH,
    LINKED,
    RARE,
    any_above,
    exponent_of,
    fabs,
    floor_of,
    fused,
    is_number,
    lane,
    mantissa_of,
    mixes_lanes,
    nearest,
    negate,
    select,
    square_root,
    two_to_the,
    with_lane,
)

compiled, rare = numba.njit(**LINKED), numba.njit(**RARE)

LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
SMALLEST_FLOAT, LARGEST_FLOAT = 2.2250738585072014e-308, 1.7976931348623157e308
# Angles beyond are reduced one by one.
FAR_ANGLE = 1e5
# pi in three parts: subtracting k PI_A from x is exact, and PI_B and PI_C are what PI_A lacks.
PI_A, PI_B, PI_C = 3.141592653589793, 1.2246467991473532e-16, -2.9947698097183397e-33


@compiled
def lanes_exp(x):
    """Return e**x: x = k ln 2 + r, Taylor series of r, times 2**k; 0 below the normal numbers."""
    bounded = select(x, 709.79, 709.79, select(-x, 708.0, -708.0, x))
    k = nearest(bounded * 1.4426950408889634)
    r = fused(k, -LN2_LOW, fused(k, -LN2_HIGH, bounded))
    p = (r * 1.6059043836821613e-10 + 2.08767569878681e-09) * r + 2.505210838544172e-08
    p = ((p * r + 2.755731922398589e-07) * r + 2.7557319223985893e-06) * r + 2.48015873015873e-05
    p = ((p * r + 0.0001984126984126984) * r + 0.001388888888888889) * r + 0.008333333333333333
    p = ((p * r + 0.041666666666666664) * r + 0.16666666666666666) * r + 0.5
    p = (p * r + 1.0) * r + 1.0
    result = p * two_to_the(k - 1.0) * 2.0
    return select(x, 709.782712893384, np.inf, select(-x, 708.0, 0.0, result))


@compiled
def lanes_log(x):
    """Return the natural logarithm: x = m 2**e, series of (m - 1)/(m + 1); -inf below the normal numbers."""
    m, e = mantissa_of(x), exponent_of(x)
    large = select(m, 1.4142135623730951, 1.0, 0.0)
    m = m * (1.0 - 0.5 * large)
    e = e + large
    f = (m - 1.0) / (m + 1.0)
    s = f * f
    p = ((s * 0.09523809523809523 + 0.10526315789473684) * s + 0.11764705882352941) * s + 0.13333333333333333
    p = ((p * s + 0.15384615384615385) * s + 0.18181818181818182) * s + 0.2222222222222222
    p = ((p * s + 0.2857142857142857) * s + 0.4) * s + 0.6666666666666666
    result = fused(e, LN2_HIGH, fused(f, 2.0, fused(f * s, p, e * LN2_LOW)))
    below = select(-x, 0.0, np.nan, select(x, -1.0, -np.inf, x))
    return select(x, LARGEST_FLOAT, x, select(x, SMALLEST_FLOAT, result, below))


@compiled
def sine_of_reduced(r):
    """Return sin r for abs(r) <= pi/2 (Taylor)."""
    s = r * r
    p = (s * 1.9572941063391263e-20 - 8.22063524662433e-18) * s + 2.8114572543455206e-15
    p = ((p * s - 7.647163731819816e-13) * s + 1.6059043836821613e-10) * s - 2.505210838544172e-08
    p = ((p * s + 2.7557319223985893e-06) * s - 0.0001984126984126984) * s + 0.008333333333333333
    p = p * s - 0.16666666666666666
    return p * s * r + r


@compiled
def alternate(k):
    """Return (-1)**k for whole k."""
    return 1.0 - 2.0 * (k - 2.0 * floor_of(k * 0.5))


def far_by_lane(function: Callable[[float], float]) -> Any:
    """Return what replaces a result by the function of the lane, in each lane that holds a far angle."""

    @rare
    def put(x, result):
        for i in range(LANE_WIDTH):
            if abs(lane(x, i)) > FAR_ANGLE:
                result = with_lane(result, i, function(lane(x, i)))
        return result

    return put


with_far_sines, with_far_cosines = far_by_lane(math.sin), far_by_lane(math.cos)


@compiled
def lanes_sin(x):
    """Return sin x, x reduced by multiples of pi."""
    k = nearest(x * 0.3183098861837907)
    r = fused(k, -PI_C, fused(k, -PI_B, fused(k, -PI_A, x)))
    result = alternate(k) * sine_of_reduced(r)
    return with_far_sines(x, result) if any_above(fabs(x), FAR_ANGLE) else result


@compiled
def lanes_cos(x):
    """Return cos x as the sine of an argument shifted by pi/2."""
    k = nearest(x * 0.3183098861837907 - 0.5)
    half = k + 0.5
    r = fused(half, -PI_C, fused(half, -PI_B, fused(half, -PI_A, x)))
    result = -alternate(k) * sine_of_reduced(r)
    return with_far_cosines(x, result) if any_above(fabs(x), FAR_ANGLE) else result


@compiled
def lanes_arctan(x):
    """Return arctan x (rational form of the Cephes library after two reductions)."""
    t = fabs(x)
    # A zero denominator in the branch not taken must not raise a NaN in the branch taken, and does not: select.
    reduced = select(t, 2.414213562373095, -1.0 / t, select(t, 0.66, (t - 1.0) / (t + 1.0), t))
    offset = select(t, 2.414213562373095, 1.5707963267948966, select(t, 0.66, 0.7853981633974483, 0.0))
    s = reduced * reduced
    p = (s * -8.750608600031904122785e-1 - 1.615753718733365076637e1) * s - 7.500855792314704667340e1
    p = (p * s - 1.228866684490136173410e2) * s - 6.485021904942025371773e1
    q = ((s + 2.485846490142306297962e1) * s + 1.650270098316988542046e2) * s + 4.328810604912902668951e2
    q = (q * s + 4.853903996359136964868e2) * s + 1.945506571482613964425e2
    y = fused(reduced, s * p / q, reduced) + offset
    return select(-x, 0.0, -y, y)


@compiled
def lanes_tanh(x):
    """Return tanh x from e**(-2 abs(x)); a series near 0 keeps the relative accuracy."""
    t = lanes_exp(-2.0 * fabs(x))
    far = (1.0 - t) / (1.0 + t)
    s = x * x
    near = fabs(x) * (1.0 + s * (-0.3333333333333333 + s * (0.13333333333333333 - s * 0.05396825396825397)))
    y = select(fabs(x), 0.02, far, near)
    return select(-x, 0.0, -y, y)


@compiled
def lanes_sign(x):
    """Return -1, 0 or 1; NaN stays NaN."""
    return select(x, 0.0, 1.0, select(-x, 0.0, -1.0, x * 0.0))


@compiled
def lanes_power(base, exponent):
    """Return a**b: exp(b log a) where a > 0 and that is a number, the scalar function in the other lanes."""
    a, b = select(1.0, 0.0, base, exponent), select(1.0, 0.0, exponent, base)
    result = lanes_exp(b * lanes_log(a))
    is_rare = any_above(select(a, SMALLEST_FLOAT, result != result, 1.0), 0.5)
    return power_by_lane(a, b, result) if is_rare else result


@rare
def power_by_lane(a, b, result):
    for i in range(LANE_WIDTH):
        if not (lane(a, i) > SMALLEST_FLOAT and lane(result, i) == lane(result, i)):
            result = with_lane(result, i, math.pow(lane(a, i), lane(b, i)))
    return result


# Every function that lanes have; what is not here is computed lane by lane.
LANE_FUNCTIONS: set[Any] = {np.where, np.clip}


def define_unary(names: tuple[Any, ...], implementation: Callable[..., Any]) -> None:
    """Give numba the functions of one lane argument."""
    LANE_FUNCTIONS.update(names)
    for name in names:

        @overload(name, jit_options=LINKED)
        def act(x):
            return (lambda x: implementation(x)) if mixes_lanes(x) else None


def define_binary(names: tuple[Any, ...], implementation: Callable[..., Any]) -> None:
    """Give numba functions of two arguments, at least one of them lanes."""
    LANE_FUNCTIONS.update(names)
    for name in names:

        @overload(name, jit_options=LINKED)
        def act(a, b):
            return (lambda a, b: implementation(a, b)) if mixes_lanes(a, b) else None


smaller = compiled(lambda a, b: select(a, b, b, a))
larger = compiled(lambda a, b: select(b, a, b, a))
with_sign = compiled(lambda a, b: select(-b, 0.0, -abs(a), abs(a)))


@compiled
def length(a, b):
    """Return the root of the sum of squares, which must be neither too large nor too small for a double."""
    return square_root(a * a + b * b)


@compiled
def arctan2(y, x):
    half = lanes_arctan(y / x) + select(-x, 0.0, with_sign(np.pi, y), 0.0)
    return select(x == 0.0, 0.5, with_sign(0.5 * np.pi, y) * abs(lanes_sign(y)), half)


@overload(np.where, jit_options=LINKED)
def where(condition, a, b):
    """Choose by a condition; also for plain numbers, which numba's own `where` refuses."""
    if mixes_lanes(condition, a, b):
        return lambda condition, a, b: select(condition != 0.0, 0.5, a, b)
    if all(is_number(t) for t in (condition, a, b)):
        return lambda condition, a, b: (a * 1.0) if condition else (b * 1.0)
    return None


@overload(np.clip, jit_options=LINKED)
def clip(x, low, high):
    """Bound from below, then from above; also plain numbers, which numba's own `clip` returns as an array."""
    if mixes_lanes(x, low, high) or all(is_number(t) for t in (x, low, high)):
        return lambda x, low, high: np.minimum(np.maximum(x, low), high)
    return None


define_unary((np.sqrt, math.sqrt), square_root)
define_unary((np.abs, np.fabs, math.fabs, builtins.abs), fabs)
define_unary((np.floor,), floor_of)
define_unary((np.rint,), nearest)
define_unary((np.exp, math.exp), lanes_exp)
define_unary((np.log, math.log), lanes_log)
define_unary((np.sin, math.sin), lanes_sin)
define_unary((np.cos, math.cos), lanes_cos)
define_unary((np.arctan, math.atan), lanes_arctan)
define_unary((np.tanh, math.tanh), lanes_tanh)
define_unary((np.sign,), lanes_sign)
define_unary((np.square,), compiled(lambda x: x * x))
define_unary((np.reciprocal,), compiled(lambda x: 1.0 / x))
define_unary((np.negative, operator.neg), negate)
define_unary((operator.pos,), compiled(lambda x: x))
define_unary((np.logical_not, operator.invert), compiled(lambda x: x == 0.0))
define_binary((operator.pow, np.power, math.pow), lanes_power)
define_binary((builtins.min,), smaller)
define_binary((builtins.max,), larger)
# `smaller` and `larger` return the first where one of the two is NaN; these pass on the NaN of either, or of neither.
define_binary((np.minimum,), compiled(lambda a, b: select(b != b, 0.5, b, smaller(a, b))))
define_binary((np.maximum,), compiled(lambda a, b: select(b != b, 0.5, b, larger(a, b))))
define_binary((np.fmin,), compiled(lambda a, b: select(a != a, 0.5, b, smaller(a, b))))
define_binary((np.fmax,), compiled(lambda a, b: select(a != a, 0.5, b, larger(a, b))))
define_binary((np.logical_and, operator.and_), compiled(lambda a, b: select(a != 0.0, 0.5, b != 0.0, 0.0)))
define_binary((np.logical_or, operator.or_), compiled(lambda a, b: select(a != 0.0, 0.5, 1.0, b != 0.0)))
define_binary((np.copysign, math.copysign), with_sign)
define_binary((np.hypot, math.hypot), length)
define_binary((np.arctan2, math.atan2), arctan2)
