"""Load compiled code from disk without numba's registries.

Numba loads every typing and lowering rule it has before it loads machine code that needs none of them: half of the
time that a second start takes. What is left out here is loaded by numba itself as soon as something is compiled.
"""

from typing import Any


def load_lightly(kernel: Any) -> Any:
    """Return the kernel, taught to load its machine code with numba's runtime alone.

    Rests on private names of numba; where a version does not have them, the kernel stays as it is.
    """
    cache: Any = getattr(kernel, "_cache", None)
    if not (hasattr(cache, "_load_overload") and hasattr(cache, "_guard_against_spurious_io_errors")):
        return kernel
    try:
        from numba.core.runtime import rtsys  # noqa: PLC0415 - where it is missing, numba loads as it always does
    except ImportError:
        return kernel

    def load_overload(signature: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with cache._guard_against_spurious_io_errors():
            return cache._load_overload(signature, target_context)

    cache.load_overload = load_overload
    return kernel
