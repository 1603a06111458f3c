"""Vector of doubles for numba: one value per candidate, side by side in the registers of the processor.

Every operation acts lane by lane, so a candidate's result does not depend on its neighbours.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic, models, overload, register_model

DOUBLE = ir.DoubleType()
INT32 = ir.IntType(32)
INT64 = ir.IntType(64)
# No `nnan` or `ninf`: a diverging candidate must stay visible as NaN or infinity. No `reassoc`: the order in which an
# equation is written is the order in which it is computed.
FLAGS = ("contract", "nsz", "arcp")


class Lanes(types.Type):  # type: ignore[misc]
    """Numba type of `width` doubles that are computed together."""

    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"lanes{width}")

    @property
    def key(self) -> int:
        return self.width


@register_model(Lanes)
class LanesModel(models.PrimitiveModel):  # type: ignore[misc]
    """Store the lanes as one LLVM vector."""

    def __init__(self, dmm: Any, fe_type: Lanes) -> None:
        super().__init__(dmm, fe_type, ir.VectorType(DOUBLE, fe_type.width))


def is_number(numba_type: Any) -> bool:
    """Tell whether a numba type is a plain scalar number."""
    return isinstance(numba_type, (types.Float, types.Integer, types.Boolean))


def mixes_lanes(*numba_types: Any) -> bool:
    """Tell whether the types are numbers and lanes, with lanes among them."""
    return any(isinstance(t, Lanes) for t in numba_types) and all(
        isinstance(t, Lanes) or is_number(t) for t in numba_types
    )


def broadcast(builder: Any, value: Any, width: int) -> Any:
    """Copy one double to every lane."""
    empty = ir.Constant(ir.VectorType(DOUBLE, width), ir.Undefined)
    first = builder.insert_element(empty, value, ir.Constant(INT32, 0))
    return builder.shuffle_vector(first, empty, ir.Constant(ir.VectorType(INT32, width), [0] * width))


def to_lanes(context: Any, builder: Any, value: Any, numba_type: Any, width: int) -> Any:
    """Return the LLVM vector of a value that is a number or already lanes."""
    if isinstance(numba_type, Lanes):
        return value
    return broadcast(builder, context.cast(builder, value, numba_type, types.float64), width)


def lanes_of(*numba_types: Any) -> Lanes:
    """Return the first type that is lanes."""
    return next(t for t in numba_types if isinstance(t, Lanes))


def all_to_lanes(context: Any, builder: Any, values: Any, numba_types: Any, width: int) -> list[Any]:
    """Return the LLVM vectors of values that are numbers or lanes."""
    return [to_lanes(context, builder, v, t, width) for v, t in zip(values, numba_types, strict=True)]


def item_pointer(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    """Return the pointer to one item of a contiguous float64 array."""
    data = context.make_array(array_type)(context, builder, array).data
    return builder.gep(data, [index], source_etype=DOUBLE)


def make_access(width: int) -> tuple[Any, Any]:
    """Return `load(array, index)` and `splat(number)` for lanes of a width."""
    lanes = Lanes(width)

    @intrinsic
    def load(typing_context, array, index):
        def generate(context, builder, signature, arguments):
            i = context.cast(builder, arguments[1], signature.args[1], types.intp)
            pointer = item_pointer(context, builder, signature.args[0], arguments[0], i)
            vector = ir.VectorType(DOUBLE, width)
            return builder.load(builder.bitcast(pointer, vector.as_pointer()), align=8, typ=vector)

        return lanes(array, index), generate

    @intrinsic
    def splat(typing_context, number):
        def generate(context, builder, signature, arguments):
            return to_lanes(context, builder, arguments[0], signature.args[0], width)

        return lanes(number), generate

    return load, splat


@intrinsic
def store(typing_context, array, index, value):
    """Write lanes to a contiguous float64 array from an index on."""

    def generate(context, builder, signature, arguments):
        i = context.cast(builder, arguments[1], signature.args[1], types.intp)
        pointer = item_pointer(context, builder, signature.args[0], arguments[0], i)
        vector = ir.VectorType(DOUBLE, value.width)
        builder.store(arguments[2], builder.bitcast(pointer, vector.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.void(array, index, value), generate


@intrinsic
def lane(typing_context, value, index):
    """Return one lane as a number; a number is its own lane."""

    def generate(context, builder, signature, arguments):
        if not isinstance(value, Lanes):
            return context.cast(builder, arguments[0], signature.args[0], types.float64)
        i = context.cast(builder, arguments[1], signature.args[1], types.intp)
        return builder.extract_element(arguments[0], i)

    return types.float64(value, index), generate


@intrinsic
def with_lane(typing_context, value, index, number):
    """Return the lanes with one of them replaced by a number; what may be None is refused."""
    if not is_number(number):
        raise TypingError(f"a number is expected, {number} was returned")

    def generate(context, builder, signature, arguments):
        i = context.cast(builder, arguments[1], signature.args[1], types.intp)
        x = context.cast(builder, arguments[2], signature.args[2], types.float64)
        return builder.insert_element(arguments[0], x, i)

    return value(value, index, number), generate


@intrinsic
def n_lanes(typing_context, value):
    """Return the number of lanes."""

    def generate(context, builder, signature, arguments):
        return context.get_constant(types.intp, value.width)

    return types.intp(value), generate


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
