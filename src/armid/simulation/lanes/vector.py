"""The numba type of lanes, and how plain numbers become lanes."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import models, register_model

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
