"""Lanes to and from memory, and single lanes."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from armid.simulation.lanes.vector import DOUBLE, Lanes, is_number, to_lanes


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
