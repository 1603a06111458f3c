"""Vector of doubles for numba: one value per candidate, side by side in the registers of the processor.

Every operation acts lane by lane, so a candidate's result does not depend on its neighbours. A bundle holds the lanes
of several quantities, such as the states of a machine; an operation acts on each of them. To numba it is one variable,
and numba's time to compile grows with their number; to the processor it is a number of registers.

A function that compiled functions alone call is linked into them (`LINKED`), and never made executable by itself: numba
makes machine code of each function with all that it calls, which is half of the time to compile a model with thirty
effects.
"""

import operator
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from llvmlite import ir
from numba import _dynfunc, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, _LowerResult
from numba.core.compiler_machinery import register_pass
from numba.core.errors import TypingError
from numba.core.registry import cpu_target
from numba.core.typed_passes import NativeLowering, NopythonRewrites
from numba.core.typing import signature
from numba.core.typing.templates import AbstractTemplate, infer_global
from numba.extending import intrinsic, lower_builtin, models, register_model


class LinkedLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Hold the intermediate code of one function, without that of the functions that it calls."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class LinkedLowering(NativeLowering):  # type: ignore[misc]
    """Lower a function into a library that is only linked."""

    _name = "linked_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = LinkedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        library, lowered = state.library, state.cr
        # Numba looks the function up by a name that could be called, were its address not 0.
        module, name = lowered.fndesc.lookup_module(), state.func_id.func_name
        key = _dynfunc.make_function(module, name, "", 0, lowered.env, (library,))
        needed = tuple(dict.fromkeys([library, *library._linking_libraries]))
        state.targetctx.insert_user_function(key, lowered.fndesc, needed)
        state.cr = _LowerResult(lowered.fndesc, lowered.call_helper, cfunc=key, env=lowered.env)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class LoweringApart(LinkedLowering):
    """Lower a function that stays a call wherever it is linked."""

    _name = "lowering_apart"

    def run_pass(self, state: Any) -> bool:
        super().run_pass(state)
        state.library._final_module.get_function(state.cr.fndesc.llvm_func_name).add_function_attribute("noinline")
        return True


class Linked(CompilerBase):  # type: ignore[misc]
    """Compile as numba does, but for machine code, and for what numba rewrites of operations on arrays."""

    lowering = LinkedLowering

    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        kept = [(p, text) for p, text in passes.passes if p is not NopythonRewrites]
        passes.passes = [(self.lowering if p is NativeLowering else p, text) for p, text in kept]
        passes._finalized = False
        passes.finalize()
        return [passes]


class LinkedApart(Linked):
    """Compile what is rarely called: written into its callers, it would be most of what there is to compile."""

    lowering = LoweringApart


# Options of numba.njit for a function that compiled functions alone call, and for one that stays a call in them. Numba
# hands `forceinline` on from a caller that says nothing else.
LINKED = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": Linked}
RARE = LINKED | {"pipeline_class": LinkedApart, "forceinline": False}


# Candidates side by side: one register of AVX-512, two of AVX2. Measured on the arm: 16 lanes are slower, because their
# values no longer fit.
LANE_WIDTH = 8
DOUBLE = ir.DoubleType()
INT32 = ir.IntType(32)
VECTOR, WHOLE_NUMBERS = ir.VectorType(DOUBLE, LANE_WIDTH), ir.VectorType(ir.IntType(64), LANE_WIDTH)
NUMBER_TYPES = (types.Float, types.Integer, types.Boolean)
# No `nnan` or `ninf`: a diverging candidate must stay visible as NaN or infinity. No `reassoc`: the order in which an
# equation is written is the order in which it is computed.
FLAGS = ("contract", "nsz", "arcp")


class Lanes(types.Type):  # type: ignore[misc]
    """Numba type of doubles that are computed together."""


class Bundle(types.Type):  # type: ignore[misc]
    """Numba type of the lanes of several quantities."""

    def __init__(self, count: int) -> None:
        self.count = count
        super().__init__(f"bundle{count}")


LANES_TYPE = Lanes(f"lanes{LANE_WIDTH}")


@register_model(Lanes)
class LanesModel(models.PrimitiveModel):  # type: ignore[misc]
    """Store the lanes as one LLVM vector."""

    def __init__(self, dmm: Any, fe_type: Lanes) -> None:
        super().__init__(dmm, fe_type, VECTOR)


@register_model(Bundle)
class BundleModel(models.PrimitiveModel):  # type: ignore[misc]
    """Store a bundle as an LLVM array of vectors, as numba does a tuple of lanes."""

    def __init__(self, dmm: Any, fe_type: Bundle) -> None:
        super().__init__(dmm, fe_type, ir.ArrayType(VECTOR, fe_type.count))


def is_number(numba_type: Any) -> bool:
    return isinstance(numba_type, NUMBER_TYPES)


def joint_type(*given: Any) -> Any:
    """Return the numba type of what an operation makes of numbers, lanes and bundles of one size.

    None where there are other types among them, bundles of several sizes, or numbers alone.
    """
    several = [t for t in given if not is_number(t)]
    bundles = {t for t in several if isinstance(t, Bundle)}
    if not several or len(bundles) > 1 or not all(isinstance(t, (Lanes, Bundle)) for t in several):
        return None
    return bundles.pop() if bundles else LANES_TYPE


def mixes_lanes(*given: Any) -> bool:
    """Tell whether an operation on numba types is one on lanes."""
    return joint_type(*given) is not None


def broadcast(builder: Any, value: Any) -> Any:
    empty = ir.Constant(VECTOR, ir.Undefined)
    first = builder.insert_element(empty, value, ir.Constant(INT32, 0))
    return builder.shuffle_vector(first, empty, ir.Constant(ir.VectorType(INT32, LANE_WIDTH), [0] * LANE_WIDTH))


def to_lanes(context: Any, builder: Any, value: Any, numba_type: Any) -> Any:
    """Return the LLVM vector of a value that is a number or already lanes."""
    if isinstance(numba_type, Lanes):
        return value
    return broadcast(builder, context.cast(builder, value, numba_type, types.float64))


def vector_pointer(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Return the pointer to lanes in a contiguous float64 array; the arguments begin with the array and an index."""
    i = context.cast(builder, arguments[1], signature.args[1], types.intp)
    return vector_at(builder, context.make_array(signature.args[0])(context, builder, arguments[0]).data, i)


def vector_at(builder: Any, data: Any, place: Any) -> Any:
    return builder.bitcast(builder.gep(data, [place], source_etype=DOUBLE), VECTOR.as_pointer())


def on_lanes(compute: Callable[..., Any]) -> Callable[..., Any]:
    """Return code whose arguments become lanes; compute(builder, vectors...): LLVM value, for each in a bundle."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pairs = list(zip(arguments, signature.args, strict=True))
        alike = [None if isinstance(t, Bundle) else to_lanes(context, builder, v, t) for v, t in pairs]
        result = signature.return_type
        if not isinstance(result, Bundle):
            return compute(builder, *alike)
        made = []
        for i in range(result.count):
            vectors = (builder.extract_value(v, i) if x is None else x for x, (v, _) in zip(alike, pairs, strict=True))
            made.append(compute(builder, *vectors))
        return bundled(builder, made)

    return generate


def bundled(builder: Any, vectors: Sequence[Any]) -> Any:
    """Return the LLVM array of vectors."""
    result = ir.Constant(ir.ArrayType(VECTOR, len(vectors)), ir.Undefined)
    for i, vector in enumerate(vectors):
        result = builder.insert_value(result, vector, i)
    return result


def elementwise(compute: Callable[..., Any], *given: Any) -> tuple[Any, Callable[..., Any]]:
    """Return signature and code of an intrinsic on lanes or bundles; given: numba types of what it takes."""
    result = LANES_TYPE if all(map(is_number, given)) else joint_type(*given)
    if result is None:
        raise TypingError(f"numbers, lanes or bundles of one size are expected, not {', '.join(map(str, given))}")
    return result(*given), on_lanes(compute)


@intrinsic
def load(typing_context, array, index):
    """Return lanes from a contiguous float64 array from an index on."""

    def generate(context, builder, signature, arguments):
        return builder.load(vector_pointer(context, builder, signature, arguments), align=8, typ=VECTOR)

    return LANES_TYPE(array, index), generate


@intrinsic
def splat(typing_context, number):
    """Return lanes that all hold a number."""
    return elementwise(lambda builder, x: x, number)


@intrinsic
def gather(typing_context, array, places):
    """Return lanes from a contiguous float64 array, each from its own place, a whole number inside the array."""

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        indices = builder.fptosi(arguments[1], WHOLE_NUMBERS)
        result = ir.Constant(VECTOR, ir.Undefined)
        for i in range(LANE_WIDTH):
            place = builder.extract_element(indices, ir.Constant(INT32, i))
            value = builder.load(builder.gep(data, [place], source_etype=DOUBLE), align=8, typ=DOUBLE)
            result = builder.insert_element(result, value, ir.Constant(INT32, i))
        return result

    return places(array, places), generate


@intrinsic
def store(typing_context, array, index, value):
    """Write lanes to a contiguous float64 array from an index on."""

    def generate(context, builder, signature, arguments):
        builder.store(arguments[2], vector_pointer(context, builder, signature, arguments), align=8)
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


class LanesOperator(AbstractTemplate):  # type: ignore[misc]
    """Type an operator for lanes with lanes and lanes with numbers."""

    def generic(self, given: Any, named: Any) -> Any:
        result = joint_type(*given)
        return None if result is None else signature(result, *given)


def define_operator(python_operator: Any, compute: Callable[..., Any]) -> None:
    """Give numba the operator for lanes with lanes and lanes with numbers.

    It is written into its caller: as a function it would have to be compiled for each pair of types.
    """
    infer_global(python_operator)(LanesOperator)
    kinds = (Lanes, Bundle, *NUMBER_TYPES)
    for pair in ((a, b) for a in kinds for b in kinds if {a, b} & {Lanes, Bundle}):
        lower_builtin(python_operator, *pair)(on_lanes(compute))


def comparison(symbol: str) -> Callable[..., Any]:
    def compute(builder: Any, x: Any, y: Any) -> Any:
        true, false = (broadcast(builder, ir.Constant(DOUBLE, c)) for c in (1.0, 0.0))
        compare = builder.fcmp_unordered if symbol == "!=" else builder.fcmp_ordered
        return builder.select(compare(symbol, x, y), true, false)

    return compute


ARITHMETIC = ("add", "sub", "mul", "truediv")
COMPARISONS = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}


@cache
def ask_lanes_first() -> None:
    """Have numba ask what an operator does to lanes before what it does to lists, sets, dates and arrays.

    Each of these refuses lanes with an error that names what it would take: a sixth of the time to compile a model.
    """
    context = cpu_target.typing_context
    context.refresh()
    for name in (*ARITHMETIC, *COMPARISONS):
        known = context.resolve_value_type(getattr(operator, name))
        known.templates = tuple(sorted(known.templates, key=lambda t: not issubclass(t, LanesOperator)))


for _name in ARITHMETIC:
    _instruction = {"truediv": "fdiv"}.get(_name, f"f{_name}")
    define_operator(
        getattr(operator, _name), lambda builder, x, y, i=_instruction: getattr(builder, i)(x, y, flags=FLAGS)
    )
for _name, _symbol in COMPARISONS.items():
    define_operator(getattr(operator, _name), comparison(_symbol))


@intrinsic
def negate(typing_context, a):
    return elementwise(lambda builder, x: builder.fneg(x, flags=FLAGS), a)


def vector_call(builder: Any, name: str, *vectors: Any) -> Any:
    kind = ir.FunctionType(VECTOR, [VECTOR] * len(vectors))
    function = builder.module.declare_intrinsic(f"llvm.{name}.v{LANE_WIDTH}f64", (), kind)
    return builder.call(function, vectors)


def unary(name: str) -> Any:
    """Return an intrinsic that maps lanes through an LLVM vector function."""

    @intrinsic
    def act(typing_context, a):
        return elementwise(lambda builder, x: vector_call(builder, name, x), a)

    return act


fabs = unary("fabs")
square_root = unary("sqrt")
nearest = unary("rint")
floor_of = unary("floor")


@intrinsic
def fused(typing_context, a, b, c):
    """Return a b + c with one rounding, never reordered."""
    return elementwise(lambda builder, *vectors: vector_call(builder, "fma", *vectors), a, b, c)


@intrinsic
def select(typing_context, a, b, x, y):
    """Return x where a > b, else y (y also where a or b is NaN)."""

    def compute(builder, p, q, r, s):
        return builder.select(builder.fcmp_ordered(">", p, q), r, s)

    return elementwise(compute, a, b, x, y)


@intrinsic
def any_above(typing_context, a, b):
    """Tell whether a > b in any lane."""

    def compute(builder, x, limit):
        mask = ir.IntType(LANE_WIDTH)
        bits = builder.bitcast(builder.fcmp_ordered(">", x, limit), mask)
        return builder.icmp_unsigned("!=", bits, ir.Constant(mask, 0))

    return types.boolean(a, b), on_lanes(compute)


def whole(value: int) -> Any:
    return ir.Constant(WHOLE_NUMBERS, [value] * LANE_WIDTH)


@intrinsic
def two_to_the(typing_context, k):
    """Return 2**k for lanes of whole numbers, -1022 <= k <= 1023."""

    def compute(builder, x):
        exponent = builder.add(builder.fptosi(x, WHOLE_NUMBERS), whole(1023))
        return builder.bitcast(builder.shl(exponent, whole(52)), x.type)

    return elementwise(compute, k)


@intrinsic
def mantissa_of(typing_context, x):
    """Return the mantissa m in [1, 2) of positive normal lanes, x = m 2**e."""

    def compute(builder, value):
        bits = builder.bitcast(value, WHOLE_NUMBERS)
        kept = builder.and_(bits, whole(0x000FFFFFFFFFFFFF))
        return builder.bitcast(builder.or_(kept, whole(0x3FF0000000000000)), value.type)

    return elementwise(compute, x)


@intrinsic
def exponent_of(typing_context, x):
    """Return the binary exponent e of positive normal lanes, x = m 2**e with m in [1, 2)."""

    def compute(builder, value):
        bits = builder.lshr(builder.bitcast(value, WHOLE_NUMBERS), whole(52))
        return builder.sitofp(builder.sub(bits, whole(1023)), value.type)

    return elementwise(compute, x)
