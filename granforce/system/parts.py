"""Compile parts of kernels once: optimised and made machine code only in the kernels around them.

Numba compiles every function by itself, and again within each function that calls it: what lies
five calls deep is optimised five times over, and its own machine code is never called. Functions
that only kernels call stay here as they are lowered; the optimiser sees them, whole, in the kernels
that Python calls. Numbers are the same: it may not change the rounding of any operation.
"""

from typing import Any

from llvmlite import binding
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class _Part(JITCodeLibrary):  # type: ignore[misc]  # numba says no types
    """Code that others link: neither optimised nor run by itself."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        # Numba sets the address of the function's environment, which must exist therefore.
        environments = [
            str(variable)
            for variable in self._final_module.global_variables
            if variable.linkage == binding.Linkage.common
        ]
        self._codegen._add_module(binding.parse_assembly("\n".join(environments)))
        self._codegen._engine.finalize_object()
        self._finalize_dynamic_globals()
        self._finalized = True

    def serialize_using_object_code(self) -> Any:
        return self.serialize_using_bitcode()


class PartCompiler(Compiler):  # type: ignore[misc]
    """Numba's compiler, for functions that only kernels call."""

    def define_pipelines(self) -> Any:
        self.state.library = _Part(self.state.targetctx.codegen(), self.state.func_id.func_name)
        return super().define_pipelines()
