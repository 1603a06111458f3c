"""What makes bundles, takes them apart, and makes lanes of them; see simd.py for what acts on each of their lanes."""

from collections.abc import Callable, Iterator
from functools import reduce
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from armid.engine.simd import (
    DOUBLE,
    FLAGS,
    LANES_TYPE,
    NUMBER_TYPES,
    VECTOR,
    Bundle,
    Lanes,
    broadcast,
    bundled,
    to_lanes,
    vector_at,
)


@intrinsic
def bundle(typing_context, values):
    """Return the bundle of a tuple of lanes and numbers."""

    def generate(context, builder, signature, arguments):
        vectors = [
            to_lanes(context, builder, builder.extract_value(arguments[0], i), t) for i, t in enumerate(values.types)
        ]
        return bundled(builder, vectors)

    if not isinstance(values, types.BaseTuple) or not all(isinstance(t, (Lanes, *NUMBER_TYPES)) for t in values.types):
        raise TypingError(f"numbers and lanes are expected, not {values}")
    return Bundle(len(values))(values), generate


@intrinsic
def parts(typing_context, whole):
    """Return the lanes of a bundle as a tuple."""
    return types.UniTuple(LANES_TYPE, whole.count)(whole), lambda context, builder, signature, arguments: arguments[0]


@intrinsic
def joined(typing_context, first, second):
    """Return the bundle of what two bundles hold."""

    def generate(context, builder, signature, arguments):
        counts = (first.count, second.count)
        vectors = [builder.extract_value(a, i) for a, n in zip(arguments, counts, strict=True) for i in range(n)]
        return bundled(builder, vectors)

    return Bundle(first.count + second.count)(first, second), generate


@intrinsic(prefer_literal=True)
def cut(typing_context, whole, first, count):
    """Return the bundle of some neighbours in a bundle."""

    def generate(context, builder, signature, arguments):
        places = range(first.literal_value, first.literal_value + count.literal_value)
        return bundled(builder, [builder.extract_value(arguments[0], i) for i in places])

    return Bundle(count.literal_value)(whole, first, count), generate


def reduction(combine: Callable[..., Any]) -> Any:
    """Return an intrinsic that makes lanes of a bundle, first to last; combine(builder, x, y): LLVM value."""

    @intrinsic
    def act(typing_context, whole):
        def generate(context, builder, signature, arguments):
            vectors = [builder.extract_value(arguments[0], i) for i in range(whole.count)]
            return reduce(lambda x, y: combine(builder, x, y), vectors) if vectors else broadcast(builder, DOUBLE(0.0))

        return LANES_TYPE(whole), generate

    return act


def larger_of(builder: Any, x: Any, y: Any) -> Any:
    return builder.select(builder.fcmp_ordered(">", y, x), y, x)


def smaller_of(builder: Any, x: Any, y: Any) -> Any:
    return builder.select(builder.fcmp_ordered(">", x, y), y, x)


sum_of = reduction(lambda builder, x, y: builder.fadd(x, y, flags=FLAGS))
largest_of, smallest_of = reduction(larger_of), reduction(smaller_of)


@intrinsic(prefer_literal=True)
def load_rows(typing_context, array, index, stride, count):
    """Return the bundle of lanes from a contiguous float64 array, each a stride behind the one before."""

    def generate(context, builder, signature, arguments):
        places = places_of(context, builder, signature, arguments, count.literal_value)
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return bundled(builder, [builder.load(vector_at(builder, data, p), align=8, typ=VECTOR) for p in places])

    return Bundle(count.literal_value)(array, index, stride, count), generate


@intrinsic
def store_rows(typing_context, array, index, stride, value):
    """Write the lanes of a bundle to a contiguous float64 array, each a stride behind the one before."""

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        for i, place in enumerate(places_of(context, builder, signature, arguments, value.count)):
            builder.store(builder.extract_value(arguments[3], i), vector_at(builder, data, place), align=8)
        return context.get_dummy_value()

    return types.void(array, index, stride, value), generate


@intrinsic(prefer_literal=True)
def spread(typing_context, array, count):
    """Return the bundle of the first numbers of a contiguous float64 array, each in all lanes."""

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        places = (builder.gep(data, [ir.Constant(ir.IntType(64), i)], source_etype=DOUBLE)
                  for i in range(count.literal_value))  # fmt: skip
        return bundled(builder, [broadcast(builder, builder.load(p, typ=DOUBLE)) for p in places])

    return Bundle(count.literal_value)(array, count), generate


def places_of(context: Any, builder: Any, signature: Any, arguments: Any, count: int) -> Iterator[Any]:
    """Yield so many indices, each a stride behind the one before; arguments: an array, the first index, the stride."""
    place, stride = (context.cast(builder, arguments[i], signature.args[i], types.intp) for i in (1, 2))
    for i in range(count):
        if i:
            place = builder.add(place, stride)
        yield place
