"""Functions of lanes that are one instruction: roots, rounding, selection."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from armid.simulation.lanes.vector import DOUBLE, all_to_lanes, lanes_of, to_lanes


def unary(llvm_name: str) -> Any:
    """Return an intrinsic that maps lanes through an LLVM vector function."""

    @intrinsic
    def act(typing_context, a):
        def generate(context, builder, signature, arguments):
            vector = ir.VectorType(DOUBLE, a.width)
            kind = ir.FunctionType(vector, [vector])
            return builder.call(builder.module.declare_intrinsic(f"{llvm_name}.v{a.width}f64", (), kind), arguments)

        return a(a), generate

    return act


fabs = unary("llvm.fabs")
square_root = unary("llvm.sqrt")
nearest = unary("llvm.rint")
floor_of = unary("llvm.floor")


@intrinsic
def fused(typing_context, a, b, c):
    """Return a b + c with one rounding, never reordered."""
    lanes = lanes_of(a, b, c)

    def generate(context, builder, signature, arguments):
        values = all_to_lanes(context, builder, arguments, signature.args, lanes.width)
        vector = ir.VectorType(DOUBLE, lanes.width)
        name = f"llvm.fma.v{lanes.width}f64"
        return builder.call(builder.module.declare_intrinsic(name, (), ir.FunctionType(vector, [vector] * 3)), values)

    return lanes(a, b, c), generate


@intrinsic
def select(typing_context, a, b, x, y):
    """Return x where a > b, else y (y also where a or b is NaN)."""
    lanes = lanes_of(a, b, x, y)

    def generate(context, builder, signature, arguments):
        p, q, r, s = all_to_lanes(context, builder, arguments, signature.args, lanes.width)
        return builder.select(builder.fcmp_ordered(">", p, q), r, s)

    return lanes(a, b, x, y), generate


@intrinsic
def any_above(typing_context, a, b):
    """Tell whether a > b in any lane."""

    def generate(context, builder, signature, arguments):
        limit = to_lanes(context, builder, arguments[1], signature.args[1], a.width)
        mask = builder.fcmp_ordered(">", arguments[0], limit)
        bits = builder.bitcast(mask, ir.IntType(a.width))
        return builder.icmp_unsigned("!=", bits, ir.Constant(ir.IntType(a.width), 0))

    return types.boolean(a, b), generate
