"""Mantissa and exponent of lanes."""

from llvmlite import ir
from numba.extending import intrinsic

from armid.simulation.lanes.vector import DOUBLE, INT64


@intrinsic
def two_to_the(typing_context, k):
    """Return 2**k for lanes of whole numbers, -1022 <= k <= 1023."""

    def generate(context, builder, signature, arguments):
        whole = ir.VectorType(INT64, k.width)
        exponent = builder.add(builder.fptosi(arguments[0], whole), ir.Constant(whole, [1023] * k.width))
        bits = builder.shl(exponent, ir.Constant(whole, [52] * k.width))
        return builder.bitcast(bits, ir.VectorType(DOUBLE, k.width))

    return k(k), generate


@intrinsic
def mantissa_of(typing_context, x):
    """Return the mantissa m in [1, 2) of positive normal lanes, x = m 2**e."""

    def generate(context, builder, signature, arguments):
        whole = ir.VectorType(INT64, x.width)
        bits = builder.bitcast(arguments[0], whole)
        kept = builder.and_(bits, ir.Constant(whole, [0x000FFFFFFFFFFFFF] * x.width))
        one = builder.or_(kept, ir.Constant(whole, [0x3FF0000000000000] * x.width))
        return builder.bitcast(one, ir.VectorType(DOUBLE, x.width))

    return x(x), generate


@intrinsic
def exponent_of(typing_context, x):
    """Return the binary exponent e of positive normal lanes, x = m 2**e with m in [1, 2)."""

    def generate(context, builder, signature, arguments):
        whole = ir.VectorType(INT64, x.width)
        bits = builder.lshr(builder.bitcast(arguments[0], whole), ir.Constant(whole, [52] * x.width))
        return builder.sitofp(builder.sub(bits, ir.Constant(whole, [1023] * x.width)), ir.VectorType(DOUBLE, x.width))

    return x(x), generate
