"""Operators of lanes with lanes and of lanes with numbers."""

import operator
from typing import Any

from llvmlite import ir
from numba.extending import intrinsic, overload

from armid.simulation.lanes.vector import DOUBLE, FLAGS, Lanes, all_to_lanes, broadcast, lanes_of, mixes_lanes


def define_arithmetic(python_operator: Any, instruction: str) -> None:
    """Give numba the operator for lanes with lanes and lanes with numbers."""

    @intrinsic
    def act(typing_context, a, b):
        lanes = lanes_of(a, b)

        def generate(context, builder, signature, arguments):
            x, y = all_to_lanes(context, builder, arguments, signature.args, lanes.width)
            return getattr(builder, instruction)(x, y, flags=FLAGS)

        return lanes(a, b), generate

    @overload(python_operator, inline="never")
    def operate(a, b):
        return (lambda a, b: act(a, b)) if mixes_lanes(a, b) else None


for _operator, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    define_arithmetic(_operator, _instruction)


def define_comparison(python_operator: Any, symbol: str) -> None:
    """Give numba a comparison that returns 1.0 where it holds and 0.0 elsewhere."""

    @intrinsic
    def act(typing_context, a, b):
        lanes = lanes_of(a, b)

        def generate(context, builder, signature, arguments):
            x, y = all_to_lanes(context, builder, arguments, signature.args, lanes.width)
            true, false = (broadcast(builder, ir.Constant(DOUBLE, c), lanes.width) for c in (1.0, 0.0))
            compare = builder.fcmp_unordered if symbol == "!=" else builder.fcmp_ordered
            return builder.select(compare(symbol, x, y), true, false)

        return lanes(a, b), generate

    @overload(python_operator)
    def operate(a, b):
        return (lambda a, b: act(a, b)) if mixes_lanes(a, b) else None


for _operator, _symbol in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
    (operator.ne, "!="),
):
    define_comparison(_operator, _symbol)


@intrinsic
def negate(typing_context, a):
    def generate(context, builder, signature, arguments):
        return builder.fneg(arguments[0], flags=FLAGS)

    return a(a), generate


@overload(operator.neg)
def lanes_neg(a):
    return (lambda a: negate(a)) if isinstance(a, Lanes) else None


@overload(operator.pos)
def lanes_pos(a):
    return (lambda a: a) if isinstance(a, Lanes) else None
