"""Compile a function that compiled functions alone call: it is linked into them, and never made executable by itself.

Numba makes machine code of each function, with all that it calls, although only the outermost one runs: half of the
time to compile a model with thirty effects.
"""

from typing import Any

from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, _LowerResult
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering


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


class Linked(CompilerBase):  # type: ignore[misc]
    """Compile as numba does, but for machine code."""

    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [(LinkedLowering if p is NativeLowering else p, text) for p, text in passes.passes]
        passes._finalized = False
        passes.finalize()
        return [passes]


# Options of numba.njit for a function that compiled functions alone call.
LINKED = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": Linked}
